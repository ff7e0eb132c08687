"""Tables on a terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from typing import Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..experiment import (
    Acceptance,
    Experiment,
    ExperimentDocument,
    read_document,
    shipped_experiments,
)
from ..inputs.documents import construct
from ..measures import shown_in
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.result import Result
from ..runs.sweep import Row

#: Of a console on which nothing is squeezed [characters].
WIDE = 10_000
#: Of a sweep's columns of metrics, in whose names a line ends there, and of swept values.
_HEADER, _VALUE = 13, 40


def experiments_table() -> Table:
    """Return a table of the shipped experiments, law by law."""
    # Documents only: one of them is there to be refused.
    documents = [
        construct(ExperimentDocument, read_document(name), name) for name in shipped_experiments()
    ]
    documents.sort(key=lambda document: (str(document.law["kind"]), document.name))
    table = Table(box=SIMPLE_HEAD)
    for column in ("law", "name", "paper", "arm", "level", "what to expect"):
        table.add_column(column, overflow="fold", no_wrap=column in {"name", "arm", "law"})
    for kind, group in groupby(documents, key=lambda document: str(document.law["kind"])):
        for number, document in enumerate(group):
            arm = document.arm
            table.add_row(
                kind if number == 0 else "",
                document.name,
                document.paper,
                arm if isinstance(arm, str) else str(arm["model"]),
                document.level,
                document.expect,
            )
        table.add_section()
    return table


def metrics_table(result: Result) -> Table:
    """A run's metrics beside what is expected of them and the bounds that were to hold."""
    experiment = result.experiment
    bounds = _bounds(experiment)
    table = Table(box=SIMPLE_HEAD, title=escape(experiment.name))
    table.add_column("metric", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("bound", justify="right")
    table.add_column("")
    for name, value in result.metrics.items():
        expected = experiment.document.accept.get(name, bounds.get(name))
        verdict = "" if expected is None else ("ok" if expected.holds(value) else "[red]no[/]")
        table.add_row(name, f"{value:.4g}", "" if expected is None else str(expected), verdict)
    for name in experiment.document.accept:
        if name not in result.metrics:
            table.add_row(name, "not reached", str(experiment.document.accept[name]), "[red]no[/]")
    return table


def joints_table(result: Result) -> Table | None:
    """Joint by joint, how near a run has come to its target posture; None if it had none."""
    experiment = result.experiment
    if experiment.target is None or result.time.size == 0:
        return None
    table = Table(box=SIMPLE_HEAD)
    for column in ("joint", "start [rad]", "target [rad]", "end [rad]", "|error| [rad]"):
        side: Literal["left", "right"] = "left" if column == "joint" else "right"
        table.add_column(escape(column), no_wrap=True, justify=side)
    end, error = result.series["position"][-1], result.series["joint_error"][-1]
    for name, *values, off in zip(
        experiment.arm.joints, experiment.start, experiment.target, end, error, strict=True
    ):
        table.add_row(escape(name), *(f"{value:.6g}" for value in values), f"{abs(off):.4e}")
    return table


def sweep_tables(keys: Sequence[str], rows: Sequence[Row], width: int | None = None) -> list[Table]:
    """One row for each run of a sweep, with the metrics that differ between runs.

    What is wider than ``width`` characters goes on in another table: a number is never broken,
    and a name only behind an underscore. To be printed on a `WIDE` console, as one column may
    be too wide by itself.
    """
    tables, names = [], varying_metrics(rows)
    while True:
        count = len(names)
        while width is not None and count > 1 and _width(keys, rows, names[:count]) > width:
            count -= 1
        tables.append(_sweep_table(keys, rows, names[:count]))
        names = names[count:]
        if not names:
            return tables


def _width(keys: Sequence[str], rows: Sequence[Row], names: Sequence[str]) -> int:
    """Of a table that nothing squeezes, in characters."""
    console = Console(width=WIDE)
    return console.measure(_sweep_table(keys, rows, names)).maximum


def _sweep_table(keys: Sequence[str], rows: Sequence[Row], names: Sequence[str]) -> Table:
    table = Table(box=SIMPLE_HEAD)
    for key in keys:
        # A value may be a list of any length.
        table.add_column(escape(key), overflow="fold", max_width=_VALUE)
    for name in names:
        table.add_column(_broken(name), justify="right", no_wrap=True)
    for row in rows:
        values = [f"{row.metrics[n]:.4g}" if n in row.metrics else "-" for n in names]
        # Why has been said when it failed, and stands in the CSV.
        cells = values if row.failure is None else ["[red]failed[/]"]
        table.add_row(*(escape(str(value)) for value in row.values), *cells)
    return table


def _broken(name: str) -> str:
    """In lines of some characters, if it has underscores to break it behind."""
    lines = [""]
    for part in re.findall("[^_]*_|[^_]+", name):
        if lines[-1] and len(lines[-1] + part) > _HEADER:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


_ARRIVAL = "joint_error_max_rad"


def varying_metrics(rows: Sequence[Row]) -> list[str]:
    """The metrics worth a column: of the main ones those that differ between the runs."""
    chosen = []
    for name in shown_in("sweep"):
        ran = [row for row in rows if row.failure is None]
        # Along a path the end effector is meant to leave its start.
        if name == "end_effector_drift_max_m" and not any(_ARRIVAL in r.metrics for r in ran):
            continue
        found = [row.metrics[name] for row in ran if name in row.metrics]
        # Equal but for rounding is equal.
        differ = found and max(found) - min(found) > 1e-9 * max(map(abs, found))
        if found and (differ or len(ran) == 1):
            chosen.append(name)
    return chosen


def _bounds(experiment: Experiment) -> dict[str, Acceptance]:
    """What the arm's limits ask of the metrics; one joint's bound may differ from another's."""
    limits = experiment.limits
    bounds = {}
    if np.isfinite(limits.position_upper - limits.position_lower).any():
        bounds["joint_limit_margin_min_rad"] = Acceptance(at_least=0.0)
    # A secant around the bound carries rounding errors.
    for order, name in enumerate(DERIVATIVE_UNITS, start=1):
        if limits.bounds[name] is not None:
            bounds[f"limit_ratio_{order}_max"] = Acceptance(at_most=1.0 + 1e-9)
    return bounds
