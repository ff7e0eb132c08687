"""All metrics of a run, or of runs side by side, taken from their parts as they come."""

from __future__ import annotations

import numpy as np

from ..arrays.algebra import AnyArray
from .metric import State
from .metric_groups import (
    BoundMetrics,
    DisplacementMetrics,
    DriftMetrics,
    FollowingMetrics,
    Found,
    GapMetrics,
    Group,
    HeldJerkMetrics,
    HigherMetrics,
    NetworkMetrics,
    RestMetrics,
)
from .metrics import METRICS
from .motion import Motion
from .values import Values, Yardsticks


class RunMetrics:
    """The metrics of a run, or of robots that run side by side.

    Errors, drift and Jacobian errors are taken over the window; velocities, accelerations, margins
    and violations always over the whole run.

    Args:
        against: What motions are measured against.

    Attributes:
        gap: The time at which contact was lost.
        following: The largest distance of the arm from its command.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._against = against
        self.gap = GapMetrics()
        self.following = FollowingMetrics()
        self._groups: tuple[Group, ...] = (
            DriftMetrics(),
            BoundMetrics(against),
            NetworkMetrics(),
            HigherMetrics(against),
            HeldJerkMetrics(against),
            DisplacementMetrics(),
            RestMetrics(),
            self.following,
            self.gap,
        )
        self._taken = tuple(metric for metric in METRICS if metric.of is not None)
        self._gathered: dict[str, State] = {}

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.time.size == 0:
            return
        # Squares may overflow in a run that diverged; metrics that are not finite are left out.
        with np.errstate(all="ignore"):
            for group in self._groups:
                group.add(motion)
            everywhere = motion.steps_within(None)
            inside = motion.steps_within(self._against.window)
            # Metrics may share their values.
            known: dict[Values, AnyArray | None] = {}
            for metric in self._taken:
                steps = inside if metric.over == "window" else everywhere
                if steps.start == steps.stop or metric.of is None:
                    continue
                if metric.of not in known:
                    known[metric.of] = metric.of(motion, self._against)
                if (values := known[metric.of]) is None:
                    continue
                # Values between steps, e.g. accelerations, have no row for the first step.
                lead = motion.time.size - len(values)
                values = values[max(0, steps.start - lead) : max(0, steps.stop - lead)]
                if len(values):
                    state = self._gathered.get(metric.name, metric.by.start)
                    times = motion.time[steps.stop - len(values) : steps.stop]
                    self._gathered[metric.name] = metric.by.added(state, values, times)

    def found(self, *, of_law: bool = True) -> Found:
        """Return the metrics, by name, each of shape (...); not finite where there is none.

        Args:
            of_law: Whether those that follow from the law's observables are among them.
        """
        with np.errstate(all="ignore"):
            found: Found = {}
            for group in self._groups:
                if of_law or not isinstance(group, DisplacementMetrics):
                    found |= group.found()
            for metric in self._taken:
                if metric.name not in self._gathered or (metric.of_law and not of_law):
                    continue
                value = np.asarray(metric.by.value(self._gathered[metric.name]))
                if metric.name in found:
                    # A loss of contact that the law detects counts, even if some contact is left.
                    value = np.where(np.isfinite(value), value, found[metric.name])
                found[metric.name] = value
        return found


def of_one_run(found: Found) -> dict[str, float]:
    """Return the metrics of one run that apply, by name, in the order of `METRICS`."""
    return {
        metric.name: float(found[metric.name])
        for metric in METRICS
        if metric.name in found and np.isfinite(found[metric.name])
    }
