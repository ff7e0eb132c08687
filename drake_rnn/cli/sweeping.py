"""Sweeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from ..campaigns.sweep import (
    InterruptedSweepError,
    Planned,
    Row,
    parse_axis,
    planned,
    run_planned,
    write_csv,
)
from ..errors import InvalidInputError
from ..experiment import load_experiment, read_document, unit_of_key
from ..figures import drawn_for
from ..figures.paper import current
from ..figures.sweep import learning_figure, sweep_figure
from ..tables import Sheet
from .announcing import print_data
from .asked import Sweep
from .changing import changes_of, claimed_folder, tell_of_window
from .console import WIDE, err, errors, finish, out, silenced
from .printed import paper_of
from .tables import sweep_sheet, sweep_tables, varying_metrics
from .written_tables import chosen_metrics, require_tables, write_tables


def sweep(asked: Sweep) -> None:
    """Run an experiment with several values, and write what came out."""
    experiment = asked.experiment
    with silenced(asked.quiet or asked.as_json), errors():
        require_tables(asked.tables)
        metrics, paper = chosen_metrics(asked.metrics), paper_of(asked)
        changed = changes_of(asked.changes, asked.seed, asked.duration)
        axes = _axes(asked.over) or load_experiment(experiment, changed).document.over
        if not axes:
            raise InvalidInputError(f"--over: must be given; {experiment} has no values of its own")
        keys = list(axes)
        orders = planned(experiment, axes, changed, anyway=asked.anyway)
        document = read_document(experiment, changed)
        units = {key: unit_of_key(document, key) for key in keys}
        folder = asked.out_folder / f"sweep_{Path(experiment).stem}_{'_'.join(keys)}"
        for length in axes.get("duration", [None]):
            swept = {} if length is None else {"duration": length}
            tell_of_window(experiment, changed | swept)
        if asked.dry_run:
            _print_plan(orders, folder, asked)
            return
        names = ("sweep.csv", f"sweep.{paper.form}", f"learning.{paper.form}")
        with claimed_folder(folder, *names):
            rows, missing = _rows(keys, orders, asked.jobs, folder)
            sheet = sweep_sheet(keys, rows, metrics or varying_metrics(rows), units)
            with drawn_for(paper):
                _print_and_write(keys, rows, folder, units, sheet)
        write_tables(sheet, asked.tables)
        if asked.as_json:
            print_data({"folder": str(folder), "runs": [_contents(keys, row) for row in rows]})
        if missing:
            told = "; ".join(_named(keys, values) for values in missing)
            err.print(f"[red]not run[/] {escape(told)}; run the same command again to continue")
    finish(
        not missing and not any(row.failure for row in rows),
        not asked.check or not any(row.not_met for row in rows),
    )


def _rows(
    keys: list[str], orders: Sequence[Planned], jobs: int, folder: Path
) -> tuple[list[Row], list[tuple[Any, ...]]]:
    """Return the rows that have ended, and the values of those that have not."""

    def done(row: Row) -> None:
        if not out.quiet or row.failure:
            err.print(escape(f"{_named(keys, row.values)}: {row.failure or 'done'}"))

    try:
        return run_planned(orders, jobs, done, keep=folder / ".rows"), []
    except InterruptedSweepError as error:
        return error.rows, error.missing


def _print_and_write(
    keys: list[str], rows: list[Row], folder: Path, units: Mapping[str, str], sheet: Sheet
) -> None:
    write_csv(folder / "sweep.csv", keys, rows)
    names = [column.heading.name for column in sheet.columns[len(keys) :]]
    form = current().form
    pictures = [
        sweep_figure(keys, rows, names, folder / f"sweep.{form}", units),
        learning_figure(keys, rows, folder / f"learning.{form}", units),
    ]
    # On a terminal, too: what does not fit beside is in tables of their own.
    wide = Console(width=WIDE, highlight=False, emoji=False, quiet=out.quiet)
    for table in sweep_tables(sheet, len(keys), out.width if out.is_terminal else None):
        wide.print(table)
    out.print(escape(f"table    {folder / 'sweep.csv'}"), soft_wrap=True)
    for picture in filter(None, pictures):
        out.print(escape(f"picture  {picture}"), soft_wrap=True)


def _print_plan(orders: Sequence[Planned], folder: Path, asked: Sweep) -> None:
    time = sum(run.time for run in orders) / asked.jobs
    if asked.as_json:
        print_data({"folder": str(folder), "runs": len(orders), "expected_time_s": time or None})
    told = f"about {time:.2g} s with {asked.jobs} in parallel" if time else "there is no estimate"
    out.print(escape(f"{len(orders)} runs; {told}; {folder}"), soft_wrap=True)


def _contents(keys: list[str], row: Row) -> dict[str, Any]:
    return {
        "values": dict(zip(keys, row.values, strict=True)),
        "metrics": row.metrics,
        "failure": row.failure or "",
        "not_met": list(row.not_met),
    }


def _named(keys: list[str], values: tuple[Any, ...]) -> str:
    return ", ".join(f"{key}={value}" for key, value in zip(keys, values, strict=True))


def _axes(over: list[str] | None) -> dict[str, list[Any]]:
    """Return the values of all ``--over`` options, by key."""
    named = [parse_axis(text) for text in over or []]
    keys = [key for key, _ in named]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InvalidInputError(f"--over: {twice[0]!r} is given twice; give all its values at once")
    return dict(named)
