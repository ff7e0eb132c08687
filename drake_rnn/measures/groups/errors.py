"""Errors of the end effector's position and velocity."""

from __future__ import annotations

import numpy as np

from ..motion import Motion
from ..running import Largest, Mean, Settling
from .group import Found


class ErrorMetrics:
    """Errors in the window, and when the arm has settled.

    Args:
        window: Start and end of the window [s]; None for the whole run.
        tolerance: Position error below which the arm has settled [m].
    """

    def __init__(self, window: tuple[float, float] | None, tolerance: float) -> None:
        self._window = window
        self._largest, self._component, self._square = Largest(), Largest(), Mean()
        self._slip, self._slip_component = Largest(), Largest()
        self._settling = Settling(tolerance)

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        error = motion.aside(motion.p_WE - motion.p_WE_desired)
        norm = np.linalg.norm(error, axis=1)
        within = motion.within(self._window)
        if within.any():
            slip = motion.aside(motion.v_WE - motion.v_WE_desired)[within]
            self._largest.add(norm[within])
            self._component.add(np.abs(error[within]))
            self._square.add(norm[within] ** 2)
            self._slip.add(np.linalg.norm(slip, axis=1))
            self._slip_component.add(np.abs(slip))
        self._settling.add(motion.time, norm)

    def found(self) -> Found:
        """Return the metrics, by name."""
        return {
            "position_error_max_m": self._largest.value,
            "position_error_component_max_m": self._component.value,
            "position_error_rms_m": self._square.root,
            "velocity_error_max_m_s": self._slip.value,
            "velocity_error_component_max_m_s": self._slip_component.value,
            "settling_time_s": self._settling.time,
        }
