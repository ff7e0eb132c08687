"""Axes of the end effector on a path that turns: the desired axes along the path, and its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from ..inputs.fields import Array
from .replay import ReplayedMotion

# Largest number of poses along the path at which the desired axes are drawn.
_POSES = 12
# Largest and smallest length of an axis, relative to the radius of the traced path; its length
# relative to the extent of the path, and its radius relative to its length.
_LENGTH, _SHORTEST, _SHARE, _RADIUS = 18.0, 8.0, 0.2, 0.03
# Red, green and blue for x, y and z, as in other viewers.
_COLOURS = ((0.85, 0.15, 0.15), (0.15, 0.6, 0.2), (0.2, 0.3, 0.85))
_DESIRED_OPACITY = 0.35


@dataclass(frozen=True)
class Axes:
    """Axes of a motion that turns.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        radius: Radius of the traced path [m].
    """

    meshcat: Meshcat
    motion: ReplayedMotion
    radius: float

    def draw(self) -> None:
        """Draw the desired axes at some poses along the path, and those of the end effector."""
        motion, desired = self.motion, self.motion.result.experiment.desired
        last = len(motion.course) - 1
        for number, k in enumerate(np.unique(np.linspace(0, last, _POSES).astype(int)).tolist()):
            place = f"/desired/axes/{number:02d}"
            R_WE = desired.orientation(motion.path_time(motion.time[k]))[0]
            self._draw_at(place, _DESIRED_OPACITY)
            self.meshcat.SetTransform(place, _pose(R_WE, motion.course[k]))
        self._draw_at("/traced/axes", 1.0)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the axes of the end effector move; ``time`` of each frame, shape (f,) [s]."""
        motion = self.motion
        kinematics = motion.result.experiment.arm.kinematics()
        for frame, q in enumerate(motion.at(time, motion.position)):
            pose = _pose(kinematics.R_WE(q), kinematics.p_WE(q))
            recording.SetTransform(frame, "/traced/axes", pose)

    def _draw_at(self, place: str, opacity: float) -> None:
        extent = float(np.ptp(self.motion.course, axis=0).max())
        length = min(_LENGTH * self.radius, max(_SHARE * extent, _SHORTEST * self.radius))
        radius = _RADIUS * length
        for axis, colour in enumerate(_COLOURS):
            path = f"{place}/{'xyz'[axis]}"
            self.meshcat.SetObject(path, Cylinder(radius, length), Rgba(*colour, opacity))
            along = np.eye(3)[axis]
            R = RotationMatrix.MakeFromOneVector(along, 2)
            self.meshcat.SetTransform(path, RigidTransform(R, length / 2.0 * along))


def _pose(R_WE: Array, p_WE: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_WE), p_WE)
