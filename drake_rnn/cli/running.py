"""Running experiments, one after another or several at a time, and what commands share of it.

- What options mean for the documents and folders of runs, and what is printed before and after.
- What a terminal shows of many runs on their way.
"""

from __future__ import annotations

import json
import math
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

import typer
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.status import Status

from ..errors import DrakeRnnError, InvalidInputError
from ..experiment import (
    Experiment,
    load_experiment,
    make_experiment,
    read_document,
    watch_planning,
)
from ..inputs.messages import field_names, fields_of
from ..jobs.pool import InOrder, Jobs, Processes, ThisProcess
from ..jobs.requests import RunRecord, RunRequest
from ..playback.arm_drawing import require_looks
from ..runs.checkpoint import Checkpoint
from ..runs.folder import claim_folder, require_fillable
from ..runs.limit_use import check_stretchable, fastest
from ..runs.result import Result
from ..runs.series import RunOptions
from ..runs.simulation import Effort, check_experiment, effort_of
from .arguments import Fastest, Run
from .console import err, errors, finish, out, sentence_of, silence
from .saving import (
    Pictures,
    changes_of,
    claimed_folder,
    resume_or_print,
    run_and_write,
    simulate_or_print,
    tell_of_window,
    write_result,
)


@dataclass(frozen=True)
class WrittenRun(RunRecord):
    """The record of a run whose result was written to the folder of its request.

    Attributes:
        details: What ``run.json`` holds.
        output: What another process printed meanwhile.
        warnings: What it printed to its error stream.
    """

    details: dict[str, Any] = field(default_factory=dict)
    output: str = ""
    warnings: str = ""


def run(args: Run) -> None:
    """Run experiments, one after another or several at a time; or go on with a run."""
    with silence(args.quiet or args.as_json):
        if args.resume is None:
            ran = _begin(args)
        else:
            with errors():
                _require_alone(args)
            ran = _go_on(args.resume, Pictures(args.figures, args.playback))
    if ran is None:
        return
    requests, records = ran
    records_by_key = {each.key: records[each.key] for each in requests if each.key in records}
    if args.as_json:
        print_data(
            {
                each.key: {"folder": str(each.folder), **_contents(records_by_key[each.key])}
                for each in requests
                if each.key in records_by_key
            }
        )
    if left := [each.key for each in requests if each.key not in records_by_key]:
        err.print(f"[red]not run[/] {escape(', '.join(left))}")
    finish(
        not left and all(record.complete for record in records_by_key.values()),
        not args.check or not any(record.not_met for record in records_by_key.values()),
    )


def _contents(record: RunRecord) -> dict[str, Any]:
    """Return what scripts are told of a run: what ``run.json`` holds, as far as it was written."""
    status, failure = record.status, record.failure
    if status == "killed its worker":
        status, failure = "failed", _KILL_REASON
    details = record.details if isinstance(record, WrittenRun) else {}
    unwritten = {"status": status, "failure": failure, "accept": {}}
    return {"metrics": record.metrics, **(details or unwritten)}


def _record_of(result: Result) -> WrittenRun:
    return replace(WrittenRun.of_result(result), details=result.record)


#: Requests by the names of their experiments, and their records by key.
_Ran = tuple[list[RunRequest], dict[str, RunRecord]]


def _begin(args: Run) -> _Ran | None:
    """Run experiments; return requests and records, None if none was to run."""
    first = args.beside or []
    names = [*first, *(args.experiments or [])]
    with errors():
        if not args.experiments:
            raise InvalidInputError("EXPERIMENT: must be given, or a run's folder with --resume")
        if first:
            _require_beside_is_possible(args)
        changes = changes_of(args.changes, args.seed, args.duration)
        experiments = []
        for name in names:
            with name_errors(name, among=names), _planning(name):
                experiments.append(load_experiment(name, changes))
        warnings = _check_all(experiments, names, args)
        if args.playback:
            _require_looks(experiments, names)
        requests = [
            _request(args, name, experiment.name, changes)
            for name, experiment in zip(names, experiments, strict=True)
        ]
        if args.dry_run:
            print_plan(requests, experiments, warnings, args.as_json)
            return None
        claims = _claim(requests, together=args.jobs == 1)
    pictures = Pictures(args.figures, args.playback)
    with claims, errors():
        if args.jobs > 1:
            return requests, run_apart(requests, pictures, args.jobs)
        by_name = {each.name: each for each in experiments}
        beside = [request.key for request in requests[: len(first)]]
        results: list[Result] = []

        def make(request: RunRequest) -> Result:
            ahead = request.key in beside
            experiment = by_name[request.key]
            result = _perform(request, experiment, pictures, () if ahead else results)
            results.extend([result] if ahead else [])
            return result

        return requests, run_here(requests, make)


