"""The acceleration of a law's own velocity, where that differs from the arm's."""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ..gathering import Largest, State
from ..motion import Motion
from .group import Found


class NetworkMetrics:
    """The law's own acceleration; none where its velocity is the arm's."""

    def __init__(self) -> None:
        self._largest: State = Largest.start
        self._differs: AnyArray = False

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        network, velocity = motion.network_velocity, motion.velocity
        if network is velocity or motion.time.size < 2:
            return
        # A ramp ends at its law's velocity except for rounding.
        away: AnyArray = ~np.isclose(network, velocity, rtol=1e-9, atol=1e-12)
        self._differs = self._differs | away.any(axis=-1).any(axis=0)
        acceleration = np.abs(motion.network_acceleration).max(axis=-1)
        self._largest = Largest().added(self._largest, acceleration, motion.time[1:])

    def found(self) -> Found:
        """Return the metric, by name."""
        acceleration = np.where(self._differs, Largest().value(self._largest), np.nan)
        return {"network_acceleration_max_rad_s2": acceleration}
