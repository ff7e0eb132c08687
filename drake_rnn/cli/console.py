"""What every command prints to, and how it ends."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import DrakeRnnError, SimulationError
from ..experiment import Experiment
from ..runs.simulation import Progress as ProgressCallback

# Width of tables in a pipe or a file [characters].
_WIDTH = None if sys.stdout.isatty() else 140
out = Console(width=_WIDTH, soft_wrap=False, highlight=False)
err = Console(stderr=True, soft_wrap=True, highlight=False)

#: Exit statuses.
FAILED, BAD_INPUT, NOT_MET = 1, 2, 3


@contextmanager
def errors() -> Iterator[None]:
    """Turn this package's errors into a message and an exit status, without a traceback."""
    try:
        yield
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(str(error))}")
        raise typer.Exit(FAILED) from error
    except (DrakeRnnError, OSError) as error:
        err.print(f"[red]error[/] {escape(str(error))}")
        raise typer.Exit(BAD_INPUT) from error


@contextmanager
def silenced(quiet: bool) -> Iterator[None]:
    """Print nothing but warnings and errors, if that is asked for."""
    before, out.quiet = out.quiet, quiet
    try:
        yield
    finally:
        out.quiet = before


@contextmanager
def status(text: str) -> Iterator[None]:
    """Show on a terminal what takes its time; nothing elsewhere."""
    if not err.is_terminal or out.quiet:
        yield
        return
    with err.status(escape(text)):
        yield


@contextmanager
def progress_bar(experiment: Experiment, shown: bool = True) -> Iterator[ProgressCallback | None]:
    """Show a progress bar on a terminal if it is to be shown, nothing elsewhere."""
    if not shown or not err.is_terminal or out.quiet:
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} / {task.total:g} s"),
        TextColumn("{task.fields[speed]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(experiment.name, total=experiment.document.duration, speed="")
        began = perf_counter()

        def progress(t: float) -> None:
            speed = t / max(perf_counter() - began, 1e-9)
            bar.update(task, completed=t, speed=f"{speed:.1f} x real time")

        yield progress
