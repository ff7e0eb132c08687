"""Derivatives of the joint positions beyond the acceleration."""

from __future__ import annotations

from math import ceil

import numpy as np

from ...inputs.fields import Array
from ...robot.limits import DERIVATIVE_UNITS, JointLimits
from ..motion import Motion
from ..running import Largest, Mean
from .bound import BoundMetrics
from .group import Found

_HIGHER = tuple(DERIVATIVE_UNITS)[2:]
#: Time between the velocities that these derivatives are differences of [s].
DIFFERENCE = 0.01


def difference_time(tick: float | None) -> float:
    """Return the time between the velocities that higher derivatives are differences of [s].

    It is 10 ms, or the next multiple of the tick: between two ticks of 4 ms each velocity would be
    taken 2 ms too late or not, and the differences would be of no motion.

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
        limits: Limits of the experiment.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._bounds = {name: BoundMetrics(name, limits.bounds[name]) for name in _HIGHER}
        self._jerk, self._square = Largest(), Mean()
        # When the run began and how long it is, how many velocities were taken, and the last ones.
        self._begin, self._length = 0.0, 0.0
        self._difference = DIFFERENCE
        self._count = 0
        self._velocities: Array | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.origin is None:
            self._begin = float(motion.time[0])
            self._difference = difference_time(motion.tick)
        self._length = motion.time[-1] - self._begin
        new = motion.velocity[self._steps(motion.time)]
        kept = np.empty((0, new.shape[1])) if self._velocities is None else self._velocities
        velocities = np.concatenate((kept, new))
        for order, name in enumerate(_HIGHER, start=2):
            # A difference that the kept velocities alone make was taken before.
            part = velocities[max(0, len(kept) - order) :]
            values = np.abs(np.diff(part, n=order, axis=0)) / self._difference**order
            self._bounds[name].add(values)
            if name == "jerk":
                self._jerk.add(values)
                self._square.add(values**2)
        self._velocities = velocities[-len(DERIVATIVE_UNITS) :]

    def _steps(self, time: Array) -> Array:
        """Return, for each further 10 ms, the step that ends there, or the first one after it."""
        # Each time is computed as np.arange does it, which does not add up rounding errors.
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
            "joint_jerk_max_rad_s3": self._jerk.value,
            "joint_jerk_rms_rad_s3": self._square.root,
        }
        for bound in self._bounds.values():
            found |= bound.found()
        return found
