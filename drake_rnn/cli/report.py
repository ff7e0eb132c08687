"""The report of the papers."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..report import Format, ReportSettings, make_report
from ..report import Report as Made
from .asked import Report
from .changing import require_writable
from .claims import VERDICT_COLOURS, chosen_claims
from .console import err, errors, finish, out, silenced
from .report_progress import report_progress


def report(asked: Report) -> None:
    """Judge the papers' claims, and write what came out."""
    with silenced(asked.quiet):
        with errors():
            chosen = list(chosen_claims(asked.ids or [], asked.claims))
            require_writable(asked.folder)
            playbacks = asked.pictures and asked.playbacks
            settings = ReportSettings(
                asked.jobs, asked.form, asked.pictures, playbacks, asked.again
            )
            with report_progress() as done:
                made = make_report(chosen, asked.folder, settings, done)
        _tell(made, asked.form)
    finish(made.complete and not made.failures, True)


def _tell(made: Made, form: Format) -> None:
    if made.contents:
        out.print(verdicts_table(made))
        for name, error in made.failures:
            err.print(f"[red]failed[/] {escape(f'{name}: {error}')}")
        out.print(escape(f"report  {made.folder / f'index.{form}'}"), soft_wrap=True)
    if not made.complete:
        err.print("[red]interrupted[/]: run the same command again to continue")


def verdicts_table(made: Made) -> Table:
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
