"""The expected and the measured outcome of a run, as the page's header shows them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..measures import told
from ..runs.conclusion import conclusion_of
from ..runs.limit_use import share_metric, uses
from ..runs.result import Result
from ..runs.told_metrics import meaning_of, told_bound, told_value, words_of
from .replay import name_of


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
                "name": words_of(each.metric),
                "meaning": meaning_of(each.metric),
                "value": told_value(each.metric, each.value),
                "bound": told_bound(each.metric, each.bound),
                "met": each.met,
            }
            for each in sorted(verdicts, key=lambda one: one.metric not in document.accept)
        ],
        "limits": limits,
        "broken": list(conclusion.broken),
        "warnings": list(result.warnings),
    }


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
        if use.broken and use.name in result.experiment.guarantees.command_only:
            text += " by the arm; the law keeps it of its command alone"
        yield {
            "name": use.name,
            "kept": not use.broken,
            "text": text,
            "judged": not use.broken and share_metric(use.name) in judged,
        }
