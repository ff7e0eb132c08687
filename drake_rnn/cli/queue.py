"""Experiments that are run and written, one after another or several at a time.

- What a command will do, and what it has done, for people and for scripts.
- Running one experiment, with a progress bar on a terminal.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import takewhile
from multiprocessing import active_children
from pathlib import Path
from time import perf_counter
from typing import Any, cast

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import DrakeRnnError, InterruptedRunError, SimulationError
from ..experiment import Experiment, load_experiment
from ..jobs.pool import Processes
from ..runs.checkpoint import Checkpoint, can_go_on
from ..runs.folder import claimed, require_fillable
from ..runs.result import Result
from ..runs.series import Series
from ..runs.simulation import Effort, effort_of, resume, simulate
from ..runs.simulation import Progress as ProgressCallback
from .changing import tell_of_window
from .console import err, errors, out, sentence_of
from .saving import Pictures, going_on, kept_without_pictures, write_result


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


@dataclass(frozen=True)
class Task:
    """A run that is asked for, as plain data.

    Attributes:
        experiment: Name or file of the experiment.
        name: Its name.
        changes: Changes of its document, by dotted key.
        folder: Folder for the result.
        pictures: What is made of the result to look at.
        anyway: Whether it may take as many steps as it likes.
        series: What of the series is stored.
    """

    experiment: str
    name: str
    changes: Mapping[str, Any]
    folder: Path
    pictures: Pictures
    anyway: bool
    series: Series


@dataclass(frozen=True)
class Outcome:
    """What came out of a task.

    Attributes:
        name: Name of the experiment.
        folder: Folder of the result.
        record: What ``run.json`` holds.
        metrics: Metrics of the run.
    """

    name: str
    folder: Path
    record: dict[str, Any]
    metrics: dict[str, float]

    @property
    def complete(self) -> bool:
        """Whether the run came to its end and was written."""
        return bool(self.record["status"] == "complete")

    @property
    def met(self) -> bool:
        """Whether all bounds that the run is expected to keep are kept."""
        return all(verdict["met"] for verdict in self.record["accept"].values())


#: A task in another process: its outcome, and what was said and complained of.
_Apart = Future[tuple[Outcome, str, str]]
# Time after which a process is interrupted again, in case it was not ready [s].
_AGAIN = 0.5


def run_in_turn(
    tasks: Sequence[Task], experiments: Sequence[Experiment], ahead: int = 0
) -> list[Outcome]:
    """Run tasks one after another, until one is interrupted.

    Args:
        tasks: The tasks.
        experiments: The experiments that they name.
        ahead: Number of tasks whose paths are shown beside those of the others.
    """
    outcomes: list[Outcome] = []
    shown: list[Result] = []
    for task, experiment in zip(tasks, experiments, strict=True):
        with errors(), _naming(tasks[len(outcomes) + 1 :]):
            beside = shown if len(outcomes) >= ahead else []
            result = _perform(task, experiment, beside)
        if len(outcomes) < ahead:
            shown.append(result)
        outcomes.append(Outcome(task.name, task.folder, result.record, result.metrics))
        if result.status == "interrupted":
            break
    return outcomes


def go_on(folder: Path, pictures: Pictures) -> Outcome:
    """Go on with the run of a folder that was stopped."""
    with errors(), claimed(folder):
        since = Checkpoint.load(folder)
        require_fillable(folder)
        result = _written(lambda: resumed(since), folder, pictures)
    return Outcome(result.experiment.name, folder, result.record, result.metrics)


@contextmanager
def _naming(left: Sequence[Task]) -> Iterator[None]:
    """Add to an interrupt what is not run because of it."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        said = str(interrupt) or "interrupted"
        named = f"; not run: {', '.join(task.name for task in left)}" if left else ""
        raise KeyboardInterrupt(said + named) from None


def run_at_once(tasks: Sequence[Task], jobs: int) -> list[Outcome]:
    """Run tasks in processes of their own, until one is interrupted; print each when it is due.

    Args:
        tasks: The tasks.
        jobs: Number of processes.
    """
    outcomes: list[Outcome] = []
    futures: list[_Apart] = []
    workers = Processes(jobs, deaf=False)
    try:
        for task in tasks:
            # What is handed over cannot be taken back, so only what can begin is.
            if len(running := [each for each in futures if not each.done()]) >= jobs:
                wait(running, return_when=FIRST_COMPLETED)
            outcomes += _due(tasks, futures, len(outcomes))
            handle = workers.submit(_perform_apart, task, out.width, out.quiet)
            futures.append(cast("_Apart", handle))
        while len(outcomes) < len(futures):
            wait(futures[: len(outcomes) + 1])
            outcomes += _due(tasks, futures, len(outcomes))
    except KeyboardInterrupt:
        _interrupt(futures)
        # A process that has not begun has nothing to keep, and has ended at once.
        outcomes += [
            _told(task, future)
            for task, future in zip(tasks[len(outcomes) :], futures[len(outcomes) :], strict=False)
            if future.exception() is None
        ]
    finally:
        workers.stop()
    return outcomes