@contextmanager
def _planning(name: str) -> Iterator[None]:
    """Show on a terminal how planning goes on, and print what was planned.

    Args:
        name: Name of the experiment whose goal is planned for.
    """
    with ExitStack() as stack:
        shown: list[Status] = []

        def watch(text: str, is_end: bool) -> None:
            if is_end:
                out.print(escape(f"{name}: {text}"), soft_wrap=True)
            elif err.is_terminal and not out.quiet:
                line = escape(f"{name}: {text}")
                shown[:] = shown or [stack.enter_context(err.status(line))]
                shown[0].update(line)

        with watch_planning(watch):
            yield


def _request(args: Run, experiment: str, name: str, changes: dict[str, Any]) -> RunRequest:
    return RunRequest(
        key=name,
        document=read_document(experiment, changes),
        experiment=experiment,
        changes=changes,
        folder=args.out_folder / name,
        options=_options_of(args),
    )


def _options_of(args: Run) -> RunOptions:
    # The command has an option for each of them, of the same name.
    return RunOptions(**{name: vars(args)[name] for name in field_names(RunOptions)})


def _claim(requests: Sequence[RunRequest], together: bool) -> ExitStack:
    """Claim the folders of runs before anything runs; return what gives them back.

    Args:
        requests: The runs.
        together: Whether they are run in this process; other ones claim them anew.
    """
    with ExitStack() as claims:
        for request in requests:
            claims.enter_context(claimed_folder(_folder(request), may_exist=True))
        if together:
            return claims.pop_all()
    return claims


def _folder(request: RunRequest) -> Path:
    return Path(request.folder or request.key)


def _require_looks(experiments: list[Experiment], names: list[str]) -> None:
    """Refuse looks that no playback could show, before anything runs."""
    for name, experiment in zip(names, experiments, strict=True):
        second = experiment.second
        for arm in [experiment.arm, *([second.arm] if second else [])]:
            if arm.looks is not None:
                with name_errors(name, among=names):
                    require_looks(arm)


def _require_alone(args: Run) -> None:
    """Refuse what --resume takes from the run that it goes on with."""
    usual = fields_of(RunOptions())
    options = fields_of(replace(_options_of(args), anyway=False))
    for option, value in (
        ("EXPERIMENT", args.experiments),
        ("--set", args.changes),
        ("--seed", args.seed is not None),
        ("--duration", args.duration is not None),
        *((f"--{name}", value != usual[name]) for name, value in options.items()),
        ("--out", args.out_folder != Path("out")),
        ("--beside", args.beside),
        ("--jobs", args.jobs > 1),
        ("--dry-run", args.dry_run),
    ):
        if value:
            raise InvalidInputError(
                f"{option}: cannot be combined with --resume, which goes on with the run as it was"
            )


def _require_beside_is_possible(args: Run) -> None:
    """Refuse --beside where no playback would show it, or no run could wait for it."""
    if args.jobs > 1:
        raise InvalidInputError("--jobs: cannot be combined with --beside")
    if not args.playback:
        raise InvalidInputError("--beside: shows paths in a playback; leave out --no-playback")
    if args.series == "none":
        raise InvalidInputError("--beside: shows paths, and --series none stores none")


def _check_all(experiments: list[Experiment], names: list[str], args: Run) -> list[list[str]]:
    """Check everything before anything runs; return the warnings about each."""
    warnings = []
    for experiment in experiments:
        if sum(other.name == experiment.name for other in experiments) > 1:
            raise InvalidInputError(
                f"name: two experiments are called {experiment.name!r}; one would overwrite the "
                "other"
            )
        with name_errors(experiment.name, among=names):
            warnings.append(check_experiment(experiment, **fields_of(_options_of(args))))
    return warnings


