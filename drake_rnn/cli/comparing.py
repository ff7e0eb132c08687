"""Runs side by side: one table of their metrics, one figure of their errors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..campaigns.sweep import Row, write_csv
from ..errors import InvalidInputError, SimulationError
from ..experiment import Experiment, load_experiment
from ..figures.comparison import comparison_figure
from ..measures import METRICS
from ..runs.result import Result
from ..runs.simulation import check_experiment, simulate
from ..runs.verdict import Verdict
from .completing import complete_experiments
from .console import FAILED, NOT_MET, err, errors, out, progress_bar
from .options import Check, Duration, Out, Seed, Set, changes_of, require_writable, tell_of_window
from .tables import WIDE

# Names that a folder of a comparison is called after.
_NAMED = 3


def compare(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="Names of shipped experiments, YAML files or folders of results.",
            autocompletion=complete_experiments,
        ),
    ],
    out_folder: Out = Path("out"),
    changes: Set = None,
    seed: Seed = None,
    duration: Duration = None,
    check: Check = False,
) -> None:
    """Compare runs; experiments are run first, and their own results are not kept."""
    with errors():
        changed = changes_of(changes, seed, duration)
        loaded = labelled(runs, [_load(run, changed) for run in runs])
        names = list(loaded)
        rest = [f"{len(names) - _NAMED}_more"] if len(names) > _NAMED else []
        stems = [Path(name).name for name in names[:_NAMED]]
        folder = out_folder / "_".join(["compare", *stems, *rest])
        require_writable(folder)
        for run, each in zip(runs, loaded.values(), strict=True):
            if isinstance(each, Experiment):
                tell_of_window(run, changed)
        results = {name: _result(each) for name, each in loaded.items()}
        _print_and_write(results, folder)
    if any(result.status != "complete" for result in results.values()):
        raise typer.Exit(FAILED)
    if check and not all(v.met for result in results.values() for v in result.verdicts):
        raise typer.Exit(NOT_MET)


def _load(run: str, changes: Mapping[str, object]) -> Experiment | Result:
    """Return an experiment that is ready to run, or a result that a folder holds."""
    if not Path(run, "experiment.yaml").is_file():
        experiment = load_experiment(run, changes)
        check_experiment(experiment)
        return experiment
    if changes:
        raise InvalidInputError(f"{next(iter(changes))}: {run} has run already; run it anew")
    return Result.load(run, modules=True)


def labelled(runs: list[str], loaded: list[Experiment | Result]) -> dict[str, Experiment | Result]:
    """Return runs by their experiments' names, or as they were given if names are the same.

    Raises:
        InvalidInputError: If there is only one run, or one is given twice.
    """
    if len(runs) < 2:
        raise InvalidInputError("compare: needs two runs or more")
    if twice := [run for run in runs if runs.count(run) > 1]:
        raise InvalidInputError(f"compare: {twice[0]} is given twice")
    names = [each.experiment.name if isinstance(each, Result) else each.name for each in loaded]
    alike = len(set(names)) < len(names)
    return dict(zip(runs if alike else names, loaded, strict=True))


def _result(run: Experiment | Result) -> Result:
    if isinstance(run, Result):
        return run
    try:
        with progress_bar(run) as progress:
            return simulate(run, progress)
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(f'{run.name}: {error}')}")
        failed: Result = error.result
        return failed


def _print_and_write(results: dict[str, Result], folder: Path) -> None:
    for name, result in results.items():
        for warning in result.warnings:
            err.print(f"[yellow]warning[/] {escape(f'{name}: {warning}')}")
    # In a pipe or a file there is room for all columns.
    (out if out.is_terminal else Console(width=WIDE, highlight=False)).print(
        comparison_table(results)
    )
    rows = [Row((name,), each.metrics, each.failure or None) for name, each in results.items()]
    write_csv(folder / "comparison.csv", ["run"], rows)
    out.print(escape(f"table    {folder / 'comparison.csv'}"), soft_wrap=True)
    if all(result.time.size > 1 for result in results.values()):
        picture = comparison_figure({"": results}, folder / "comparison.png")
        out.print(escape(f"picture  {picture}"), soft_wrap=True)


def comparison_table(results: Mapping[str, Result]) -> Table:
    """Return a table with a column for each run: its metrics, and the bounds they should keep."""
    table = Table(box=SIMPLE_HEAD)
    table.add_column("metric", overflow="fold")
    for name in results:
        table.add_column(escape(name), justify="right", overflow="fold")
    verdicts = {
        name: {verdict.metric: verdict for verdict in result.verdicts}
        for name, result in results.items()
    }
    for metric in METRICS:
        cells = [
            _cell(result.metrics.get(metric.name), verdicts[name].get(metric.name))
            for name, result in results.items()
        ]
        if any(cells):
            table.add_row(metric.name, *cells)
    return table


def _cell(value: float | None, verdict: Verdict | None) -> str:
    """Return a value, and in brackets its bound, which is said not to be kept if it is not."""
    if verdict is None:
        return "" if value is None else f"{value:.4g}"
    written = "not reached" if value is None else f"{value:.4g}"
    if verdict.met:
        return f"{written} ({verdict.bound})"
    return f"{written} [red](not {escape(str(verdict.bound))})[/]"
