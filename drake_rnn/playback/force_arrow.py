"""The force on the tool, as an arrow from the point of contact."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..inputs.fields import Array
from .replay import ReplayedContact

#: Length of the arrow for the force that the legend names [m].
LENGTH = 0.1
# Largest length of the arrow for forces that last; brief peaks may exceed it [m].
_LONGEST = 0.3
# Radii of shaft and head, and length of the head [m].
_SHAFT, _HEAD, _HEAD_LENGTH = 0.0028, 0.0075, 0.026
_SIDES = 24
# The arrow lies mostly inside the tool: it is drawn last, over whatever is in front of it.
_IN_FRONT = {
    "castShadow": False,
    "material.depthTest": False,
    "material.transparent": True,
    "renderOrder": 2.0,
}
# Share of the desired force below which an arrow would be too short to be seen.
_NONE = 1e-3
# Norm of the sum of two unit vectors below which they count as opposite.
_OPPOSITE = 1e-6


def reference_force(contact: ReplayedContact) -> float:
    """Return the force for which the arrow has the length `LENGTH` [N].

    It is the desired force, or a round larger one if the tool presses so much harder for long that
    arrows would leave the picture.
    """
    size = np.linalg.norm(contact.force, axis=1)
    held = float(np.percentile(size, 95.0))
    return max(contact.desired_force, _round_up(held * LENGTH / _LONGEST))


def arrow_legend(contact: ReplayedContact) -> str:
    """Return the scale of the arrow as text."""
    return f"force, {reference_force(contact):g} N = {100.0 * LENGTH:g} cm"


def draw_arrow(meshcat: Meshcat) -> None:
    """Draw an arrow of length `LENGTH` along z at "/force"."""
    vertices, faces = _arrow()
    meshcat.SetTriangleMesh("/force", vertices, faces, Rgba(*colours.components(colours.FORCE)))
    for name, value in _IN_FRONT.items():
        meshcat.SetProperty("/force/<object>", name, value)


def record_arrow(
    recording: MeshcatAnimation, contact: ReplayedContact, points: Array, forces: Array
) -> None:
    """Record position, direction and length of the arrow frame by frame.

    Args:
        recording: The animation.
        contact: The contact, which sets the scale.
        points: Point of contact in each frame, shape (f, 3) [m].
        forces: Force on the tool in each frame, shape (f, 3) [N].
    """
    for frame, (point, force) in enumerate(zip(points, forces, strict=True)):
        R, scale, seen = arrow_of(contact, force)
        recording.SetTransform(frame, "/force", RigidTransform(R, point))
        recording.SetProperty(frame, "/force", "scale", scale)
        recording.SetProperty(frame, "/force", "visible", seen)


def arrow_of(contact: ReplayedContact, force: Array) -> tuple[RotationMatrix, list[float], bool]:
    """Return the orientation, the scale, and whether there is an arrow for a force.

    Args:
        contact: The contact, which sets the scale.
        force: Force on the tool, shape (3,) [N].
    """
    size = float(np.linalg.norm(force))
    seen = size > _NONE * contact.desired_force
    direction = force / size if seen else contact.normal
    length = max(size / reference_force(contact), _NONE)
    # A short arrow is slim as well.
    width = min(length, 1.0)
    return _along(direction, contact), [width, width, length], seen


def _along(direction: Array, contact: ReplayedContact) -> RotationMatrix:
    """Return the surface's axes after the shortest rotation that turns z into ``direction``.

    It varies continuously with the direction, except into the surface: any half turn leads there,
    and as the arrow is round, each looks the same.
    """
    n = contact.normal
    middle = n + direction
    size = float(np.linalg.norm(middle))
    axis = middle / size if size > _OPPOSITE else contact.R_WS.matrix()[:, 0]
    # Half a turn about the normal, then half a turn about the middle, is the shortest rotation.
    about_normal = contact.R_WS.matrix() @ np.diag([-1.0, -1.0, 1.0])
    return RotationMatrix((2.0 * np.outer(axis, axis) - np.eye(3)) @ about_normal)


def _round_up(number: float) -> float:
    """Return the next 1, 2, 3 or 5 times a power of ten that is not smaller; 0 for none."""
    if number <= 0.0:
        return 0.0
    unit = 10.0 ** math.floor(math.log10(number))
    return float(next(step for step in (1.0, 2.0, 3.0, 5.0, 10.0) if step * unit >= number) * unit)


def _arrow() -> tuple[Any, Any]:
    """Return vertices and faces of an arrow along z.

    Its parts do not share their rings of vertices, so that the edges between them look sharp.
    """
    neck = LENGTH - _HEAD_LENGTH
    corners = ((0.0, 0.0), (_SHAFT, 0.0), (_SHAFT, neck), (_HEAD, neck), (0.0, LENGTH))
    profile = [corner for pair in pairwise(corners) for corner in pair]
    angles = np.linspace(0.0, math.tau, _SIDES, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)))
    rings = [np.vstack((radius * circle, np.full(_SIDES, height))) for radius, height in profile]
    here = np.arange(_SIDES)
    there = (here + 1) % _SIDES
    faces = []
    for k in range(0, len(profile), 2):
        low, high = k * _SIDES, (k + 1) * _SIDES
        faces.append(np.stack((here + low, there + low, there + high)))
        faces.append(np.stack((here + low, there + high, here + high)))
    return (
        np.asfortranarray(np.concatenate(rings, axis=1)),
        np.asfortranarray(np.concatenate(faces, axis=1).astype(np.int32)),
    )
