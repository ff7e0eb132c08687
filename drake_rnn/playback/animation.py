"""Moving parts of a scene: objects that the recording moves, and traced paths that grow."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from .. import colours
from ..inputs.fields import Array
from .lines import LineMesh, merged
from .packing import packed


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
    """Lines that grow: one mesh, of which the page shows the faces that are reached by a time.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
    """

    def __init__(self, meshcat: Meshcat, place: str = "/traced/path") -> None:
        self._meshcat = meshcat
        self._place = place
        self._lines: list[tuple[LineMesh, Array]] = []

    def add(self, line: LineMesh, time: Array) -> None:
        """Add a line.

        Args:
            line: The line, of two or more points.
            time: Time at which each point was passed, shape (k,) [s].
        """
        self._lines.append((line, np.asarray(time)))

    def draw(self) -> None:
        """Draw all lines; none, if none was added."""
        if not self._lines:
            return
        mesh = merged([line for line, _ in self._lines])
        draw_smooth(self._meshcat, self._place, *mesh, colours.TRACED)

    def as_data(self) -> list[dict[str, Any]]:
        """Return how the mesh grows: the number of faces that are visible at each time."""
        if not self._lines:
            return []
        before, reached = 0, []
        for line, _ in self._lines:
            # The round beginning of a line is visible from its first point on.
            reached.append(before + np.append(0, line.reached[1:]))
            before += line.faces.shape[1]
        time = np.concatenate([time for _, time in self._lines])
        faces = packed(np.concatenate(reached))
        return [{"path": self._place, "time": packed(time), "faces": faces}]


def draw_smooth(
    meshcat: Meshcat,
    place: str,
    vertices: Any,
    faces: Any,
    colour: str,
    side: Meshcat.SideOfFaceToRender = Meshcat.SideOfFaceToRender.kDoubleSide,
) -> None:
    """Draw a mesh whose faces join smoothly; Meshcat would show each of them flat.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
        vertices: Shape (3, v) [m].
        faces: Indices of each triangle's corners, shape (3, f).
        colour: One of `drake_rnn.colours`.
        side: Which side of the faces is drawn.
    """
    rgba = Rgba(*colours.components(colour))
    meshcat.SetTriangleMesh(place, vertices, faces, rgba, side=side)
    meshcat.SetProperty(f"{place}/<object>", "material.flatShading", False)
