"""The summary of a campaign's rows.

- Formulas of the statistics, in closed form: intervals of shares and quantiles, correlations.
- The table of a campaign: one line for each row, in order, reproducible to the last bit.
"""

from __future__ import annotations

import csv
import json
import math
import shlex
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..measures import METRICS, shown_in
from ..runs.folder import written_whole
from .plan import (
    CampaignDocument,
    StatisticsSettings,
)
from .requests import RunRecord, RunRequest


class Interval(NamedTuple):
    """An estimate with a confidence interval.

    Attributes:
        value: The estimate.
        low: Lower bound; minus infinity if there are too few values for one.
        high: Upper bound; infinity if there are too few values for one.
    """

    value: float
    low: float
    high: float


def share(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Return the share of successes with its Wilson score interval.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    Journal of the American Statistical Association, 1927. Unlike the interval of the normal
    approximation, it is right for shares near 0 and 1, and for few trials.

    Args:
        successes: Number of successes.
        trials: Number of trials.
        confidence: Probability with which the interval covers the true share.
    """
    if trials == 0:
        return Interval(math.nan, 0.0, 1.0)
    z2 = NormalDist().inv_cdf(0.5 + confidence / 2) ** 2
    p = successes / trials
    middle = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    spread = math.sqrt(z2 * (p * (1 - p) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    low = 0.0 if successes == 0 else max(middle - spread, 0.0)
    high = 1.0 if successes == trials else min(middle + spread, 1.0)
    return Interval(p, low, high)


def quantile(values: Array, probability: float, confidence: float = 0.95) -> Interval:
    """Return a quantile with an interval between two order statistics.

    The number of values below the true quantile is binomial whatever their distribution, so the
    interval covers the true quantile with at least the confidence, for any number of values. With
    too few values in a tail the interval has no bound there. Source: H. A. David and H. N.
    Nagaraja, "Order Statistics", 2003, section 7.1.

    Args:
        values: The values, shape (k,), none of them NaN.
        probability: Probability of the quantile, between 0 and 1.
        confidence: Probability with which the interval covers the true quantile.
    """
    if values.size == 0:
        return Interval(math.nan, -math.inf, math.inf)
    ordered, tail = np.sort(values), (1 - confidence) / 2
    # P(B <= j) for j = 0 .. k, where B is the number of values below the true quantile.
    below = np.cumsum(_binomial(values.size, probability))
    # Both sums carry rounding errors.
    first = int(np.searchsorted(below, tail * (1 + 1e-12), "right"))
    last = int(np.searchsorted(below, (1 - tail) * (1 - 1e-12), "left"))
    low = float(ordered[first - 1]) if first >= 1 else -math.inf
    high = float(ordered[last]) if last < values.size else math.inf
    return Interval(float(np.quantile(ordered, probability)), low, high)


@lru_cache(maxsize=64)
def _binomial(trials: int, p: float) -> Array:
    """Return the probabilities of 0 .. ``trials`` successes, shape (trials + 1,)."""
    logs = [
        math.lgamma(trials + 1)
        - math.lgamma(k + 1)
        - math.lgamma(trials - k + 1)
        + k * math.log(p)
        + (trials - k) * math.log1p(-p)
        for k in range(trials + 1)
    ]
    return np.exp(logs)


def rank_correlation(x: Array, y: Array) -> float:
    """Return Spearman's rank correlation; NaN for fewer than 3 pairs, or if x or y is constant.

    Source: C. Spearman, "The proof and measurement of association between two things", American
    Journal of Psychology, 1904: the correlation of ranks, where equal values have their mean rank.

    Args:
        x: Values, shape (k,).
        y: Values paired with ``x``, shape (k,); pairs with a NaN are left out.
    """
    both = np.isfinite(x) & np.isfinite(y)
    if both.sum() < _FEWEST:
        return math.nan
    a, b = _ranks(x[both]), _ranks(y[both])
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0 else math.nan


#: Fewest pairs of a correlation: two pairs always correlate perfectly.
_FEWEST = 3


def _ranks(values: Array) -> Array:
    """Return ranks from 1; equal values have the mean of their ranks."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return np.asarray((ends - (counts - 1) / 2)[place], dtype=float)


def chance_correlation(count: int, confidence: float = 0.95) -> float:
    """Return the magnitude that a rank correlation of independent values hardly exceeds.

    From Student's distribution in its normal approximation, good from some 20 values.

    Args:
        count: Number of pairs.
        confidence: Probability that the correlation stays below this magnitude.
    """
    if count < _FEWEST:
        return 1.0
    return min(1.0, NormalDist().inv_cdf(0.5 + confidence / 2) / math.sqrt(count - 1))


@dataclass(frozen=True)
class Line:
    """A row of a campaign that has ended.

    Attributes:
        number: Number of the row, from 0.
        values: Values of the varied keys.
        record: Record of the row's run.
    """

    number: int
    values: Mapping[str, Any]
    record: RunRecord

    @property
    def outcome(self) -> RunRecord:
        """The record, by its name of version 0.3."""
        warnings.warn("outcome is now record", DeprecationWarning, stacklevel=2)
        return self.record


def lines_of(rows: Sequence[RunRequest], records: Mapping[str, RunRecord]) -> list[Line]:
    """Return the lines of the rows that have ended, in the order of the rows.

    Args:
        rows: The requests of all rows.
        records: Records by the keys of the requests.
    """
    return [
        Line(number, request.changes, records[request.key])
        for number, request in enumerate(rows)
        if request.key in records
    ]


def metrics_in(lines: Sequence[Line]) -> list[str]:
    """Return the names of the metrics that any line has, in the order of `METRICS`."""
    found = {name for line in lines for name in line.record.metrics}
    return [name for name in METRICS.names if name in found]


def numbers_in(values: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the numbers among the values of a row: entries of a list as ``key[0]`` and so on."""
    for key, value in values.items():
        if isinstance(value, list):
            yield from numbers_in({f"{key}[{k}]": entry for k, entry in enumerate(value)})
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield key, float(value)


def varied_numbers(lines: Sequence[Line]) -> dict[str, Array]:
    """Return the varied keys whose values are numbers in all lines, shape (k,) each, by name."""
    columns = [dict(numbers_in(line.values)) for line in lines]
    names = [name for name in (columns or [{}])[0] if all(name in column for column in columns)]
    return {name: np.array([column[name] for column in columns]) for name in names}


def metric_column(lines: Sequence[Line], name: str) -> Array:
    """Return a metric of all lines, shape (k,); NaN for a run that did not complete."""
    nan = float("nan")
    records = [line.record for line in lines]
    found = [each.metrics.get(name, nan) if each.status == "complete" else nan for each in records]
    return np.array(found, dtype=float)


def write_table(
    file: Path, keys: Sequence[str], lines: Sequence[Line], metrics: Sequence[str]
) -> None:
    """Write a CSV file: row, varied keys, status, method, time, metrics, bounds not kept.

    Numbers read back bit for bit; lists and mappings are written as JSON.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    head = ["row", *keys, "status", "method", "until_s", *metrics, "not_kept", "failure"]
    write_lines(file, head, (_cells(line, keys, metrics) for line in lines))


def _cells(line: Line, keys: Sequence[str], metrics: Sequence[str]) -> list[Any]:
    record = line.record
    return [
        line.number,
        *(cell(line.values[key]) for key in keys),
        *(record.status, record.method, repr(record.until_s)),
        *numbers_of(record.metrics, metrics),
        *(" ".join(record.not_met), record.failure),
    ]


def numbers_of(found: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Return metrics as texts that read back bit for bit; empty for those that are missing."""
    return [repr(found[name]) if name in found else "" for name in names]


def write_lines(file: Path, head: Sequence[str], lines: Iterable[Sequence[Any]]) -> None:
    """Write a CSV file.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    try:
        with written_whole(file) as stream:
            writer = csv.writer(stream)
            writer.writerow(head)
            writer.writerows(lines)
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None


def cell(value: Any) -> str:
    """Return a value of a varied key as a text: numbers and texts as they are, others as JSON."""
    return value if isinstance(value, str) else json.dumps(value)


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
    complete = [line for line in lines if line.record.status == "complete"]
    numbers = {name: x for name, x in varied_numbers(complete).items() if np.ptp(x) > 0}
    return Summary(
        name=campaign.name,
        rows=rows,
        statuses=dict(sorted(Counter(line.record.status for line in lines).items())),
        methods=dict(sorted(Counter(line.record.method for line in lines).items())),
        shares=_shares(lines, settings.confidence),
        metrics=[
            _metric(name, complete, numbers, settings, experiment)
            for name in campaign.metrics or _telling(complete)
        ],
        unlike=[
            (line.number, ended.status, ended.failure, repeat_command(line.values, experiment))
            for line in lines
            if (ended := line.record).status != "complete"
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
    accepted = dict.fromkeys(name for line in lines for name in line.record.accepted)
    expected = dict.fromkeys(name for line in lines for name in line.record.kept)
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
    kept = line.record.kept
    return line.record.status == "complete" and all(kept.get(name, True) for name in names)


def _telling(lines: Sequence[Line]) -> list[str]:
    """Return the metrics that a summary shows by default.

    They vary over the rows, and either have a bound to keep or are shown in a sweep.
    """
    wanted = {name for line in lines for name in line.record.kept} | set(shown_in("sweep"))
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
