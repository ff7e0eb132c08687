"""Running one experiment, with a progress bar on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import SimulationError
from ..experiment import Experiment
from ..runs.result import Result
from ..runs.simulation import Progress as ProgressCallback
from ..runs.simulation import simulate
from ..runs.stored import Series
from .console import err, out


def simulated(
    experiment: Experiment, bar: bool = True, *, anyway: bool = False, series: Series = "full"
) -> Result:
    """Return the result of an experiment; up to its failure, which is printed, if it fails."""
    try:
        with _progress_bar(experiment, bar) as progress:
            return simulate(experiment, progress, anyway=anyway, series=series)
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(f'{experiment.name}: {error}')}")
        failed: Result = error.result
        return failed


@contextmanager
def _progress_bar(experiment: Experiment, shown: bool) -> Iterator[ProgressCallback | None]:
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
