"""What a law tells of how far it has moved the end effector."""

from __future__ import annotations

from ...arrays.namespace import AnyArray
from ...arrays.series import lengths
from ..gathering import Largest, State
from ..motion import Motion
from .group import Found


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
