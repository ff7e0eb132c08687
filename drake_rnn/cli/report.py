"""The report of the papers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..report import Format, Report, ReportSettings, make_report
from .claims import VERDICT_COLOURS, chosen_claims
from .console import FAILED, err, errors, out, silenced
from .options import Jobs, Quiet, require_writable
from .report_progress import report_progress

_CORES = os.cpu_count() or 1


def report(  # noqa: PLR0913  one argument for each option
    ids: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[ID]...",
            help="Claims, e.g. slc-F2a, or papers, e.g. slc or state_adjustment; by default all.",
        ),
    ] = None,
    folder: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the report.")] = (
        Path("out/report")
    ),
    jobs: Jobs = _CORES,
    form: Annotated[Format, typer.Option("--format", help="Pages as html or md.")] = "html",
    pictures: Annotated[bool, typer.Option(help="Draw an overview of each run.")] = True,
    playbacks: Annotated[
        bool, typer.Option(help="Write playbacks of the claims' main runs.")
    ] = True,
    again: Annotated[
        bool, typer.Option("--again", help="Try runs again that failed or cannot be read.")
    ] = False,
    claims: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder with claims files, in place of the shipped ones."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Judge the papers' claims, and write what came out; what has ended is not run again."""
    with silenced(quiet):
        with errors():
            chosen = list(chosen_claims(ids or [], claims))
            require_writable(folder)
            settings = ReportSettings(jobs, form, pictures, pictures and playbacks, again)
            with report_progress() as done:
                made = make_report(chosen, folder, settings, done)
        _tell(made, form)
    if made.failures or not made.complete:
        raise typer.Exit(FAILED)


def _tell(made: Report, form: Format) -> None:
    if made.contents:
        out.print(verdicts_table(made))
        for name, error in made.failures:
            err.print(f"[red]failed[/] {escape(f'{name}: {error}')}")
        out.print(escape(f"report  {made.folder / f'index.{form}'}"), soft_wrap=True)
    if not made.complete:
        err.print("[red]interrupted[/]: the same command goes on from here")


def verdicts_table(made: Report) -> Table:
    """Return a table of how many claims of each paper hold."""
    counts = made.contents["counts"]
    shown = [each for each in counts if each != "failed" or counts[each]]
    table = Table(box=SIMPLE_HEAD, show_footer=len(made.contents["papers"]) > 1)
    table.add_column("paper", footer="all")
    for verdict in shown:
        colour = VERDICT_COLOURS[verdict]
        table.add_column(verdict, justify="right", style=colour, footer=str(counts[verdict]))
    for paper in made.contents["papers"]:
        name = paper["scheme"].replace("_", " ")
        table.add_row(escape(name), *(str(paper["counts"][verdict]) for verdict in shown))
    return table
