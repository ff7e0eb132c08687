"""Brakes between the command and the arm, which close when joints lock."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.joint_locks import JointLocks
from ..robot.limits import JointLimits
from ..robot.stop_step import stop_step
from .block import Block

# Acceleration with which a joint stops from one sample to the next [rad/s^2].
_AT_ONCE = 1e12


class JointBrakes(Block):
    """Joint velocities as commanded, but for joints whose brakes are closed.

    From the sample at which a brake closes, its joint comes to rest in the fastest way that its
    limits of acceleration and jerk allow, from the velocity and the acceleration that it had; then
    it rests for good. Where it comes to rest follows from these: a command that leaves no room for
    this stop, as some laws' commands do, may lead a joint beyond its position limit.

    Input is ``commanded``, output ``braked``, both of shape (n,) [rad/s].

    Args:
        locks: When the joints lock.
        limits: Limits of the joints.
        period: Sampling period, for which the braked velocities are held [s].

    Raises:
        InvalidInputError: If locks and limits are of different numbers of joints.
    """

    def __init__(self, locks: JointLocks, limits: JointLimits, period: float) -> None:
        super().__init__()
        n = locks.size
        if limits.size != n:
            raise InvalidInputError(f"locks: must be of {limits.size} joints, not of {n}")
        self._locks, self._period = locks, period
        bounds = np.full(n, np.inf) if limits.acceleration is None else limits.acceleration
        most = np.where(locks.at_once, np.inf, bounds)
        jerk = np.full(n, np.inf) if limits.jerk is None else limits.jerk
        # A stop whose acceleration is not bounded has no bound of the jerk.
        self._smooth = np.isfinite(most) & np.isfinite(jerk)
        self._most, self._jerk = np.minimum(most, _AT_ONCE), jerk
        self._command = self.DeclareVectorInputPort("commanded", n)
        # What joints with closed brakes are given; whether they have them; what all were given
        # in the period before this one.
        state = [self.DeclareDiscreteState(n) for _ in range(3)]
        self._given, self._closed, self._before = state
        self.DeclareVectorOutputPort("braked", n, self._calc_braked)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_braked(self, context: Context, output: Any) -> None:
        output.set_value(self._braked(context))

    def _braked(self, context: Context) -> Array:
        given, closed = (self._part(context, each) for each in (self._given, self._closed))
        return np.where(closed > 0.0, given, self._command.Eval(context))

    def _part(self, context: Context, index: Any) -> Array:
        return context.get_discrete_state(index).value()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        closed = self._locks.locked(context.get_time())
        v = self._braked(context)
        # The law steps at the same time: the command is still the one of the period that ends now.
        if closed.any():
            a = (v - self._part(context, self._before)) / self._period
            state.set_value(self._given, self._slower(v, a, closed))
            state.set_value(self._closed, closed.astype(float))
        state.set_value(self._before, v)

    def _slower(self, v: Array, a: Array, closed: NDArray[np.bool_]) -> Array:
        """Return the next velocities of a stop, shape (n,); zero for joints that are free."""
        after = np.zeros(v.size)
        a = np.clip(a, -self._most, self._most)
        for smooth in (False, True):
            which = closed & (self._smooth == smooth)
            moving = v[which].tolist(), a[which].tolist(), self._most[which].tolist()
            jerk = self._jerk[which].tolist() if smooth else None
            after[which], _ = stop_step(*moving, jerk, self._period)
        return after
