"""The way of the joints to the start of a run, within bounds and clear of the arm itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..inputs.fields import Array
from ..laws.guard import Guard
from ..robot.clearance.arm_clearance import arm_clearance
from ..robot.limits import JointLimits
from .connection import Motion
from .robot_task import RobotTask
from .settings import DriveSettings

#: Distance from the start at which the joints are there [rad].
ARRIVED = 1e-9


class Approach:
    """The way from a posture to the start of a task.

    Args:
        task: The task. Its obstacles are avoided, where it has any, and the arm's own bodies in
            any case.
        settings: Bounds of the way.
        begin: Posture in which the robot stands, shape (n,) [rad].
        period: Time of a cycle [s].

    Attributes:
        doubts: What of the arm's own bodies is not kept clear; that of a task with obstacles is in
            the warnings of its experiment.

    Raises:
        InvalidInputError: If that posture is beyond the limits, or the arm touches something.
    """

    def __init__(
        self, task: RobotTask, settings: DriveSettings, begin: Array, period: float
    ) -> None:
        clearance, self.doubts = task.clearance, tuple[str, ...]()
        if clearance is None:
            clearance, self.doubts = arm_clearance(task.body.arm, (), task.start)
        self.limits = _slowed(task.limits, settings)
        # Obstacles begin to move with the task.
        self._p_WO = np.zeros((len(clearance.solids.moving), 3))
        self._guard = Guard.within(self.limits, begin, period, clearance, self._p_WO)
        self._start, self.period = task.start, period

    held = 0.0
    #: Whether the way is worked out while the robot rests.
    is_working = False

    @property
    def arrived(self) -> bool:
        """Whether the joints are commanded to rest at the start."""
        off = np.abs(self._guard.position - self._start).max()
        return bool(off <= ARRIVED and not np.abs(self._guard.velocity).max() > ARRIVED)

    def advance(self, time: float) -> Array:
        """Return the positions to command some time later [s], shape (n,) [rad]."""
        for _ in range(max(round(time / self.period), 1)):
            self._guard.command(self._start, self._p_WO)
        return self._guard.position

    def motion(self) -> Motion:
        """Return what is commanded."""
        return Motion(self._guard.position, self._guard.velocity, self._guard.part("a"))

    def then(self) -> Sequence[Motion]:
        """Return the motions after that, as far as they are known."""
        return ()

    def resume(self, motion: Motion, cycles: int) -> None:
        """Go on from what was commanded, by it or without it, some cycles later."""
        if not motion.equals(self.motion()):
            self._guard.resume(*motion)


def _slowed(limits: JointLimits, settings: DriveSettings) -> JointLimits:
    """Return limits that are no wider than those of the approach."""
    known = {
        "velocity": settings.approach_velocity,
        "acceleration": settings.approach_acceleration,
        "jerk": settings.approach_jerk,
    }
    bounds = limits.bounds
    return limits.replace(
        **{
            name: most if (own := bounds[name]) is None else np.minimum(own, most)
            for name, most in known.items()
        }
    )
