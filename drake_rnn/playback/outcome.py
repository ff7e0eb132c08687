"""The expected and the measured outcome of a run, as the page's header shows them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..experiment.document import Acceptance
from ..measures import METRICS, told, violation_metric
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS
from ..runs.conclusion import conclusion_of
from ..runs.limit_use import share_metric, uses
from ..runs.result import Result
from ..runs.verdict import Verdict
from .replay import name_of

_MEANINGS = {metric.name: metric for metric in METRICS}
_VIOLATIONS = {violation_metric(limit) for limit in LIMIT_UNITS}
# Violation that is a rounding error, in any unit.
_ROUNDING = 1e-12


def outcome_of(result: Result) -> dict[str, Any]:
    """Return what the page says of a run: texts, and whether each criterion and limit was met."""
    document, verdicts = result.experiment.document, result.verdicts
    conclusion = conclusion_of(result)
    limits = list(_limits(result))
    return {
        "name": name_of(result),
        "paper": document.paper,
        "expect": document.expect,
        "status": ""
        if result.status == "complete"
        else f"{result.status}: {result.failure}".rstrip(": "),
        "kind": conclusion.kind,
        "verdict": conclusion.verdict,
        "summary": conclusion.criteria,
        "criteria": [
            {
                "name": in_words(each.metric),
                "meaning": _MEANINGS[each.metric].meaning,
                "value": _value(each),
                "bound": _bound(each.bound, _MEANINGS[each.metric].unit),
                "met": each.met,
            }
            for each in sorted(verdicts, key=lambda one: one.metric not in document.accept)
        ],
        "limits": limits,
        "broken": list(conclusion.broken),
        "warnings": list(result.warnings),
    }


def in_words(metric: str) -> str:
    """Return the name of a metric as words, without its unit."""
    words = _MEANINGS[metric].words
    for order, derivative in enumerate(DERIVATIVE_UNITS, start=1):
        words = words.replace(f"limit ratio {order}", f"{derivative} / bound")
    return words


def _value(verdict: Verdict) -> str:
    if verdict.value is None:
        return "not reached"
    if verdict.metric in _VIOLATIONS and abs(verdict.value) < _ROUNDING:
        return "none"
    return _written(verdict.value, _MEANINGS[verdict.metric].unit)


def _bound(bound: Acceptance, unit: str) -> str:
    ends = (("≥", bound.at_least), ("≤", bound.at_most))
    return ", ".join(f"{sign} {_written(end, unit)}" for sign, end in ends if end is not None)


def _written(value: float, unit: str) -> str:
    """Return a number with its unit, and with a minus sign for a hyphen."""
    return told(value, unit).replace("-", "−")


def _limits(result: Result) -> Iterator[dict[str, Any]]:
    """Yield each limit that applies: whether the run kept it, and by what margin.

    A limit whose share of its bound is a criterion is ``judged`` there.
    """
    judged = {verdict.metric for verdict in result.verdicts}
    for use in uses(result):
        text = f"up to {100.0 * use.share:.4g} % of its bound"
        if use.name == "position":
            margin = result.metrics.get("joint_limit_margin_min_rad", np.nan)
            text = f"{'exceeded by' if use.broken else 'at least'} {told(abs(margin), 'rad')}"
            text += "" if use.broken else " left"
        if use.broken and use.name in result.experiment.commanded_limits:
            text += " by the arm; the law keeps it of its command alone"
        yield {
            "name": use.name,
            "kept": not use.broken,
            "text": text,
            "judged": not use.broken and share_metric(use.name) in judged,
        }
