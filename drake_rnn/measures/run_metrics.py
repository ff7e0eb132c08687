"""All metrics of a run, taken from its parts as they come."""

from __future__ import annotations

import numpy as np

from ..laws.layout import Signals
from ..robot.limits import JointLimits
from .groups import (
    ContactMetrics,
    DriftMetrics,
    ErrorMetrics,
    FollowingMetrics,
    Found,
    Group,
    HeldJerkMetrics,
    HigherMetrics,
    JacobianMetrics,
    JointMetrics,
    LawMetrics,
    PostureMetrics,
)
from .motion import Motion


class RunMetrics:
    """The metrics of a run.

    Errors, drift and Jacobian errors are taken over ``window``; velocities, accelerations,
    margins and violations always over the whole run.

    Args:
        limits: Limits of the experiment.
        window: Start and end of the window [s]; None for the whole run.
        settling_tolerance: Position error below which the arm has settled [m].

    Attributes:
        contact: The metrics of the contact.
        following: Those of how closely the arm follows its command.
    """

    def __init__(
        self,
        limits: JointLimits,
        window: tuple[float, float] | None,
        settling_tolerance: float,
    ) -> None:
        self.contact = ContactMetrics(window)
        self.following = FollowingMetrics()
        self._of_motion: tuple[Group, ...] = (
            ErrorMetrics(window, settling_tolerance),
            DriftMetrics(window),
            JointMetrics(limits),
            HigherMetrics(limits),
            HeldJerkMetrics(limits),
            PostureMetrics(window),
            self.following,
            self.contact,
        )
        self._learned = JacobianMetrics(window)
        self._of_law = LawMetrics()

    def add(self, motion: Motion, seen: Motion, learned: Motion, observed: Signals) -> None:
        """Add the next part of the run.

        Args:
            motion: Motion of the arm.
            seen: Motion as the law saw it.
            learned: Motion of the arm of which a law learns the Jacobian.
            observed: Observables of the law at every step.
        """
        if motion.time.size == 0:
            return
        # In a run that diverged, squares may overflow: metrics that are not finite are left out.
        with np.errstate(over="ignore", invalid="ignore"):
            for group in self._of_motion:
                group.add(motion)
            self._learned.add(learned)
            self._of_law.add(seen, observed)

    def found(self, *, of_law: bool = True) -> dict[str, float]:
        """Return the metrics that apply, by name.

        Args:
            of_law: Whether those that follow from the law's observables are among them.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            metrics: Found = {}
            for group in (*self._of_motion, self._learned):
                metrics |= group.found()
            if of_law:
                metrics |= self._of_law.found()
        return {
            name: float(value)
            for name, value in metrics.items()
            if value is not None and np.isfinite(value)
        }
