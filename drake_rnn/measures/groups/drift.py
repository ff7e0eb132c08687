"""Drift of the joints, and of the end effector from its start."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array
from ..motion import Motion
from ..running import Largest
from .group import Found


class DriftMetrics:
    """How far the arm is from where it was.

    Args:
        window: Start and end of the window [s]; None for the whole run.
    """

    def __init__(self, window: tuple[float, float] | None) -> None:
        self._window = window
        # Joints at the window's first and last step, in steps that differ.
        self._first: Array | None = None
        self._last: Array | None = None
        # When the last lap is expected to begin, the joints then, and those at the last step.
        self._lap: tuple[float, Array] | None = None
        self._lap_drift: float | None = None
        self._start: Array | None = None
        self._moved = Largest()
        self._moved_in_the_end: float | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.target is None:
            # Joints that move to a target posture do not drift, nor do those along an open path.
            if motion.returns:
                self._add_window(motion)
            self._add_lap(motion)
        if self._start is None:
            self._start = motion.p_WE[0].copy()
        moved = np.linalg.norm(motion.p_WE - self._start, axis=1)
        self._moved.add(moved)
        self._moved_in_the_end = moved[-1]

    def _add_window(self, motion: Motion) -> None:
        within = np.flatnonzero(motion.within(self._window))
        if within.size and self._first is None:
            self._first, within = motion.position[within[0]].copy(), within[1:]
        if within.size:
            self._last = motion.position[within[-1]].copy()

    def _add_lap(self, motion: Motion) -> None:
        """Take the lap's drift up to the last step; its start may be in an earlier part."""
        began = motion.lap_start
        if began is not None and motion.time[0] - 1e-9 <= began <= motion.time[-1] + 1e-9:
            step = int(np.searchsorted(motion.time, began - 1e-9))
            self._lap = began, motion.position[step].copy()
        self._lap_drift = None
        # A run that is cut short ends with another lap, whose start is no longer known.
        if began is not None and self._lap is not None and abs(self._lap[0] - began) < 1e-9:
            self._lap_drift = np.abs(motion.position[-1] - self._lap[1]).max()

    def found(self) -> Found:
        """Return the metrics, by name."""
        found: Found = {}
        if self._first is not None and self._last is not None:
            drift = np.abs(self._last - self._first)
            found = {"joint_drift_max_rad": drift.max(), "joint_drift_mean_rad": drift.mean()}
        return found | {
            "lap_drift_max_rad": self._lap_drift,
            "end_effector_drift_max_m": self._moved.value,
            "end_effector_drift_end_m": self._moved_in_the_end,
        }
