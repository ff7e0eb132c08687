"""The orientation that a task holds and the posture that it seeks."""

from __future__ import annotations

import numpy as np

from ..motion import Motion
from ..running import Largest, Mean, Settling
from .group import Found

# Joint error below which the arm has arrived at its target [rad].
ARRIVED = 0.01


class PostureMetrics:
    """Errors of the orientation in the window, and of the joints to a target in the end.

    Args:
        window: Start and end of the window [s]; None for the whole run.
    """

    def __init__(self, window: tuple[float, float] | None) -> None:
        self._window = window
        self._angle, self._square = Largest(), Mean()
        self._error: float | None = None
        self._settling = Settling(ARRIVED)

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.orientation_error is not None:
            angle = motion.orientation_error[motion.within(self._window)]
            self._angle.add(angle)
            self._square.add(angle**2)
        if motion.target is not None:
            error = np.abs(motion.position - motion.target).max(axis=1)
            self._error = error[-1]
            self._settling.add(motion.time, error)

    def found(self) -> Found:
        """Return the metrics, by name."""
        return {
            "orientation_error_max_rad": self._angle.value,
            "orientation_error_rms_rad": self._square.root,
            "joint_error_max_rad": self._error,
            "joint_settling_time_s": self._settling.time,
        }
