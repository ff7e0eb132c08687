"""A second arm in the scene, where it stands beside the first one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RotationMatrix

from ..inputs.fields import Array
from .arm_capsules import draw_capsules
from .boxes import boxes_of
from .drawn_arm import DrawnArm
from .replay import ReplayedMotion, replayed_motion

_PLACE = "/second"


def second_motion(motion: ReplayedMotion) -> ReplayedMotion | None:
    """Return the motion of a run's second arm, in the base frame of the first; None without one."""
    second, base = motion.result.second, motion.result.experiment.base
    if second is None or base is None:
        return None
    own = replayed_motion(second)
    R, p = base.R, base.translation
    traced, desired, course = (each @ R.T + p for each in (own.traced, own.desired, own.course))
    return replace(own, traced=traced, desired=desired, course=course)


class SecondArm:
    """The second arm below "/second" in the scene.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion of the arm.
        X_WB: Pose of its base.
    """

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion, X_WB: RigidTransform) -> None:
        self.motion = motion
        self._X_WB = X_WB
        self._meshcat = meshcat
        self._drawn = DrawnArm(motion.result.experiment.arm, meshcat, f"{_PLACE}/arm")
        meshcat.SetTransform(_PLACE, X_WB)

    @property
    def corners(self) -> Array:
        """Corners of boxes round it in several postures, shape (k, 3) [m]."""
        corners = boxes_of(self.motion, self._drawn).corners
        return np.asarray(corners @ self._X_WB.rotation().matrix().T + self._X_WB.translation())

    def draw_capsules(self) -> list[str]:
        """Draw its capsules, hidden; return their scene paths."""
        clearance = self.motion.result.experiment.clearance
        return draw_capsules(self._meshcat, self._drawn, clearance, self._X_WB)

    def record(self, time: Array, rate: int) -> None:
        """Draw it at the time of each frame, shape (f,) [s], while the scene records."""
        for frame, q in enumerate(self.motion.at(time, self.motion.position)):
            self._drawn.draw(q, (frame + 0.5) / rate)


def second_arm(meshcat: Meshcat, motion: ReplayedMotion) -> SecondArm | None:
    """Draw the second arm of a run; None without one."""
    base, second = motion.result.experiment.base, second_motion(motion)
    if base is None or second is None:
        return None
    X_WB = RigidTransform(RotationMatrix(base.R), base.translation)
    return SecondArm(meshcat, second, X_WB)