def _due(tasks: Sequence[Task], futures: Sequence[_Apart], told: int) -> list[Outcome]:
    """Return and tell of the next tasks as far as they are done, if none was interrupted."""
    due: list[Outcome] = []
    for task, future in zip(tasks[told:], takewhile(Future.done, futures[told:]), strict=False):
        due.append(_told(task, future))
        if due[-1].record["status"] == "interrupted":
            raise KeyboardInterrupt
    return due


def _interrupt(futures: Sequence[_Apart]) -> None:
    """Interrupt the tasks that are being run, and wait until they have written what they had."""
    while wait(futures, timeout=_AGAIN).not_done:
        for child in active_children():
            if child.pid is not None:
                os.kill(child.pid, signal.SIGINT)


def _told(task: Task, future: _Apart) -> Outcome:
    try:
        outcome, said, complained = future.result()
    except BrokenExecutor:
        failure = "its process was killed, perhaps for want of memory"
        err.print(f"[red]failed[/] {escape(f'{task.name}: {failure}')}")
        record = {"status": "failed", "failure": failure, "accept": {}}
        return Outcome(task.name, task.folder, record, {})
    sys.stdout.write(said)
    sys.stderr.write(complained)
    return outcome


def _interrupt_once(number: int, frame: Any) -> None:
    # A second signal must not cut the writing of what the first one has left.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def _perform_apart(task: Task, width: int, quiet: bool) -> tuple[Outcome, str, str]:
    """Perform a task in this process; return what came out, and what was said meanwhile."""
    out.width, out.quiet = width, quiet
    signal.signal(signal.SIGINT, _interrupt_once)
    outcome = Outcome(task.name, task.folder, {"status": "interrupted", "accept": {}}, {})
    with out.capture() as told, err.capture() as complained:
        try:
            with claimed(task.folder):
                experiment = load_experiment(task.experiment, task.changes)
                result = _perform(task, experiment, (), bar=False)
            outcome = Outcome(task.name, task.folder, result.record, result.metrics)
        except KeyboardInterrupt as interrupt:
            said = str(interrupt) or "interrupted"
            err.print(f"[red]failed[/] {escape(f'{task.name}: {said}')}")
        except (DrakeRnnError, OSError) as error:
            failure = sentence_of(error)
            err.print(f"[red]error[/] {escape(f'{task.name}: {failure}')}")
            record = {"status": "failed", "failure": failure, "accept": {}}
            outcome = Outcome(task.name, task.folder, record, {})
        finally:
            # A process without a task has nothing to keep.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    return outcome, told.get(), complained.get()


def _perform(
    task: Task, experiment: Experiment, beside: Sequence[Result], bar: bool = True
) -> Result:
    tell_of_window(task.experiment, task.changes)
    return _written(
        lambda: simulated(
            experiment, bar, anyway=task.anyway, series=task.series, keep=task.folder
        ),
        task.folder,
        task.pictures,
        beside,
    )


def _written(
    run: Callable[[], Result], folder: Path, pictures: Pictures, beside: Sequence[Result] = ()
) -> Result:
    """Make a run and write its result.

    Raises:
        KeyboardInterrupt: If it is interrupted after the last step; it says where the result is, or
            how to go on to it.
    """
    try:
        result = run()
        write_result(result, folder, pictures, beside)
    except InterruptedAfterItsLastStep as interrupt:
        write_result(interrupt.result, folder, Pictures(figures=False, playback=False))
        raise KeyboardInterrupt(kept_without_pictures(folder)) from None
    except KeyboardInterrupt as interrupt:
        if str(interrupt) or not can_go_on(folder):
            raise
        raise KeyboardInterrupt(f"interrupted; {going_on(folder)}") from None
    return result


def print_data(contents: Any) -> None:
    """Print plain data as JSON, with null for numbers that are not finite, which it has not."""
    typer.echo(json.dumps(_finite(contents), indent=2))


def print_plan(
    tasks: Sequence[Task],
    experiments: Sequence[Experiment],
    warnings: Sequence[Sequence[str]],
    as_json: bool,
) -> None:
    """Print what would be run, what it may take and what it warns of.

    Args:
        tasks: What would be run.
        experiments: The experiments that the tasks name.
        warnings: Warnings about each of them.
        as_json: Whether to print one JSON object, by name.
    """
    plan: dict[str, Any] = {}
    for task, experiment, complaints in zip(tasks, experiments, warnings, strict=True):
        effort = effort_of(experiment.document)
        plan[task.name] = {
            "folder": str(task.folder),
            "duration_s": experiment.document.duration,
            "steps": effort.steps if effort.key else None,
            "expected_time_s": effort.time if effort.key else None,
            "warnings": list(complaints),
        }
        tell_of_window(task.experiment, task.changes)
        for complaint in complaints:
            err.print(f"[yellow]warning[/] {escape(f'{task.name}: {complaint}')}")
        out.print(escape(f"{task.name}: {told_of(effort)}; {task.folder}"), soft_wrap=True)
    if as_json:
        print_data(plan)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def told_of(effort: Effort) -> str:
    """Return in words what a run is expected to take."""
    if not effort.key:
        return "the integrator chooses its steps, so there is no estimate"
    return (
        f"{effort.steps:.3g} steps of {effort.key} {effort.step:g} s, about {effort.time:.2g} s "
        "without figures and playback"
    )
