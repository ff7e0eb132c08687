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
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import nearest
from ..measures import METRICS, format_number, place_metrics
from ..runs.folder import written_whole
from .plan import (
    CampaignDocument,
    StatisticsSettings,
)
from .requests import RunRecord, RunRequest

#: What a table or figure of groups shows of a metric: mean and standard deviation, or quantiles.
Statistic = Literal["mean", "quantiles"]


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
    values_in_order, tail = np.sort(values), (1 - confidence) / 2
    # P(B <= j) for j = 0 .. k, where B is the number of values below the true quantile.
    below = np.cumsum(_binomial(values.size, probability))
    # Both sums carry rounding errors.
    first = int(np.searchsorted(below, tail * (1 + 1e-12), "right"))
    last = int(np.searchsorted(below, (1 - tail) * (1 - 1e-12), "left"))
    low = float(values_in_order[first - 1]) if first >= 1 else -math.inf
    high = float(values_in_order[last]) if last < values.size else math.inf
    return Interval(float(np.quantile(values_in_order, probability)), low, high)


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
    names = {name for line in lines for name in line.record.metrics}
    return [name for name in METRICS.names if name in names]


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
    values = [each.metrics.get(name, nan) if each.status == "complete" else nan for each in records]
    return np.array(values, dtype=float)


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


