"""The way of the joints to the start of a run, within bounds and clear of the arm itself.

- An approach that is worked out while the robot rests, for a robot that waits for nobody.
- The way to rest from whatever was commanded last, within bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

import numpy as np

from ..inputs.fields import Array
from ..laws.guard import Guard
from ..robot.clearance.arm_clearance import arm_clearance
from ..robot.jerk_stop import HeldStop
from ..robot.joint_stop import stop_step
from ..robot.limits import JointLimits
from .robot_task import RobotTask
from .robots import DriveSettings, Motion
from .shared_cycles import AHEAD

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


# Time for which it is worked on at a stretch; in between this side looks after the robot [s].
_STRETCH = 4e-3


class PlannedApproach(Approach):
    """The way from a posture to the start of a task, of which every cycle is known beforehand.

    A step that stays clear of everything takes about as long as a cycle of a fast robot, so the
    next cycles are told ahead. If one is answered without it all the same, the robot comes to rest,
    and the way from there is worked out anew.

    Args:
        task, settings, begin, period: As those of `Approach`.
    """

    def __init__(
        self, task: RobotTask, settings: DriveSettings, begin: Array, period: float
    ) -> None:
        super().__init__(task, settings, begin, period)
        self._commanded = super().motion()
        self._plan = [self._commanded]
        self._at, self._is_known = 0, super().arrived
        # Nothing moves yet, and nobody waits.
        while not self._is_known and len(self._plan) * period < settings.approach_time:
            self._work()

    @property
    def arrived(self) -> bool:
        """Whether the joints are commanded to rest at the start."""
        return self._is_known and self._at == len(self._plan) - 1

    @property
    def is_working(self) -> bool:  # type: ignore[override]
        """Whether the way is worked out while the robot rests."""
        return not self._is_known and self._commanded.rests

    def then(self) -> Sequence[Motion]:
        """See `Approach.then`."""
        return self._plan[self._at + 2 : self._at + AHEAD] if self._is_known else ()

    def resume(self, motion: Motion, cycles: int) -> None:
        """See `Approach.resume`."""
        self._commanded = motion
        reached = min(self._at + cycles, len(self._plan) - 1) if self._is_known else self._at
        for at in (reached, self._at):
            if motion.equals(self._plan[at]):
                self._at = at
                return
        self._is_known = False
        if motion.rests:
            self._guard.resume(*motion)
            self._plan, self._at = [motion], 0
            self._is_known = super().arrived

    def advance(self, time: float) -> Array:
        """Return the positions to command in the next cycle, shape (n,) [rad]."""
        if self.is_working:
            self._work()
        return self.motion().position

    def motion(self) -> Motion:
        """Return what is commanded: the next of the way, or what is commanded already.

        The latter keeps a robot at rest there. One that moves is not to stop at once: a paced
        connection does not take this, and makes a step of its stop.
        """
        if self._is_known and not self.arrived:
            return self._plan[self._at + 1]
        return self._commanded

    def _work(self) -> None:
        """Work for a while on the way from where the robot rests."""
        until = monotonic() + _STRETCH
        while not super().arrived:
            if monotonic() > until:
                return
            super().advance(self.period)
            self._plan.append(super().motion())
        self._is_known = True


class RampDown:
    """The fastest stop of all joints within limits of acceleration and, if there is one, of jerk.

    Steps are those of the law, whose bounds rest on this very stop. If a law has not kept its
    bounds, so that a joint would run into a position limit, the joint brakes as hard as it needs
    to, up to what the robot may be told.

    Args:
        position, velocity, acceleration: What was commanded last, shape (n,) each
            [rad, rad/s, rad/s^2].
        limits: Limits to stop within.
        hardest: Largest accelerations that the robot may be told, shape (n,) [rad/s^2].
        period: Time of a step of the law [s].
        held: Time for which the law still holds its velocity [s].
    """

    def __init__(
        self,
        position: Array,
        velocity: Array,
        acceleration: Array,
        limits: JointLimits,
        hardest: Array,
        period: float,
        *,
        held: float = 0.0,
    ) -> None:
        self._q, self._v, self._period = position + held * velocity, velocity, period
        self._jerk = limits.jerk
        self._most = _braking(position, velocity, limits, hardest, period)
        self._a = np.clip(acceleration, -self._most, self._most)
        # Time by which the last step is ahead of what was asked for.
        self._ahead = held

    @property
    def rests(self) -> bool:
        """Whether all joints rest."""
        return not self._v.any()

    def advance(self, time: float) -> Array:
        """Return the commanded positions some time later [s], shape (n,) [rad]."""
        self._ahead -= time
        # Times that are sums of periods are compared with some room.
        while self._ahead < -1e-6 * self._period:
            self._step()
            self._ahead += self._period
        return np.asarray(self._q - max(self._ahead, 0.0) * self._v)

    def _step(self) -> None:
        jerk = None if self._jerk is None else self._jerk.tolist()
        moving = self._v.tolist(), self._a.tolist(), self._most.tolist()
        self._v, self._a = np.array(stop_step(*moving, jerk, self._period))
        self._q = self._q + self._period * self._v


def _braking(q: Array, v: Array, limits: JointLimits, hardest: Array, period: float) -> Array:
    """Return each joint's deceleration: its limit, or more where its way would be too long."""
    most = limits.require("acceleration", "coming to rest")
    ahead = np.where(v > 0.0, limits.position_upper - q, q - limits.position_lower)
    way = HeldStop(most, period).way(HeldStop(most, period).after(v))
    room = np.maximum(ahead - np.abs(v) * period, 1e-9)
    needed = np.where(way > ahead, v**2 / (2.0 * room), most)
    return np.asarray(np.clip(needed, most, np.maximum(hardest, most)))
