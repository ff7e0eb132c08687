"""Bounds that the metrics of a run are expected to keep."""

from __future__ import annotations

import numpy as np

from ..measures.metric import violation_metric
from ..robot.limits import DERIVATIVE_UNITS
from .document import Acceptance
from .experiment import Experiment


def expected_bounds(experiment: Experiment) -> dict[str, Acceptance]:
    """Return the bounds on metrics: the document's, and those of the limits that the law keeps.

    Only limits that the law or a filter behind it keeps by construction are expected to be kept.
    They become bounds on ratios, because joints may differ in their limits.
    """
    limits, kept = experiment.limits, experiment.guarantees.arm.limits
    bounds = {}
    if "position" in kept and np.isfinite(limits.position_upper - limits.position_lower).any():
        bounds["joint_limit_margin_min_rad"] = Acceptance(at_least=0.0)
    # The difference quotient of a motion at its bound carries rounding errors.
    for order, name in enumerate(DERIVATIVE_UNITS, start=1):
        if name in kept and limits.bounds[name] is not None:
            bounds[f"limit_ratio_{order}_max"] = Acceptance(at_most=1.0 + 1e-9)
    if "envelope" in kept and limits.envelope is not None:
        bounds[violation_metric("envelope")] = Acceptance(at_most=1e-9)
    return bounds | experiment.document.accept