def numbers_of(values: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Return metrics as texts that read back bit for bit; empty for those that are missing."""
    return [repr(values[name]) if name in values else "" for name in names]


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
            for name in campaign.metrics or telling_metrics(complete)
        ],
        unlike=[
            (line.number, record.status, record.failure, repeat_command(line.values, experiment))
            for line in lines
            if (record := line.record).status != "complete"
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
    columns_of_accept = dict.fromkeys(name for line in lines for name in line.record.accepted)
    columns_of_bounds = dict.fromkeys(name for line in lines for name in line.record.kept)
    limits = [name for name in columns_of_bounds if name not in columns_of_accept]
    groups: dict[str, list[str]] = {"complete": []}
    if columns_of_bounds:
        groups["all bounds"] = list(columns_of_bounds)
    if columns_of_accept and limits:
        groups |= {"accept": list(columns_of_accept), "limits that the law keeps": limits}
    groups |= {name: [name] for name in columns_of_bounds}
    return {
        group: share(sum(_keeps(line, names) for line in lines), len(lines), confidence)
        for group, names in groups.items()
    }


def _keeps(line: Line, names: Sequence[str]) -> bool:
    # A bound counts only in rows that are expected to keep it; rows may differ in their limits.
    verdicts = line.record.kept
    return line.record.status == "complete" and all(verdicts.get(name, True) for name in names)


def telling_metrics(lines: Sequence[Line]) -> list[str]:
    """Return the metrics that a summary shows by default.

    They vary over the rows, and either have a bound to keep or are shown in a sweep.
    """
    names = {name for line in lines for name in line.record.kept} | set(place_metrics("sweep"))
    selection = []
    for name in metrics_in(lines):
        column = metric_column(lines, name)
        finite = column[np.isfinite(column)]
        if name in names and finite.size and np.ptp(finite) > 1e-9 * np.abs(finite).max():
            selection.append(name)
    return selection


def _metric(
    name: str,
    lines: Sequence[Line],
    numbers: Mapping[str, Any],
    settings: StatisticsSettings,
    experiment: Path,
) -> MetricSummary:
    column = metric_column(lines, name)
    finite = column[~np.isnan(column)]
    order = np.argsort(column if smaller_is_worse(name) else -column, kind="stable")
    worst = [
        Worst(lines[k].number, float(column[k]), repeat_command(lines[k].values, experiment))
        for k in order[: min(settings.worst, finite.size)]
    ]
    return MetricSummary(
        name=name,
        count=int(finite.size),
        mean=float(finite.mean()) if finite.size else float("nan"),
        least=float(finite.min(initial=np.inf)),
        largest=float(finite.max(initial=-np.inf)),
        quantiles={p: quantile(finite, p, settings.confidence) for p in settings.quantiles},
        worst=worst,
        correlations={key: rank_correlation(x, column) for key, x in numbers.items()},
    )


@dataclass(frozen=True)
class Spread:
    """A metric over the runs of a group.

    Attributes:
        count: Number of runs that completed and have it.
        mean: Mean value; NaN without any.
        deviation: Standard deviation of a sample, divided by count - 1; NaN for fewer than two.
        quantiles: Quantiles by probability.
        values: The values, shape (count,).
    """

    count: int
    mean: float
    deviation: float
    quantiles: dict[float, float]
    values: Array

    def interval(self, statistic: Statistic) -> tuple[float, float, float]:
        """Return the middle, and how far it reaches down and up from there; NaN if not known."""
        if statistic == "mean":
            return self.mean, self.deviation, self.deviation
        quantiles = [self.quantiles[p] for p in sorted(self.quantiles)]
        middle = quantiles[len(quantiles) // 2]
        return middle, middle - quantiles[0], quantiles[-1] - middle

    @classmethod
    def of(cls, values: Array, probabilities: Sequence[float]) -> Spread:
        """Return the spread of values, shape (k,); NaN stands for none."""
        finite = values[~np.isnan(values)]
        nan = float("nan")
        return cls(
            count=int(finite.size),
            mean=float(finite.mean()) if finite.size else nan,
            deviation=float(finite.std(ddof=1)) if finite.size > 1 else nan,
            quantiles={
                p: float(np.quantile(finite, p)) if finite.size else nan for p in probabilities
            },
            values=finite,
        )


@dataclass(frozen=True)
class Group:
    """The runs of a campaign that share some values.

    Attributes:
        values: What they share, of the keys that the campaign is grouped by, as texts.
        rows: Number of runs that have ended.
        complete: Number of those that completed.
        metrics: The metrics over these, by name.
    """

    values: tuple[str, ...]
    rows: int
    complete: int
    metrics: dict[str, Spread]


def group_by(
    lines: Sequence[Line],
    by: Sequence[str],
    metrics: Sequence[str],
    probabilities: Sequence[float] = (0.05, 0.5, 0.95),
) -> list[Group]:
    """Return the groups of rows with the same values of some keys, in the order of these keys.

    Numbers are in their order, and other values in that of the rows.

    Args:
        lines: The rows.
        by: Keys that vary, or that are inside of what varies: ``law.kind`` of ``law``. Without any
            there is one group.
        metrics: Names of the metrics.
        probabilities: Probabilities of the quantiles.

    Raises:
        InvalidInputError: If a key does not vary.
    """
    return [
        _group_of(values, each, metrics, probabilities)
        for values, each in _members(lines, by).items()
    ]


def group_campaigns(
    campaigns: Mapping[str, Sequence[Line]],
    by: Sequence[str],
    metrics: Sequence[str],
    probabilities: Sequence[float] = (0.05, 0.5, 0.95),
) -> list[Group]:
    """Return the groups of several campaigns, those with the same values one after another.

    Args:
        campaigns: The rows of each, by the name that is the last value of its groups.
        by: Keys as of `group_by`; each varies in one campaign or more.
        metrics: Names of the metrics.
        probabilities: Probabilities of the quantiles.

    Raises:
        InvalidInputError: If a key varies in none.
    """
    members = _members([line for lines in campaigns.values() for line in lines], by)
    groups = []
    for values, every in members.items():
        own = {id(line) for line in every}
        for name, lines in campaigns.items():
            if each := [line for line in lines if id(line) in own]:
                groups.append(_group_of((*values, name), each, metrics, probabilities))
    return groups


def _members(lines: Sequence[Line], by: Sequence[str]) -> dict[tuple[str, ...], list[Line]]:
    """Return the rows of each group, by the values that they share, in the order of the keys."""
    if twice := [key for key in by if list(by).count(key) > 1]:
        raise InvalidInputError(f"by: {twice[0]} is given twice")
    keys = keys_in(lines)
    for key in by:
        if key not in keys:
            raise InvalidInputError(f"by: {key} does not vary; {nearest(key, keys)}")
    members: dict[tuple[str, ...], list[Line]] = {}
    for line in lines:
        members.setdefault(tuple(_text_at(line.values, key) for key in by), []).append(line)
    columns = [list(dict.fromkeys(column)) for column in zip(*members, strict=True)]
    ranks = [
        {text: (_number_in(text, math.inf), place) for place, text in enumerate(column)}
        for column in columns
    ]

    def place_of(values: tuple[str, ...]) -> list[tuple[float, int]]:
        return [rank[text] for rank, text in zip(ranks, values, strict=True)]

    return {values: members[values] for values in sorted(members, key=place_of)}


def _group_of(
    values: tuple[str, ...],
    lines: Sequence[Line],
    metrics: Sequence[str],
    probabilities: Sequence[float],
) -> Group:
    return Group(
        values,
        len(lines),
        sum(line.record.complete for line in lines),
        {name: Spread.of(metric_column(lines, name), probabilities) for name in metrics},
    )


def _number_in(text: str, otherwise: float) -> float:
    """Return the number that a value of a varied key is; another one if it is none."""
    value = _value(text)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number else otherwise


def format_values(groups: Sequence[Group]) -> list[tuple[str, ...]]:
    """Return the values of groups with four digits, where these still tell them apart."""
    columns = []
    for column in zip(*(group.values for group in groups), strict=True):
        short = [_without_digits(text) for text in column]
        columns.append(short if len(set(short)) == len(set(column)) else column)
    return list(zip(*columns, strict=True)) if columns else [()] * len(groups)


def _without_digits(text: str) -> str:
    """Return a value of a varied key with four digits of each number that is not whole."""
    value = _value(text)
    if isinstance(value, str):
        return text
    return json.dumps(_rounded(value))


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(format_number(value))
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return value


def group_lines(by: Sequence[str], groups: Sequence[Group]) -> Iterator[list[Any]]:
    """Yield the lines of a table of groups, the head first: a line for each metric of each."""
    some = next((each for group in groups for each in group.metrics.values()), None)
    quantiles = [] if some is None else sorted(some.quantiles)
    spread = [*("count", "mean", "deviation"), *(f"quantile_{p:g}" for p in quantiles)]
    yield [*by, "rows", "complete", "metric", *spread]
    for group in groups:
        for name, each in group.metrics.items():
            numbers = (each.mean, each.deviation, *(each.quantiles[p] for p in quantiles))
            finite = ("" if math.isnan(number) else repr(number) for number in numbers)
            yield [*group.values, group.rows, group.complete, name, each.count, *finite]


def keys_in(lines: Sequence[Line]) -> list[str]:
    """Return the keys that rows may be grouped by: those that vary, and those inside of them."""
    return list(dict.fromkeys(key for line in lines for key in _keys_of(line.values)))


def _keys_of(values: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    for key, value in values.items():
        yield prefix + key
        if isinstance(value, Mapping):
            yield from _keys_of(value, f"{prefix}{key}.")


def _text_at(values: Mapping[str, Any], key: str) -> str:
    """Return the value of a dotted key of a row as a text; ``-`` where it has none."""
    for whole, value in values.items():
        if whole == key:
            return cell(value)
        if key.startswith(f"{whole}."):
            inside = key.removeprefix(f"{whole}.")
            return _text_at(value, inside) if isinstance(value, Mapping) else "-"
    return "-"


# Columns of a table that are not varied keys or metrics, before and after the metrics.
_BEFORE, _AFTER = ("status", "method", "until_s"), ("not_kept", "failure")


def read_lines(file: Path) -> list[Line]:
    """Return the rows that `write_table` has written to a file.

    Raises:
        InvalidInputError: If the file cannot be read, or is no table of a campaign.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            head, *rows = list(csv.reader(stream))
        first = head.index("status")
        keys, after = head[1:first], first + len(_BEFORE)
        if head[0] != "row" or tuple(head[first:after]) != _BEFORE or head[-2:] != [*_AFTER]:
            raise ValueError("has other columns")
        return [_line_of(row, keys, head[after:-2], after) for row in rows]
    except (OSError, ValueError, IndexError) as error:
        why = error.strerror if isinstance(error, OSError) else " ".join(str(error).split())[:120]
        raise InvalidInputError(f"{file}: no table of a campaign: {why}") from None


def _line_of(row: list[str], keys: Sequence[str], metrics: Sequence[str], after: int) -> Line:
    """Return a row of a table.

    Args:
        row: Its cells.
        keys: Names of the varied keys.
        metrics: Names of the metrics.
        after: Number of cells before those of the metrics.
    """
    metric_values = row[after : after + len(metrics)]
    values = {key: _value(text) for key, text in zip(keys, row[1 : 1 + len(keys)], strict=True)}
    numbers = {name: float(text) for name, text in zip(metrics, metric_values, strict=True) if text}
    status, method, until = row[1 + len(keys) : after]
    record: Any = RunRecord
    return Line(
        int(row[0]),
        values,
        record(
            status=status,
            failure=row[-1],
            until_s=float(until),
            metrics=numbers,
            kept=dict.fromkeys(row[-2].split(), False),
            method=method,
        ),
    )


def _value(text: str) -> Any:
    """Return the value that `cell` has written as a text."""
    try:
        return json.loads(text)
    except ValueError:
        return text