@contextmanager
def name_errors(name: str, among: list[str]) -> Iterator[None]:
    """Add the experiment's name to errors if there are several experiments."""
    try:
        yield
    except InvalidInputError as error:
        if len(among) == 1:
            raise
        raise InvalidInputError(f"{name}: {error}") from None


def run_here(
    requests: Sequence[RunRequest], make: Callable[[RunRequest], Result]
) -> dict[str, RunRecord]:
    """Make runs one after another in this process, until one is interrupted.

    Args:
        requests: The runs.
        make: Function that makes a run.

    Returns:
        The records by key.

    Raises:
        KeyboardInterrupt: If ``make`` raises one; it names the runs that are not made.
    """
    words: list[str] = []

    def perform(task: Sequence[RunRequest]) -> list[WrittenRun]:
        try:
            return [_record_of(make(request)) for request in task]
        except KeyboardInterrupt as interrupt:
            words.append(str(interrupt) or "interrupted")
            raise

    jobs = Jobs(requests)
    jobs.run(ThisProcess(), perform)
    if words:
        left = ", ".join(request.key for request in jobs.missing[1:])
        raise KeyboardInterrupt(f"{words[0]}; not run: {left}" if left else words[0])
    return jobs.records


def run_apart(
    requests: Sequence[RunRequest], pictures: Pictures, count: int
) -> dict[str, RunRecord]:
    """Make runs in processes of their own, until one is interrupted; print each when it is due.

    Args:
        requests: The runs.
        pictures: What is made of the results to look at.
        count: Number of processes.

    Returns:
        The records by key.
    """
    jobs = Jobs(requests)
    reports = InOrder(requests, jobs.records, _tell)
    perform = partial(_perform_apart, pictures, out.width, out.quiet)
    jobs.run(Processes(count, deaf=False), perform, reports.take)
    reports.finish()
    return jobs.records


_KILL_REASON = "its process was killed, perhaps for want of memory"


def _tell(request: RunRequest, record: RunRecord) -> None:
    if isinstance(record, WrittenRun):
        sys.stdout.write(record.output)
        sys.stderr.write(record.warnings)
    else:
        err.print(f"[red]failed[/] {escape(f'{request.key}: {_KILL_REASON}')}")


def _go_on(folder: Path, pictures: Pictures) -> _Ran:
    """Go on with the run of a folder that was stopped."""
    with errors(), claim_folder(folder):
        since = Checkpoint.load(folder)
        require_fillable(folder)
        result = run_and_write(lambda: resume_or_print(since), folder, pictures)
    request = RunRequest(result.experiment.name, {}, folder=folder)
    return [request], {request.key: _record_of(result)}


def _interrupt_once(number: int, frame: Any) -> None:
    # A second signal must not cut the writing of what the first one has left.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def _perform_apart(
    pictures: Pictures, width: int, quiet: bool, task: Sequence[RunRequest]
) -> list[WrittenRun]:
    """Make a run in this process; return its record, with what was printed meanwhile."""
    out.width, out.quiet = width, quiet
    signal.signal(signal.SIGINT, _interrupt_once)
    (request,) = task
    name, record = request.key, WrittenRun("interrupted")
    with out.capture() as output, err.capture() as warnings:
        try:
            with claim_folder(_folder(request)):
                result = _perform(request, make_experiment(request.document), pictures, bar=False)
            record = _record_of(result)
        except KeyboardInterrupt as interrupt:
            text = str(interrupt) or "interrupted"
            err.print(f"[red]failed[/] {escape(f'{name}: {text}')}")
        except (DrakeRnnError, OSError) as error:
            record = WrittenRun("failed", sentence_of(error))
            err.print(f"[red]error[/] {escape(f'{name}: {record.failure}')}")
        finally:
            # A process without a task has nothing to keep.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    return [replace(record, output=output.get(), warnings=warnings.get())]


def _perform(
    request: RunRequest,
    experiment: Experiment,
    pictures: Pictures,
    beside: Sequence[Result] = (),
    bar: bool = True,
) -> Result:
    tell_of_window(request.experiment, request.changes)
    folder = _folder(request)
    return run_and_write(
        lambda: simulate_or_print(experiment, bar, keep=folder, options=request.options),
        folder,
        pictures,
        beside,
    )


