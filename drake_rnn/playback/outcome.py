"""What was expected of a run, and what came out, as the page's header tells it."""

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
    """Return what the page tells of a run: texts, and whether each criterion and limit was met."""
    document, verdicts = result.experiment.document, result.verdicts
    met = sum(verdict.met for verdict in verdicts)
    complete = result.status == "complete"
    summary = f"{met} of {len(verdicts)} criteria met" if verdicts else "no criteria"
    limits = list(_limits(result))
    return {
        "paper": document.paper,
        "expect": document.expect,
        "status": "" if complete else f"{result.status}: {result.failure}".rstrip(": "),
        "kind": _kind(complete, met == len(verdicts), bool(verdicts)),
        "verdict": _verdict(complete, met == len(verdicts), bool(verdicts)),
        "summary": summary,
        "criteria": [
            {
                "name": in_words(verdict.metric),
                "meaning": _MEANINGS[verdict.metric].meaning,
                "value": "not reached"
                if verdict.value is None
                else told(verdict.value, _MEANINGS[verdict.metric].unit),
                "bound": _bound(verdict.bound, _MEANINGS[verdict.metric].unit),
                "met": verdict.met,
            }
            for verdict in verdicts
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


def _kind(complete: bool, met: bool, asked: bool) -> str:
    """Return whether a run came out well; nothing is said of one of which nothing is asked."""
    if complete and not asked:
        return ""
    return "good" if complete and met else "bad"


def _verdict(complete: bool, met: bool, asked: bool) -> str:
    if not complete:
        return "broke off"
    if not asked:
        return "ran to its end"
    return "accepted" if met else "not accepted"


def _bound(bound: Acceptance, unit: str) -> str:
    ends = (("≥", bound.at_least), ("≤", bound.at_most))
    return ", ".join(f"{sign} {told(end, unit)}" for sign, end in ends if end is not None)


def _limits(result: Result) -> Iterator[dict[str, Any]]:
    """Yield each limit that counts: whether it was kept, and how nearly it was not."""
    for use in uses(result):
        text = f"up to {100.0 * use.share:.4g} % of its bound"
        if use.name == "position":
            margin = result.metrics.get("joint_limit_margin_min_rad", np.nan)
            text = f"{'exceeded by' if use.broken else 'at least'} {told(abs(margin), 'rad')}"
            text += "" if use.broken else " left"
        yield {"name": use.name, "kept": not use.broken, "text": text}
