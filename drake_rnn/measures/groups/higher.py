"""Derivatives of the joint positions beyond the acceleration."""

from __future__ import annotations

from math import ceil

import numpy as np

from ...arrays.namespace import AnyArray
from ...arrays.series import summed
from ...inputs.fields import Array
from ...robot.limits import DERIVATIVE_UNITS
from ..gathering import Largest, RootMean, State, excess
from ..motion import Motion
from ..ticks import tick_ends
from ..yardsticks import Yardsticks
from .bounds import Bound
from .group import Found

_HIGHER = tuple(DERIVATIVE_UNITS)[2:]
#: Time between the velocities whose differences give these derivatives [s].
DIFFERENCE = 0.01


def difference_time(tick: float | None) -> float:
    """Return the time between the velocities whose differences give higher derivatives [s].

    It is 10 ms, or the next multiple of the tick. With a tick of 4 ms and differences over 10 ms,
    every second velocity would be read 2 ms late, and the differences would be wrong.

    Args:
        tick: Time for which velocities are held [s]; None if they are not.
    """
    if tick is None:
        return DIFFERENCE
    whole = tick * ceil(DIFFERENCE / tick - 1e-9)
    return DIFFERENCE if abs(whole - DIFFERENCE) < 1e-9 else whole


class HigherMetrics:
    """Jerk, and snap and crackle where they are bounded.

    They are differences of the velocity over 10 ms, see `difference_time`: over 1 ms, the rounding
    of positions would dominate the fifth derivative.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._bounds = {name: Bound(name, against.limits[name]) for name in _HIGHER}
        self._jerk: State = Largest.start
        self._square: State = RootMean.start
        # Begin and length of the run, number of the velocities taken, and the last of them.
        self._begin, self._length = 0.0, 0.0
        self._difference = DIFFERENCE
        self._count = 0
        self._velocities: AnyArray | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.begins:
            self._begin = float(motion.time[0])
            self._difference = difference_time(motion.tick)
        self._length = motion.time[-1] - self._begin
        steps = self._steps(motion.time)
        if not steps.size:
            return
        new = motion.velocity[steps]
        velocities = new
        if self._velocities is not None:
            velocities = np.concatenate((self._velocities, new))
        kept = len(velocities) - len(new)
        for order, name in enumerate(_HIGHER, start=2):
            if name != "jerk" and self._bounds[name].bound is None:
                continue
            # Differences of kept velocities alone were taken with the part before.
            part = velocities[max(0, kept - order) :]
            if len(part) > order:
                values = np.abs(np.diff(part, n=order, axis=0)) / self._difference**order
                self._add(name, values, motion.time)
        self._velocities = velocities[-len(DERIVATIVE_UNITS) :]

    def _add(self, name: str, values: AnyArray, time: AnyArray) -> None:
        """Add magnitudes of a derivative, shape (k, ..., n)."""
        self._bounds[name].add(values, time)
        if name == "jerk":
            self._jerk = Largest().added(self._jerk, values.max(axis=-1), time)
            mean = summed(values * values) / values.shape[-1]
            self._square = RootMean.added(self._square, mean, time)

    def _steps(self, time: Array) -> Array:
        """Return the step at, or first after, each further multiple of 10 ms."""
        # Times are computed as np.arange computes them, so that rounding errors do not add up.
        step = (self._begin + self._difference) - self._begin
        most = int((time[-1] - self._begin) / step) + 2
        times = self._begin + np.arange(self._count, max(most, self._count)) * step
        times = times[times - 1e-9 <= time[-1]]
        self._count += times.size
        return np.searchsorted(time, times - 1e-9)

    def found(self) -> Found:
        """Return the metrics, by name; none of a run that is too short for differences."""
        if self._length < 6 * self._difference:
            return {}
        found: Found = {
            "joint_jerk_max_rad_s3": Largest().value(self._jerk),
            "joint_jerk_rms_rad_s3": RootMean.value(self._square),
        }
        for bound in self._bounds.values():
            found |= bound.found()
        return found


class HeldJerkMetrics:
    """How velocities that are held keep the bound of the jerk, where there is one.

    `HigherMetrics` takes differences over 10 ms, which do not show an oscillation within them.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._bound = against.limits["jerk"]
        self._excess: State = Largest.start
        # The last two velocities.
        self._before: AnyArray | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if self._bound is None or motion.tick is None or motion.time.size < 2:
            return
        last, _ = tick_ends(motion.time, motion.tick, motion.first_time)
        velocities = motion.velocity[last]
        if self._before is not None:
            velocities = np.concatenate((self._before, velocities[1:]))
        self._before = velocities[-2:].copy()
        jerk = np.abs(np.diff(velocities, n=2, axis=0)) / motion.tick**2
        if len(jerk):
            beyond = (jerk - self._bound).max(axis=-1)
            self._excess = Largest().added(self._excess, beyond, motion.time)

    def found(self) -> Found:
        """Return the metric, by name; not finite without a bound or without held velocities."""
        return {"held_jerk_violation_max_rad_s3": excess(Largest().value(self._excess))}
