"""A traced path that appears as time passes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from ..inputs.fields import Array
from .stage import TRACED_COLOUR

_PIECES_PER_SECOND = 12
_MOST_PIECES = 400


class Trace:
    """Lines in pieces, for what is recorded can show a mesh but not change it.

    Args:
        meshcat: Holds the scene; the pieces lie below "/traced/path".
        until: When the run ends [s].
    """

    def __init__(self, meshcat: Meshcat, until: float) -> None:
        self._meshcat = meshcat
        self._until = until
        self._since: dict[str, float] = {}

    def add(self, line: tuple[Any, Any, Any], time: Array) -> None:
        """Add a line.

        Args:
            line: Two or more points as a mesh, as `tubes.tube` and `ribbons.ribbon` return it.
            time: When each point was passed, shape (k,) [s].
        """
        vertices, faces, reached = line
        for begin, end in self._pieces(time):
            path = f"/traced/path/{len(self._since):03d}"
            piece = faces[:, reached[begin] : reached[end]]
            first, last = piece.min(), piece.max()
            self._meshcat.SetTriangleMesh(
                path, vertices[:, first : last + 1], piece - first, Rgba(*TRACED_COLOUR)
            )
            self._since[path] = float(time[end])

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Let each piece appear once its end is reached; ``time`` of the frames, shape (f,) [s]."""
        last = len(time) - 1
        for path, since in self._since.items():
            frame = int(np.searchsorted(time, since - 1e-6 * time[1])) if last else 0
            recording.SetProperty(0, path, "visible", frame == 0)
            recording.SetProperty(frame, path, "visible", True)
            # A track repeats when it ends: this one must be as long as all others.
            recording.SetProperty(last, path, "visible", True)

    def _pieces(self, time: Array) -> Iterator[tuple[int, int]]:
        """First and last point of each."""
        count = min(math.ceil(self._until * _PIECES_PER_SECOND), _MOST_PIECES)
        ends = np.searchsorted(time, np.linspace(0.0, self._until, count + 1)[1:] - 1e-9)
        begin = 0
        for end in np.unique(np.minimum(ends[ends > 0], len(time) - 1)).tolist():
            yield begin, end
            begin = end
