"""How far a report is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from ..report import Done
from .console import err, out

# Time between two lines about the progress where there is no terminal [s].
_TELL_AGAIN = 30.0


@contextmanager
def report_progress() -> Iterator[Done]:
    """Show how many parts have ended; lines from time to time where there is no terminal."""
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
            err.print(f"report: {ended} of {total} {what} have ended")

    return done
