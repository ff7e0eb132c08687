"""The table of a campaign: one line for each row, in order, reproducible to the last bit."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..measures import METRIC_NAMES
from ..runs.whole_file import written_whole
from .outcome import Outcome
from .plan import PlannedRow


@dataclass(frozen=True)
class Line:
    """A row of a campaign that has ended.

    Attributes:
        number: Number of the row, from 0.
        values: Values of the varied keys.
        outcome: Outcome of the row's run.
    """

    number: int
    values: dict[str, Any]
    outcome: Outcome


def lines_of(rows: Sequence[PlannedRow], outcomes: Mapping[str, Outcome]) -> list[Line]:
    """Return the lines of the rows that have ended, in the order of the rows.

    Args:
        rows: All rows.
        outcomes: Outcomes by the keys of the orders.
    """
    return [
        Line(row.number, row.values, outcomes[row.order.key])
        for row in rows
        if row.order.key in outcomes
    ]


def metrics_in(lines: Sequence[Line]) -> list[str]:
    """Return the names of the metrics that any line has, in the order of `METRICS`."""
    found = {name for line in lines for name in line.outcome.metrics}
    return [name for name in METRIC_NAMES if name in found]


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
    outcomes = [line.outcome for line in lines]
    found = [each.metrics.get(name, nan) if each.status == "complete" else nan for each in outcomes]
    return np.array(found, dtype=float)


def write_table(
    file: Path, keys: Sequence[str], lines: Sequence[Line], metrics: Sequence[str]
) -> None:
    """Write a CSV file: row, varied keys, status, method, time, metrics, bounds not kept.

    Numbers read back bit for bit; lists and mappings are written as JSON.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    try:
        with written_whole(file) as stream:
            writer = csv.writer(stream)
            writer.writerow(
                ["row", *keys, "status", "method", "until_s", *metrics, "not_kept", "failure"]
            )
            writer.writerows(_cells(line, keys, metrics) for line in lines)
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None


def _cells(line: Line, keys: Sequence[str], metrics: Sequence[str]) -> list[Any]:
    found, outcome = line.outcome.metrics, line.outcome
    return [
        line.number,
        *(cell(line.values[key]) for key in keys),
        outcome.status,
        outcome.method,
        repr(outcome.until_s),
        *(repr(found[name]) if name in found else "" for name in metrics),
        " ".join(outcome.not_met),
        outcome.failure,
    ]


def cell(value: Any) -> str:
    """Return a value of a varied key as a text: numbers and texts as they are, others as JSON."""
    return value if isinstance(value, str) else json.dumps(value)
