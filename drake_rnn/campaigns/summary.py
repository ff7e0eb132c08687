"""The summary of a campaign's rows."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..measures import shown_in
from .document import CampaignDocument, StatisticsSettings
from .statistics import Interval, chance_correlation, quantile, rank_correlation, share
from .table import Line, metric_column, metrics_in, varied_numbers


@dataclass(frozen=True)
class Worst:
    """One of the worst rows of a metric.

    Attributes:
        row: Number of the row.
        value: Value of the metric.
        command: Command that repeats the row's run.
    """

    row: int
    value: float
    command: str


@dataclass(frozen=True)
class MetricSummary:
    """A metric over the rows that completed.

    Attributes:
        name: Name of the metric.
        count: Number of rows that have it.
        mean: Mean value.
        least: Smallest value.
        largest: Largest value.
        quantiles: Quantiles with their intervals, by probability.
        worst: Rows with the worst values, the worst first.
        correlations: Rank correlation with each varied number, by name.
    """

    name: str
    count: int
    mean: float
    least: float
    largest: float
    quantiles: dict[float, Interval]
    worst: list[Worst]
    correlations: dict[str, float]


@dataclass(frozen=True)
class Summary:
    """Summary of a campaign's rows.

    Attributes:
        name: Name of the campaign.
        rows: Number of planned rows.
        statuses: Number of rows of each status; rows that have not been run have none.
        methods: Number of rows carried out by each method.
        shares: Share of the ended rows that keep the bounds expected of them: all bounds, those of
            ``accept``, those of the limits, and each metric's bound. A row that did not complete
            keeps none.
        metrics: The metrics.
        unlike: Rows that did not complete: number, status, reason and the command that repeats the
            run.
        chance: Magnitude that a rank correlation rarely exceeds by chance.
        confidence: Confidence of the intervals.
    """

    name: str
    rows: int
    statuses: dict[str, int]
    methods: dict[str, int]
    shares: dict[str, Interval]
    metrics: list[MetricSummary]
    unlike: list[tuple[int, str, str, str]]
    chance: float
    confidence: float

    @property
    def complete(self) -> int:
        """Number of rows that completed."""
        return self.statuses.get("complete", 0)


def summarize(
    campaign: CampaignDocument, rows: int, lines: Sequence[Line], experiment: Path
) -> Summary:
    """Return the summary of a campaign's rows.

    Args:
        campaign: Document of the campaign.
        rows: Number of planned rows.
        lines: Rows that have ended.
        experiment: File of the experiment, which the commands that repeat a row name.
    """
    settings = campaign.statistics
    complete = [line for line in lines if line.outcome.status == "complete"]
    numbers = {name: x for name, x in varied_numbers(complete).items() if np.ptp(x) > 0}
    return Summary(
        name=campaign.name,
        rows=rows,
        statuses=dict(sorted(Counter(line.outcome.status for line in lines).items())),
        methods=dict(sorted(Counter(line.outcome.method for line in lines).items())),
        shares=_shares(lines, settings.confidence),
        metrics=[
            _metric(name, complete, numbers, settings, experiment)
            for name in campaign.metrics or _telling(complete)
        ],
        unlike=[
            (line.number, ended.status, ended.failure, repeat_command(line.values, experiment))
            for line in lines
            if (ended := line.outcome).status != "complete"
        ],
        chance=chance_correlation(len(complete), settings.confidence),
        confidence=settings.confidence,
    )


def smaller_is_worse(metric: str) -> bool:
    """Return whether the smallest value of a metric is the worst, as for a margin."""
    return "_min" in metric


def repeat_command(values: Mapping[str, Any], experiment: Path) -> str:
    """Return the command that runs one row alone, with bit-identical numbers.

    Args:
        values: Values of the varied keys.
        experiment: File of the experiment.
    """
    changes = [f"--set {shlex.quote(f'{key}={json.dumps(v)}')}" for key, v in values.items()]
    return " ".join(["drake-rnn run", shlex.quote(str(experiment)), *changes])


def _shares(lines: Sequence[Line], confidence: float) -> dict[str, Interval]:
    """Return the shares of the rows that keep each group of bounds."""
    accepted = dict.fromkeys(name for line in lines for name in line.outcome.accepted)
    expected = dict.fromkeys(name for line in lines for name in line.outcome.kept)
    limits = [name for name in expected if name not in accepted]
    groups: dict[str, list[str]] = {"complete": []}
    if expected:
        groups["all bounds"] = list(expected)
    if accepted and limits:
        groups |= {"accept": list(accepted), "limits that the law keeps": limits}
    groups |= {name: [name] for name in expected}
    return {
        group: share(sum(_keeps(line, names) for line in lines), len(lines), confidence)
        for group, names in groups.items()
    }


def _keeps(line: Line, names: Sequence[str]) -> bool:
    # A bound counts only in rows that are expected to keep it; rows may differ in their limits.
    kept = line.outcome.kept
    return line.outcome.status == "complete" and all(kept.get(name, True) for name in names)


def _telling(lines: Sequence[Line]) -> list[str]:
    """Return the metrics that a summary shows by default.

    They vary over the rows, and either have a bound to keep or are shown in a sweep.
    """
    wanted = {name for line in lines for name in line.outcome.kept} | set(shown_in("sweep"))
    chosen = []
    for name in metrics_in(lines):
        column = metric_column(lines, name)
        known = column[np.isfinite(column)]
        if name in wanted and known.size and np.ptp(known) > 1e-9 * np.abs(known).max():
            chosen.append(name)
    return chosen


def _metric(
    name: str,
    lines: Sequence[Line],
    numbers: Mapping[str, Any],
    settings: StatisticsSettings,
    experiment: Path,
) -> MetricSummary:
    column = metric_column(lines, name)
    known = column[~np.isnan(column)]
    order = np.argsort(column if smaller_is_worse(name) else -column, kind="stable")
    worst = [
        Worst(lines[k].number, float(column[k]), repeat_command(lines[k].values, experiment))
        for k in order[: min(settings.worst, known.size)]
    ]
    return MetricSummary(
        name=name,
        count=int(known.size),
        mean=float(known.mean()) if known.size else float("nan"),
        least=float(known.min(initial=np.inf)),
        largest=float(known.max(initial=-np.inf)),
        quantiles={p: quantile(known, p, settings.confidence) for p in settings.quantiles},
        worst=worst,
        correlations={key: rank_correlation(x, column) for key, x in numbers.items()},
    )
