"""Tables on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from .experiment import Experiment, load_experiment, shipped_experiments
from .result import Result
from .sweep import Row


def experiments_table() -> Table:
    """The shipped experiments."""
    table = Table(box=SIMPLE_HEAD)
    for column in ("name", "paper", "arm", "law", "level", "what to expect"):
        table.add_column(column, overflow="fold", no_wrap=column in {"name", "arm"})
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
        expected = experiment.accept.get(name)
        verdict = "" if expected is None else ("ok" if expected.holds(value) else "[red]no[/]")
        bound = str(expected) if expected is not None else bounds.get(name, "")
        table.add_row(name, f"{value:.4g}", bound, verdict)
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
        cells = values if row.failure is None else [f"[red]{escape(row.failure)}[/]"]
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
        found = [row.metrics[name] for row in rows if name in row.metrics and row.failure is None]
        # Equal but for rounding is equal.
        differ = found and max(found) - min(found) > 1e-9 * max(map(abs, found))
        if found and (differ or len(rows) == 1):
            chosen.append(name)
    return chosen


def _bounds(experiment: Experiment) -> dict[str, str]:
    limits = experiment.setup.limits
    bounds = {"joint_limit_margin_min_rad": ">= 0"}
    for order, name in (("velocity", "rad_s"), ("acceleration", "rad_s2")):
        bound = getattr(limits, order)
        if bound is not None:
            low, high = float(bound.min()), float(bound.max())
            span = f"{high:g}" if low == high else f"{low:g} .. {high:g}"
            bounds[f"joint_{order}_max_{name}"] = f"<= {span}"
            bounds[f"limit_ratio_{1 if order == 'velocity' else 2}_max"] = "<= 1"
    return bounds
