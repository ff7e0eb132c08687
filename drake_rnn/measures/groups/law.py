"""What a law tells of itself."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array
from ...laws.layout import Signals
from ..motion import Motion
from ..running import Largest, Mean, Smallest
from .group import Found


class LawMetrics:
    """Metrics of a law's observables over the whole run."""

    def __init__(self) -> None:
        self._saturated, self._demand, self._rank = Mean(), Largest(), Smallest()
        self._invariant = Largest()
        # End effector and displacement at the start.
        self._start: tuple[Array, Array] | None = None
        self._lost: float | None = None

    def add(self, motion: Motion, observed: Signals) -> None:
        """Add the next part of the run.

        Args:
            motion: Motion as the law saw it.
            observed: Observables of the law at every step.
        """
        if "saturated" in observed:
            self._saturated.add(observed["saturated"][motion.fresh])
        if "acceleration_demand" in observed:
            self._demand.add(np.abs(observed["acceleration_demand"]))
        if "orientation_rank" in observed:
            self._rank.add(observed["orientation_rank"])
        if self._lost is None and "contact_lost" in observed and observed["contact_lost"].any():
            self._lost = float(motion.time[np.argmax(observed["contact_lost"][:, 0])])
        if "displacement" in observed:
            self._add_displacement(motion.p_WE, observed["displacement"])

    def _add_displacement(self, p_WE: Array, displacement: Array) -> None:
        if self._start is None:
            self._start = p_WE[0].copy(), displacement[0].copy()
        moved, told = p_WE - self._start[0], displacement - self._start[1]
        self._invariant.add(np.linalg.norm(moved - told, axis=1))

    def found(self) -> Found:
        """Return the metrics, by name."""
        found: Found = {
            "saturated_fraction": self._saturated.value,
            "joint_acceleration_demand_max_rad_s2": self._demand.value,
            "orientation_rank_min": self._rank.value,
            "invariant_error_max_m": self._invariant.value,
        }
        if self._lost is not None:
            # A loss that the law detects counts even if some contact is left.
            found["contact_lost_time_s"] = self._lost
        return found
