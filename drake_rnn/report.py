"""Tables on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from .experiment import Acceptance, Experiment, load_experiment, shipped_experiments
from .result import Result
from .sweep import Row


def experiments_table() -> Table:
    """The shipped experiments."""
    table = Table(box=SIMPLE_HEAD)
    for column in ("name", "paper", "arm", "law", "level", "what to expect"):
        table.add_column(column, overflow="fold", no_wrap=column in {"name", "arm", "law"})
    for name in shipped_experiments():
        experiment = load_experiment(name)
        table.add_row(
            name,
            experiment.paper,
            experiment.setup.arm.name,
            str(experiment.law["kind"]),
            experiment.level,
            experiment.expect,
        )
    return table


def metrics_table(result: Result) -> Table:
    """A run's metrics beside what is expected of them and the bounds that were to hold."""
    experiment = result.experiment
    bounds = _bounds(experiment)
    table = Table(box=SIMPLE_HEAD, title=escape(experiment.name))
    table.add_column("metric", no_wrap=True)
    table.add_column("value", justify="right")
    table.add_column("bound", justify="right")
    table.add_column("")
    for name, value in result.metrics.items():
        expected = experiment.accept.get(name, bounds.get(name))
        verdict = "" if expected is None else ("ok" if expected.holds(value) else "[red]no[/]")
        table.add_row(name, f"{value:.4g}", "" if expected is None else str(expected), verdict)
    for name in experiment.accept:
        if name not in result.metrics:
            table.add_row(name, "not reached", str(experiment.accept[name]), "[red]no[/]")
    return table


def sweep_table(keys: Sequence[str], rows: Sequence[Row]) -> Table:
    """One row for each run of a sweep, with the metrics that differ between runs."""
    table = Table(box=SIMPLE_HEAD)
    for key in keys:
        table.add_column(key, no_wrap=True)
    names = varying_metrics(rows)
    for name in names:
        table.add_column(name.replace("_", " "), justify="right", overflow="fold")
    for row in rows:
        values = [f"{row.metrics[n]:.4g}" if n in row.metrics else "-" for n in names]
        # Why has been said when it failed, and stands in the CSV.
        cells = values if row.failure is None else ["[red]failed[/]"]
        table.add_row(*(escape(str(value)) for value in row.values), *cells)
    return table


#: What a sweep shows on a terminal, where there is room for a few; the CSV has all.
_SHOWN = (
    "position_error_max_m",
    "position_error_rms_m",
    "settling_time_s",
    "joint_acceleration_max_rad_s2",
    "network_acceleration_max_rad_s2",
    "joint_drift_max_rad",
    "jacobian_error_median",
    "saturated_fraction",
)


def varying_metrics(rows: Sequence[Row]) -> list[str]:
    """The metrics worth a column: of the main ones those that differ between the runs."""
    chosen = []
    for name in _SHOWN:
        ran = [row for row in rows if row.failure is None]
        found = [row.metrics[name] for row in ran if name in row.metrics]
        # Equal but for rounding is equal.
        differ = found and max(found) - min(found) > 1e-9 * max(map(abs, found))
        if found and (differ or len(ran) == 1):
            chosen.append(name)
    return chosen


def _bounds(experiment: Experiment) -> dict[str, Acceptance]:
    """What the arm's limits ask of the metrics; one joint's bound may differ from another's."""
    limits = experiment.setup.limits
    bounds = {}
    if np.isfinite(limits.position_upper - limits.position_lower).any():
        bounds["joint_limit_margin_min_rad"] = Acceptance(at_least=0.0)
    # A secant around the bound carries rounding errors.
    for order, name in enumerate(("velocity", "acceleration"), start=1):
        if getattr(limits, name) is not None:
            bounds[f"limit_ratio_{order}_max"] = Acceptance(at_most=1.0 + 1e-9)
    return bounds
