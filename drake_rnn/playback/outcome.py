"""The expected and the measured outcome of a run, as the page's header shows them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..experiment.document import Acceptance
from ..measures import METRICS, told
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.limit_use import uses
from ..runs.result import Result

_MEANINGS = {metric.name: metric for metric in METRICS}


def outcome_of(result: Result) -> dict[str, Any]:
    """Return what the page says of a run: texts, and whether each criterion and limit was met."""
    document, verdicts = result.experiment.document, result.verdicts
    kind, verdict = _verdict(result)
    met = sum(each.met for each in verdicts)
    summary = f"{met} of {len(verdicts)} criteria met" if verdicts else "no criteria"
    limits = list(_limits(result))
    return {
        "paper": document.paper,
        "expect": document.expect,
        "status": ""
        if result.status == "complete"
        else f"{result.status}: {result.failure}".rstrip(": "),
        "kind": kind,
        "verdict": verdict,
        "summary": summary,
        "criteria": [
            {
                "name": in_words(each.metric),
                "meaning": _MEANINGS[each.metric].meaning,
                "value": "not reached"
                if each.value is None
                else told(each.value, _MEANINGS[each.metric].unit),
                "bound": _bound(each.bound, _MEANINGS[each.metric].unit),
                "met": each.met,
            }
            for each in verdicts
        ],
        "limits": limits,
        "broken": [limit["name"] for limit in limits if not limit["kept"]],
        "warnings": list(result.warnings),
    }


def in_words(metric: str) -> str:
    """Return the name of a metric as words, without its unit."""
    words = _MEANINGS[metric].words
    for order, derivative in enumerate(DERIVATIVE_UNITS, start=1):
        words = words.replace(f"limit ratio {order}", f"{derivative} / bound")
    return words


def _verdict(result: Result) -> tuple[str, str]:
    """Return "good", "bad" or, without criteria, nothing; and the verdict on a run in words."""
    if result.status != "complete":
        return "bad", "broke off"
    if not result.verdicts:
        return "", "ran to its end"
    if all(verdict.met for verdict in result.verdicts):
        return "good", "accepted"
    return "bad", "not accepted"


def _bound(bound: Acceptance, unit: str) -> str:
    ends = (("≥", bound.at_least), ("≤", bound.at_most))
    return ", ".join(f"{sign} {told(end, unit)}" for sign, end in ends if end is not None)


def _limits(result: Result) -> Iterator[dict[str, Any]]:
    """Yield each limit that applies: whether the run kept it, and by what margin."""
    for use in uses(result):
        text = f"up to {100.0 * use.share:.4g} % of its bound"
        if use.name == "position":
            margin = result.metrics.get("joint_limit_margin_min_rad", np.nan)
            text = f"{'exceeded by' if use.broken else 'at least'} {told(abs(margin), 'rad')}"
            text += "" if use.broken else " left"
        if use.broken and use.name in result.experiment.commanded_limits:
            text += " by the arm; the law keeps it of its command alone"
        yield {"name": use.name, "kept": not use.broken, "text": text}
