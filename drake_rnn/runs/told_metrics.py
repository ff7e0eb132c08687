"""Metrics as readers see them: names in words, values and bounds with units that suit them."""

from __future__ import annotations

from ..experiment.document import Acceptance
from ..measures import METRICS, told, violation_metric
from ..robot.limits import LIMIT_UNITS

_METRICS = {metric.name: metric for metric in METRICS}
_VIOLATIONS = {violation_metric(limit) for limit in LIMIT_UNITS}
# Violation that is a rounding error, in any unit.
_ROUNDING = 1e-12


def words_of(metric: str) -> str:
    """Return the name of a metric as words, without its unit."""
    return _METRICS[metric].words


def meaning_of(metric: str) -> str:
    """Return what a metric is."""
    return _METRICS[metric].meaning


def told_value(metric: str, value: float | None) -> str:
    """Return the value of a metric with its unit; None stands for one that a run does not have."""
    if value is None:
        return "not reached"
    if metric in _VIOLATIONS and abs(value) < _ROUNDING:
        return "none"
    return _written(metric, value)


def told_bound(metric: str, bound: Acceptance) -> str:
    """Return the bound of a metric with its unit."""
    ends = (("≥", bound.at_least), ("≤", bound.at_most))
    return ", ".join(f"{sign} {_written(metric, end)}" for sign, end in ends if end is not None)


def _written(metric: str, value: float) -> str:
    """Return a number with its unit, and with a minus sign for a hyphen."""
    return told(value, _METRICS[metric].unit).replace("-", "−")
