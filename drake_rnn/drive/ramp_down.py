"""The way to rest from whatever was commanded last, within bounds."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from ..robot.held_stop import HeldStop
from ..robot.limits import JointLimits
from ..robot.stop_step import stop_step


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
