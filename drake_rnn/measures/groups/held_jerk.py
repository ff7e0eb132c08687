"""The jerk of velocities that are held: their second differences, from one to the next."""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ..gathering import Largest, State, excess
from ..motion import Motion
from ..ticks import tick_ends
from ..yardsticks import Yardsticks
from .group import Found

#: Name of the metric.
HELD_JERK = "held_jerk_violation_max_rad_s3"


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
        return {HELD_JERK: excess(Largest().value(self._excess))}
