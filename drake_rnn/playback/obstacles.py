"""Obstacles in the arm's way, drawn in the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Box, Capsule, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..experiment import Experiment
from ..inputs.fields import Array
from ..robot.clearance.obstacles import (
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    HalfSpaceObstacle,
    Obstacle,
)
from .animation import move

_SOLID = Rgba(*colours.components(colours.SURFACE))
# Of a half-space, which would hide what is behind it: a sheet of this size and thickness [m].
_SHEET = Rgba(*colours.components(colours.SURFACE), 0.4)
_SIZE, _THICKNESS = 1.6, 0.004


def draw_obstacles(meshcat: Meshcat, obstacles: Sequence[Obstacle]) -> None:
    """Draw obstacles below "/obstacles"; of a half-space, a part of its plane near the base."""
    for k, obstacle in enumerate(obstacles):
        shape, pose = _drawn(obstacle)
        place = f"/obstacles/{k}"
        sheet = isinstance(obstacle, HalfSpaceObstacle)
        meshcat.SetObject(place, shape, _SHEET if sheet else _SOLID)
        meshcat.SetTransform(place, pose)


def corners_of_obstacles(experiment: Experiment) -> Array:
    """Return corners of boxes round all obstacles, where they begin, shape (k, 3) [m]."""
    return np.concatenate([np.zeros((0, 3)), *(each.corners for each in experiment.obstacles)])


def record_obstacles(recording: MeshcatAnimation, experiment: Experiment, times: Array) -> None:
    """Record how obstacles move; ``times`` of the frames since the start of the run, shape (f,)."""
    if experiment.motions is None or experiment.clearance is None:
        return
    solids = experiment.clearance.solids
    numbers = {obstacle.name: k for k, obstacle in enumerate(experiment.obstacles)}
    p_WO = experiment.motions.along(times)
    for m, k in enumerate(solids.moving):
        number = numbers[solids.names[k]]
        _, pose = _drawn(experiment.obstacles[number])
        move(recording, f"/obstacles/{number}", pose.translation() + p_WO[:, m])


def pose_of(obstacle: Obstacle) -> RigidTransform:
    """Return the pose at which an obstacle is drawn, where it begins."""
    return _drawn(obstacle)[1]


def _drawn(obstacle: Obstacle) -> tuple[Shape, RigidTransform]:
    """Return an obstacle's shape and pose."""
    if isinstance(obstacle, BallObstacle):
        return Sphere(obstacle.radius), RigidTransform(obstacle.center)
    if isinstance(obstacle, BoxObstacle):
        return Box(obstacle.size), RigidTransform(RotationMatrix(obstacle.R_WO), obstacle.center)
    if isinstance(obstacle, CapsuleObstacle):
        return capsule_between(*obstacle.ends, obstacle.radius)
    if isinstance(obstacle, HalfSpaceObstacle):
        n = obstacle.normal_W
        middle = n.dot(obstacle.point) * n - 0.5 * _THICKNESS * n
        R = RotationMatrix.MakeFromOneVector(n, 2)
        return Box(_SIZE, _SIZE, _THICKNESS), RigidTransform(R, middle)
    raise TypeError(f"no drawing of a {type(obstacle).__name__}")


def capsule_between(one: Array, other: Array, radius: float) -> tuple[Shape, RigidTransform]:
    """Return the capsule round a segment, a ball if its ends are one, and its pose.

    Args:
        one: One end of the segment, shape (3,) [m].
        other: The other end, shape (3,) [m].
        radius: Radius [m].
    """
    length = float(np.linalg.norm(other - one))
    if length < 1e-6:
        return Sphere(radius), RigidTransform(one)
    R = RotationMatrix.MakeFromOneVector((other - one) / length, 2)
    return Capsule(radius, length), RigidTransform(R, 0.5 * (one + other))
