"""Drift of joints and end effector, and what a law tells of how far it has moved the latter."""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ...arrays.series import lengths
from ..gathering import Largest, State
from ..motion import Motion
from .group import Found


class DriftMetrics:
    """How far the arm is from where it was."""

    def __init__(self) -> None:
        # Time at which the last lap begins, and the joints then; NaN until that time.
        self._lap: tuple[AnyArray, AnyArray] | None = None
        self._lap_drift: AnyArray = np.nan
        self._start: AnyArray | None = None
        self._moved: State = Largest.start
        self._moved_in_the_end: AnyArray = np.nan

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.target is None and motion.lap_start is not None:
            # Joints that move to a target posture do not drift.
            self._add_lap(motion, np.asarray(motion.lap_start))
        if self._start is None:
            self._start = motion.p_WE[0].copy()
        moved = lengths(motion.p_WE - self._start)
        self._moved = Largest().added(self._moved, moved, motion.time)
        self._moved_in_the_end = moved[-1]

    def _add_lap(self, motion: Motion, began: AnyArray) -> None:
        """Take the lap's drift if the run ends here; the lap's start may be in an earlier part."""
        time, q = motion.time, motion.position
        if self._lap is None:
            self._lap = np.full(began.shape, np.nan), np.full(q.shape[1:], np.nan)
        here = (time[0] - 1e-9 <= began) & (began <= time[-1] + 1e-9)
        for start in np.unique(began[here]):
            now = (began == start)[..., None]
            step = int(np.searchsorted(time, start - 1e-9))
            known_start, known_q = self._lap
            self._lap = np.where(now[..., 0], start, known_start), np.where(now, q[step], known_q)
        self._lap_drift = np.nan
        if motion.until is None or time[-1] >= motion.until - 1e-9:
            # A run that is cut short has another last lap, whose start is no longer known.
            same = abs(self._lap[0] - began) < 1e-9
            self._lap_drift = np.where(same, abs(q[-1] - self._lap[1]).max(axis=-1), np.nan)

    def found(self) -> Found:
        """Return the metrics, by name."""
        return {
            "lap_drift_max_rad": self._lap_drift,
            "end_effector_drift_max_m": Largest().value(self._moved),
            "end_effector_drift_end_m": self._moved_in_the_end,
        }


class DisplacementMetrics:
    """Differences of the end effector's displacement from that in the law's multipliers."""

    def __init__(self) -> None:
        self._invariant: State = Largest.start
        # End effector and displacement at the start.
        self._start: tuple[AnyArray, AnyArray] | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if (displacement := motion.observed.get("displacement")) is None:
            return
        p_WE = motion.seen.p_WE
        if self._start is None:
            self._start = p_WE[0].copy(), displacement[0].copy()
        moved, told = p_WE - self._start[0], displacement - self._start[1]
        self._invariant = Largest().added(self._invariant, lengths(moved - told), motion.time)

    def found(self) -> Found:
        """Return the metric, by name."""
        return {"invariant_error_max_m": Largest().value(self._invariant)}
