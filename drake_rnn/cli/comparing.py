"""Runs side by side: one table of their metrics, one figure of their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import typer
from rich.markup import escape

from ..campaigns.sweep import Row, write_csv
from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..figures import drawn_for
from ..figures.comparison import comparison_figure
from ..inputs.complaints import drawn_of
from ..inputs.given_file import is_file
from ..measures import METRIC_NAMES
from ..runs.effort import effort_of
from ..runs.result import Result
from ..runs.simulation import check_experiment
from ..runs.verdict import Verdict
from ..tables import Cell, Column, Heading, Sheet, metric_heading
from .announcing import print_data, told_of
from .asked import Compare
from .changing import changes_of, claimed_folder, tell_of_window
from .console import err, errors, finish, out, print_whole, silenced
from .printed import paper_of
from .simulating import simulated
from .statuses import INTERRUPTED
from .written_tables import chosen_metrics, listed, require_tables, shown, write_tables

# Names that a folder of a comparison is called after.
_NAMED = 3

Run = TypeVar("Run", Result, Experiment | Result)


def compare(asked: Compare) -> None:
    """Compare runs, of which experiments are run first."""
    with silenced(asked.quiet or asked.as_json), errors():
        require_tables(asked.tables)
        metrics = chosen_metrics(asked.metrics)
        paper_of(asked)
        changed = changes_of(asked.changes, asked.seed, asked.duration)
        loaded = labelled(asked.runs, [_load(run, changed) for run in asked.runs])
        folder = asked.out_folder / compared_folder(list(loaded))
        loaded = relabelled(loaded, asked.labels)
        for run, each in zip(asked.runs, loaded.values(), strict=True):
            if isinstance(each, Experiment):
                tell_of_window(run, changed)
        if asked.dry_run:
            _print_plan(loaded, folder, asked.as_json)
            return
        with claimed_folder(folder, "comparison.csv", f"comparison.{asked.form}"):
            results = _results(loaded)
            _print_and_write(results, folder, comparison_sheet(results, metrics), asked)
        if asked.as_json:
            print_data({name: {"metrics": r.metrics, **r.record} for name, r in results.items()})
    finish(
        all(result.status == "complete" for result in results.values()),
        not asked.check or all(v.met for result in results.values() for v in result.verdicts),
    )


def compared_folder(names: list[str]) -> str:
    """Return the name of the folder of a comparison."""
    rest = [f"{len(names) - _NAMED}_more"] if len(names) > _NAMED else []
    return "_".join(["compare", *(Path(name).name for name in names[:_NAMED]), *rest])


def _print_plan(loaded: Mapping[str, Experiment | Result], folder: Path, as_json: bool) -> None:
    plan: dict[str, float | None] = {}
    for name, each in loaded.items():
        if isinstance(each, Result):
            plan[name], told = 0.0, "has run"
        else:
            effort = effort_of(each.document)
            plan[name], told = effort.time if effort.key else None, told_of(effort)
        out.print(escape(f"{name}: {told}"), soft_wrap=True)
    out.print(escape(f"compared in {folder}"), soft_wrap=True)
    if as_json:
        print_data({"folder": str(folder), "expected_time_s": plan})


def _load(run: str, changes: Mapping[str, object]) -> Experiment | Result:
    """Return an experiment that is ready to run, or a result that a folder holds."""
    if not is_file(Path(run, "experiment.yaml")):
        experiment = load_experiment(run, changes)
        check_experiment(experiment)
        return experiment
    if changes:
        raise InvalidInputError(
            f"{next(iter(changes))}: {run} is a saved result, which cannot be changed"
        )
    return Result.load(run, modules=True)


def labelled(runs: list[str], loaded: list[Run]) -> dict[str, Run]:
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


def relabelled(loaded: Mapping[str, Run], labels: str | None) -> dict[str, Run]:
    """Return runs by the names of ``--labels``, or as they are without it.

    Raises:
        InvalidInputError: If there are not as many names as runs, or two are the same.
    """
    names = list(loaded) if labels is None else listed(labels)
    if len(names) != len(loaded):
        raise InvalidInputError(
            f"--labels: must have one name for each of {len(loaded)} runs, not {len(names)}"
        )
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInputError(f"--labels: {twice[0]!r} is given twice")
    return dict(zip(names, loaded.values(), strict=True))


def _results(loaded: Mapping[str, Experiment | Result]) -> dict[str, Result]:
    """Return the results by name; leave the command if a run is interrupted."""
    results: dict[str, Result] = {}
    for name, each in loaded.items():
        results[name] = each if isinstance(each, Result) else simulated(each)
        if each is not results[name] and results[name].status == "interrupted":
            if left := list(loaded)[len(results) :]:
                err.print(f"[red]not run[/] {escape(', '.join(left))}")
            raise typer.Exit(INTERRUPTED)
    return results


def _print_and_write(
    results: dict[str, Result], folder: Path, sheet: Sheet, asked: Compare
) -> None:
    for name, result in results.items():
        for warning in result.warnings:
            err.print(f"[yellow]warning[/] {escape(f'{name}: {warning}')}")
    print_whole(shown(sheet))
    rows = [Row((name,), each.metrics, each.failure or None) for name, each in results.items()]
    write_csv(folder / "comparison.csv", ["run"], rows)
    out.print(escape(f"table    {folder / 'comparison.csv'}"), soft_wrap=True)
    write_tables(sheet, asked.tables)
    if all(result.time.size > 1 for result in results.values()):
        paper = paper_of(asked)
        with drawn_for(paper), drawn_of("comparison"):
            picture = comparison_figure({"": results}, folder / f"comparison.{paper.form}")
        out.print(escape(f"picture  {picture}"), soft_wrap=True)


def comparison_sheet(results: Mapping[str, Result], metrics: Sequence[str] = ()) -> Sheet:
    """Return a table with a column for each run: its metrics, and the bounds they should keep.

    Args:
        results: The runs by the names that they are called by.
        metrics: Names of the metrics, in their order; by default all that any run has.
    """
    verdicts = {
        name: {verdict.metric: verdict for verdict in result.verdicts}
        for name, result in results.items()
    }
    runs = tuple(Column(Heading(name), right=True) for name in results)
    sheet = Sheet((Column(Heading("metric")), *runs))
    for metric in metrics or METRIC_NAMES:
        cells = [
            _cell(result.metrics.get(metric), verdicts[name].get(metric))
            for name, result in results.items()
        ]
        if any(cells) or metrics:
            sheet.rows.append((metric_heading(metric), *cells))
    return sheet


def _cell(value: float | None, verdict: Verdict | None) -> Cell | str:
    """Return a value with its bound; an empty text without either."""
    if value is None and verdict is None:
        return ""
    numbers, form = ((), "not reached") if value is None else ((value,), "{}")
    if verdict is None:
        return Cell(numbers, form)
    return Cell(numbers, form, str(verdict.bound), verdict.met)
