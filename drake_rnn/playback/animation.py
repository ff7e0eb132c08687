"""What moves: objects, by the recording, and a traced path, which the page lets grow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from .. import colours
from ..inputs.fields import Array
from .lines import LineMesh
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
        self._vertices: list[Array] = []
        self._faces: list[NDArray[np.int32]] = []
        self._time: list[Array] = []
        self._reached: list[NDArray[np.int64]] = []
        self._counts = np.zeros(2, dtype=int)

    def add(self, line: LineMesh, time: Array) -> None:
        """Add a line.

        Args:
            line: The line, of two or more points.
            time: Time at which each point was passed, shape (k,) [s].
        """
        vertices, faces, reached = line
        vertex_count, face_count = self._counts
        self._vertices.append(vertices)
        self._faces.append(faces + np.int32(vertex_count))
        self._time.append(np.asarray(time))
        # What rounds off the beginning of a line is no part of its first step.
        self._reached.append(np.where(np.arange(len(reached)) == 0, 0, reached) + face_count)
        self._counts += (vertices.shape[1], faces.shape[1])

    def draw(self) -> None:
        """Draw all lines; none, if none was added."""
        if self._vertices:
            vertices = np.asfortranarray(np.concatenate(self._vertices, axis=1))
            faces = np.asfortranarray(np.concatenate(self._faces, axis=1))
            draw_smooth(self._meshcat, self._place, vertices, faces, colours.TRACED)

    def as_data(self) -> list[dict[str, Any]]:
        """Return how the mesh grows: by each time, how many faces are to be seen."""
        if not self._time:
            return []
        time, reached = np.concatenate(self._time), np.concatenate(self._reached)
        return [{"path": self._place, "time": packed(time), "faces": packed(reached)}]


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
