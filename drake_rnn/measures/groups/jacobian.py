"""Errors of a learned Jacobian."""

from __future__ import annotations

import numpy as np

from ..motion import Motion
from ..running import Largest, Median
from .group import Found

#: Joint speed above which an arm moves [rad/s].
MOVING = 1e-6


class JacobianMetrics:
    """Errors of the learned Jacobian in the window.

    Medians need all their numbers: two for each step in the window.

    Args:
        window: Start and end of the window [s]; None for the whole run.
    """

    def __init__(self, window: tuple[float, float] | None) -> None:
        self._window = window
        self._median, self._largest, self._excited = Median(), Largest(), Median()

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.J_hat is None:
            return
        within = motion.within(self._window)
        difference = (motion.J - motion.J_hat)[within]
        v = motion.network_velocity[within]
        speed = np.linalg.norm(v, axis=1)
        moving = speed > MOVING
        size = np.linalg.norm(difference, axis=(1, 2))
        along = np.linalg.norm(np.einsum("kmn,kn->km", difference, v), axis=1)
        self._median.add(size)
        self._largest.add(size)
        self._excited.add(along[moving] / speed[moving])

    def found(self) -> Found:
        """Return the metrics, by name."""
        return {
            "jacobian_error_median": self._median.value,
            "jacobian_error_max": self._largest.value,
            "jacobian_error_excited_median": self._excited.value,
        }
