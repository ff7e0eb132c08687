"""The jerk of velocities that are held: their second differences, from one to the next."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ..motion import Motion
from ..running import Largest
from ..ticks import tick_ends
from .group import Found

#: Name of the metric.
HELD_JERK = "held_jerk_violation_max_rad_s3"


class HeldJerkMetrics:
    """How velocities that are held keep the bound of the jerk, where there is one.

    `HigherMetrics` takes differences over 10 ms, in which what goes to and fro within them is lost.

    Args:
        limits: Limits of the experiment.
    """

    def __init__(self, limits: JointLimits) -> None:
        bound = limits.bounds["jerk"]
        self._bound = bound if bound is not None and np.isfinite(bound).any() else None
        self._excess = Largest()
        # The last two velocities.
        self._before: Array | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if self._bound is None or motion.tick is None or motion.time.size < 2:
            return
        origin = motion.time[0] if motion.origin is None else motion.origin
        last, _ = tick_ends(motion.time, motion.tick, float(origin))
        velocities = motion.velocity[last]
        if self._before is not None:
            velocities = np.concatenate((self._before, velocities[1:]))
        self._before = velocities[-2:].copy()
        jerk = np.abs(np.diff(velocities, n=2, axis=0)) / motion.tick**2
        if jerk.size:
            self._excess.add(jerk - self._bound)

    def found(self) -> Found:
        """Return the metric, by name; none without a bound, or of velocities that are not held."""
        excess = self._excess.value
        return {} if excess is None else {HELD_JERK: np.maximum(0.0, excess)}
