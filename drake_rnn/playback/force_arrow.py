"""The force on the tool as an arrow from where it touches."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from ..inputs.fields import Array
from .pressing import Pressing
from .stage import FORCE_COLOUR

#: Of an arrow for the force that was desired [m].
LENGTH = 0.1
_LONGEST = 0.3
_SHAFT, _HEAD, _HEAD_LENGTH = 0.0028, 0.0075, 0.026
_SIDES = 24
# It lies along the tool, mostly inside of it: drawn last of all, over whatever is in front.
_IN_FRONT = {
    "castShadow": False,
    "material.depthTest": False,
    "material.transparent": True,
    "renderOrder": 2.0,
}
# Share of the desired force that makes an arrow too short to be seen.
_NONE = 1e-3
# Of two unit vectors' sum: below, they point against each other.
_OPPOSITE = 1e-6


def newtons(pressing: Pressing) -> float:
    """The force whose arrow has the usual length [N].

    That is the desired one, unless the tool presses so much harder for long that arrows would
    leave the picture.
    """
    size = np.linalg.norm(pressing.force, axis=1)
    held = float(np.percentile(size, 95.0))
    return max(pressing.desired_force, _round_up(held * LENGTH / _LONGEST))


def arrow_legend(pressing: Pressing) -> str:
    """How long an arrow is for which force."""
    return f"force, {newtons(pressing):g} N = {100.0 * LENGTH:g} cm"


def draw_arrow(meshcat: Meshcat) -> None:
    """The arrow at "/force", of the usual length, along z."""
    vertices, faces = _arrow()
    meshcat.SetTriangleMesh("/force", vertices, faces, Rgba(*FORCE_COLOUR))
    for name, value in _IN_FRONT.items():
        meshcat.SetProperty("/force/<object>", name, value)


def record_arrow(
    recording: MeshcatAnimation, pressing: Pressing, points: Array, forces: Array
) -> None:
    """How it moves: ``points`` [m] and ``forces`` [N] frame by frame, shape (f, 3) both."""
    usual = newtons(pressing)
    for frame, (point, force) in enumerate(zip(points, forces, strict=True)):
        size = float(np.linalg.norm(force))
        seen = size > _NONE * pressing.desired_force
        direction = force / size if seen else pressing.normal
        recording.SetTransform(frame, "/force", RigidTransform(_along(direction, pressing), point))
        length = max(size / usual, _NONE)
        # A short arrow is slim too.
        width = min(length, 1.0)
        recording.SetProperty(frame, "/force", "scale", [width, width, length])
        recording.SetProperty(frame, "/force", "visible", seen)


def _along(direction: Array, pressing: Pressing) -> RotationMatrix:
    """Axes with z along a direction: the surface's, turned by the shortest way.

    There is one for every direction but that into the surface, to which any half turn leads:
    the arrow is round.
    """
    n = pressing.normal
    middle = n + direction
    size = float(np.linalg.norm(middle))
    axis = middle / size if size > _OPPOSITE else pressing.R_WS.matrix()[:, 0]
    # Half a turn about the normal and half a turn about the middle make the shortest way.
    about_normal = pressing.R_WS.matrix() @ np.diag([-1.0, -1.0, 1.0])
    return RotationMatrix((2.0 * np.outer(axis, axis) - np.eye(3)) @ about_normal)


def _round_up(number: float) -> float:
    """To one or two digits, for a caption."""
    if number <= 0.0:
        return 0.0
    unit = 10.0 ** math.floor(math.log10(number))
    return float(next(step for step in (1.0, 2.0, 3.0, 5.0, 10.0) if step * unit >= number) * unit)


def _arrow() -> tuple[Any, Any]:
    """Rings round z, from the tail to the tip; each part has its own, for sharp edges."""
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
