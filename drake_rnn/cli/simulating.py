"""Running one experiment, with a progress bar on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import InterruptedRunError, SimulationError
from ..experiment import Experiment
from ..runs.checkpoint import Checkpoint
from ..runs.result import Result
from ..runs.simulation import Progress as ProgressCallback
from ..runs.simulation import resume, simulate
from ..runs.stored import Series
from .console import err, out


class InterruptedAfterItsLastStep(KeyboardInterrupt):
    """A run that was told to end when nothing was left to simulate.

    Attributes:
        result: The result of the whole run.
    """

    def __init__(self, result: Result) -> None:
        super().__init__("interrupted")
        self.result = result


def simulated(
    experiment: Experiment,
    bar: bool = True,
    *,
    anyway: bool = False,
    series: Series = "full",
    keep: Path | None = None,
) -> Result:
    """Return the result of an experiment; up to its failure, which is printed, if it fails.

    Raises:
        InterruptedAfterItsLastStep: If that is when it is interrupted.
    """
    return _shown(
        experiment,
        lambda progress: simulate(experiment, progress, anyway=anyway, series=series, keep=keep),
        bar,
    )


def resumed(since: Checkpoint) -> Result:
    """Return the result of a run that goes on, as `simulated` does."""
    return _shown(since.experiment, lambda progress: resume(since, progress))


def _shown(
    experiment: Experiment, make: Callable[[ProgressCallback | None], Result], bar: bool = True
) -> Result:
    try:
        with _progress_bar(experiment, bar) as progress:
            return make(progress)
    except SimulationError as error:
        failed: Result = error.result
        if isinstance(error, InterruptedRunError) and failed.status != "interrupted":
            raise InterruptedAfterItsLastStep(failed) from None
        err.print(f"[red]failed[/] {escape(f'{experiment.name}: {error}')}")
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
        began: list[float] = []

        def progress(t: float) -> None:
            # A run that goes on begins later.
            since, at = began or (t, perf_counter())
            began[:] = since, at
            speed = (t - since) / max(perf_counter() - at, 1e-9)
            bar.update(task, completed=t, speed=f"{speed:.1f} x real time")

        yield progress
