"""Things that move along."""

from __future__ import annotations

from pydrake.geometry import MeshcatAnimation

from ..inputs.fields import Array


def move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    """Let what is at ``path`` in the scene be at ``points``, shape (f, 3) [m], frame by frame."""
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)
