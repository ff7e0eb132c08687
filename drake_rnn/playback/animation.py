"""The recorded animation: objects that move, and a traced path that appears as time passes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from ..inputs.fields import Array
from .lines import LineMesh
from .stage import TRACED_COLOUR

_PIECES_PER_SECOND = 12
_MOST_PIECES = 400


def move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    """Record the position of an object frame by frame.

    Args:
        recording: The animation.
        path: Scene path of the object.
        points: Its position in each frame, shape (f, 3) [m].
    """
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)


class Trace:
    """Lines that grow, cut into pieces: an animation can show a mesh but not change it.

    Args:
        meshcat: Meshcat with the scene.
        duration: Duration of the run [s].
        place: Scene path that the pieces are below.
    """

    def __init__(self, meshcat: Meshcat, duration: float, place: str = "/traced/path") -> None:
        self._meshcat = meshcat
        self._duration = duration
        self._place = place
        self._appears: dict[str, float] = {}

    def add(self, line: LineMesh, time: Array) -> None:
        """Add a line.

        Args:
            line: The line, of two or more points.
            time: Time at which each point was passed, shape (k,) [s].
        """
        vertices, faces, reached = line
        for begin, end in self._pieces(time):
            path = f"{self._place}/{len(self._appears):03d}"
            piece = faces[:, reached[begin] : reached[end]]
            first, last = piece.min(), piece.max()
            self._meshcat.SetTriangleMesh(
                path, vertices[:, first : last + 1], piece - first, Rgba(*TRACED_COLOUR)
            )
            self._appears[path] = float(time[end])

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record that each piece appears when its end is reached.

        Args:
            recording: The animation.
            time: Time of each frame, shape (f,) [s].
        """
        last = len(time) - 1
        for path, appears in self._appears.items():
            frame = int(np.searchsorted(time, appears - 1e-6 * time[1])) if last else 0
            recording.SetProperty(0, path, "visible", frame == 0)
            recording.SetProperty(frame, path, "visible", True)
            # Each track repeats on its own: they stay in step only if all are equally long.
            recording.SetProperty(last, path, "visible", True)

    def _pieces(self, time: Array) -> Iterator[tuple[int, int]]:
        """Yield the indices of the first and the last point of each piece."""
        count = min(math.ceil(self._duration * _PIECES_PER_SECOND), _MOST_PIECES)
        ends = np.searchsorted(time, np.linspace(0.0, self._duration, count + 1)[1:] - 1e-9)
        begin = 0
        for end in np.unique(np.minimum(ends[ends > 0], len(time) - 1)).tolist():
            yield begin, end
            begin = end