def run_fastest(args: Fastest) -> None:
    """Run a path as fast as the limits on all derivatives allow."""
    with errors():
        experiment = load_experiment(args.experiment, changes_of(args.changes))
        check_stretchable(experiment)
        folder = args.out_folder / f"{experiment.name}_fastest"
        with claimed_folder(folder, may_exist=True):
            fastest_run = fastest(experiment, lambda text: err.print(escape(text)))
            write_result(fastest_run.result, folder, Pictures(args.figures, args.playback))
    out.print(
        f"shortest duration {fastest_run.result.metrics['shortest_duration_s']:.4g} s, "
        f"{fastest_run.stretch:.4g} times the document's; limited by the {fastest_run.binding}"
    )


# Time between two lines about the progress where there is no terminal [s].
_TELL_AGAIN = 30.0
# Share of the time that a row takes on average within which another one has ended at once.
_AT_ONCE = 0.1


class Tell(Protocol):
    """Function that tells how many runs, or other parts, have ended."""

    def __call__(
        self, count: int, total: int, record: RunRecord | None, what: str = "runs"
    ) -> None:
        """Tell of the newest record; without one, of those that were kept from before."""


@contextmanager
def jobs_progress(name: str) -> Iterator[Tell]:
    """Show how many runs are finished and the time left; without a terminal, by lines."""
    if not err.is_terminal or out.quiet:
        yield _Lines(name).tell
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[troubles]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    troubles = 0
    with Progress(*columns, console=err, transient=True, speed_estimate_period=120) as bar:
        task = bar.add_task(escape(name), total=None, troubles="")

        def done(count: int, total: int, record: RunRecord | None, what: str = "runs") -> None:
            nonlocal troubles
            troubles += record is not None and not record.complete
            text = f"{troubles} not complete" if troubles else ""
            line = f"{name}: {what}"
            bar.update(task, description=escape(line), completed=count, total=total, troubles=text)

        yield done


class _Lines:
    """A line from time to time about how many runs are finished, as for the log of a server."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._began = self._told = self._last = perf_counter()
        self._kept = self._ended = 0

    def tell(self, count: int, total: int, record: RunRecord | None, what: str = "runs") -> None:
        """Tell of the progress, unless that was done just now."""
        now, before, last_count = perf_counter(), self._last, self._ended
        self._last, self._ended = now, count
        if record is None:
            # What came before, such as planning, says nothing of how long rows take.
            self._began = self._told = now
            self._kept = count
            return
        # Rows of a batch end at once: the time left is by the rows of whole batches.
        pace = (now - self._began) / max(count - self._kept, 1)
        is_of_batch = now - before < _AT_ONCE * pace
        if now - self._told < _TELL_AGAIN or out.quiet or last_count <= self._kept or is_of_batch:
            return
        self._told = now
        left = (before - self._began) / (last_count - self._kept) * (total - last_count)
        text = f"{last_count} of {total} {what} finished; about {left:.0f} s left"
        err.print(escape(f"{self._name}: {text}"))


def print_data(contents: Any) -> None:
    """Print plain data as JSON, with null for numbers that are not finite, which it has not."""
    typer.echo(json.dumps(_finite(contents), indent=2))


def print_plan(
    requests: Sequence[RunRequest],
    experiments: Sequence[Experiment],
    warnings: Sequence[Sequence[str]],
    as_json: bool,
) -> None:
    """Print what would be run, what it may take and what it warns of.

    Args:
        requests: What would be run.
        experiments: The experiments that these name.
        warnings: Warnings about each of them.
        as_json: Whether to print one JSON object, by name.
    """
    plan: dict[str, Any] = {}
    for request, experiment, complaints in zip(requests, experiments, warnings, strict=True):
        effort = effort_of(experiment.document)
        plan[request.key] = {
            "folder": str(request.folder),
            "duration_s": experiment.document.duration,
            "steps": effort.steps if effort.key else None,
            "expected_time_s": effort.time if effort.key else None,
            "warnings": list(complaints),
        }
        tell_of_window(request.experiment, request.changes)
        for complaint in complaints:
            err.print(f"[yellow]warning[/] {escape(f'{request.key}: {complaint}')}")
        out.print(escape(f"{request.key}: {told_of(effort)}; {request.folder}"), soft_wrap=True)
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
