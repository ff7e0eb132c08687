"""The report of the papers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..report import Done, Format, ReportSettings, make_report
from ..report import Report as Made
from .asked import Report
from .changing import require_writable
from .claims import VERDICT_COLOURS, chosen_claims
from .console import err, errors, finish, out, print_table, silenced

# Time between two lines about the progress where there is no terminal [s].
_TELL_AGAIN = 30.0


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
            with _progress() as done:
                made = make_report(chosen, asked.folder, settings, done)
        _tell(made, asked.form)
    finish(made.complete and not made.failures, True)


def _tell(made: Made, form: Format) -> None:
    if made.contents:
        print_table(verdicts_table(made))
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


@contextmanager
def _progress() -> Iterator[Done]:
    """Show how many parts are finished; without a terminal, by a line from time to time."""
    if not err.is_terminal or out.quiet:
        yield _lines()
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), console=err, transient=True) as bar:
        task = bar.add_task("numbers", total=None)

        def done(what: str, ended: int, total: int) -> None:
            # What is measured between two rounds of runs is not counted.
            whole = ended == total
            bar.update(task, description="numbers" if whole else what, completed=ended, total=total)

        yield done


def _lines() -> Done:
    told = perf_counter()

    def done(what: str, ended: int, total: int) -> None:
        nonlocal told
        if perf_counter() - told >= _TELL_AGAIN and not out.quiet:
            told = perf_counter()
            err.print(f"report: {ended} of {total} {what} finished")

    return done
