"""Campaigns: many runs of one experiment, each kept when it ends, and their summary.

A sweep is a campaign over lists, of which a list of rows is returned.

- How requests are carried out: one after another by `simulate`, or in a batch side by side.
- Whether the paths of many robots are in reach: what can be said of most at little cost.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import local
from time import perf_counter
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..batch.grouping import BLOCK, Robot, arm_of_all, contents
from ..batch.run import Many, robots_of, run_robots
from ..batch.signals import Sight, Tables
from ..errors import (
    DrakeRnnError,
    InterruptedRunError,
    InvalidInputError,
    SimulationError,
    old_arguments,
)
from ..experiment import MISS, Arms, Experiment, ExperimentSource, forecasts, make_experiment
from ..experiment.experiment import reach_times
from ..experiment.files import stamp, written_head
from ..inputs.documents import parse_yaml, to_yaml
from ..inputs.fields import Array, checked, flag, function, instance, optional, whole
from ..inputs.kinds import at, describe
from ..inputs.messages import fields_of, require_type, short
from ..inputs.packages import versions
from ..laws.checks import warnings_of
from ..paths.path import displacement_of
from ..runs.folder import written_whole
from ..runs.result import Result, verdicts_of
from ..runs.series import stored_period
from ..runs.simulation import check_effort, simulate
from .plan import CampaignDocument, Plan, plan_campaign, plan_sweep, read_campaign
from .pool import Executor, InOrder, Jobs, LostWorkersError, Workers, processes_of, workers_of
from .requests import Perform, RecordStore, Row, RunRecord, RunRequest
from .summary import (
    Group,
    Line,
    Summary,
    group_by,
    lines_of,
    metrics_in,
    numbers_of,
    summarize,
    write_lines,
    write_table,
)


def simulate_each(requests: Sequence[RunRequest]) -> list[RunRecord]:
    """Return the records of requests that are run one after another by `simulate`.

    The whole result of a request that names a folder is saved there, as far as the run came.

    Raises:
        InvalidInputError: If this process has other versions than the requests ask for, or a result
            cannot be saved.
        KeyboardInterrupt: If a run is interrupted; that run has no record.
    """
    return [_time(request) for request in requests]


def require_stamp(request: RunRequest) -> None:
    """Raise an InvalidInputError if this process has other versions than a request asks for."""
    if request.stamp and request.stamp != stamp():
        raise InvalidInputError(
            f"worker: has {stamp()}; the campaign was started with {request.stamp}; install the "
            "same on both"
        )


def _time(request: RunRequest) -> RunRecord:
    require_stamp(request)
    began = perf_counter()
    record, result = _attempt(request)
    if result is not None and request.folder is not None:
        result.save(request.folder)
    return replace(record, wall_time_s=perf_counter() - began)


def _attempt(request: RunRequest) -> tuple[RunRecord, Result | None]:
    """Simulate a request; return its record and, as far as the run came, its result."""
    needs_result = request.learning or request.folder is not None
    try:
        experiment = make_experiment(request.document, arms=arms_of(request))
        options = request.options if needs_result else replace(request.options, series="none")
        result = simulate(experiment, **fields_of(options))
        return RunRecord.of_result(result, request.learning), result
    except InterruptedRunError:
        raise KeyboardInterrupt from None
    except SimulationError as error:
        if error.result is None:
            return RunRecord("failed", str(error), error.time), None
        partial = replace(error.result, status="failed", failure=str(error))
        return RunRecord.of_result(partial, request.learning), partial
    except InvalidInputError as error:
        return RunRecord("refused", str(error)), None
    except DrakeRnnError as error:
        return RunRecord("failed", str(error)), None
    # An error in a user's own code affects that run only.
    except Exception as error:
        return RunRecord("failed", describe(error)), None


class _ArmCache(local):
    """Arms that a thread keeps between two tasks.

    Attributes:
        around: Digest of the files that the arms were read from.
        arms: The arms.
    """

    around = ""
    arms = Arms()


_CACHE = _ArmCache()


def arms_of(request: RunRequest) -> Arms:
    """Return the arms of this thread, loaded anew only if the request's files have changed."""
    if _CACHE.around != request.around:
        _CACHE.around, _CACHE.arms = request.around, Arms()
    return _CACHE.arms


S = TypeVar("S")
T = TypeVar("T")


def run_each(requests: Sequence[RunRequest]) -> list[RunRecord]:
    """Return the records of requests, each carried out by its method.

    Requests for a batch run side by side, after the same checks as before a single run. One that is
    refused there, fails at its start or does not fit a batch is handed to `simulate`, which reports
    what is wrong. The record of a request does not depend on the other requests.

    Raises:
        InvalidInputError: If this process has other versions than the requests ask for.
        KeyboardInterrupt: If it is interrupted; runs that have not ended have no record.
    """
    for request in requests:
        require_stamp(request)
    began = perf_counter()
    together = [request for request in requests if request.method == "batch"]
    records = _records(together)
    each = (perf_counter() - began) / max(len(together), 1)
    return [
        replace(records[request.key], wall_time_s=each)
        if request.key in records
        else simulate_each([request])[0]
        for request in requests
    ]


def _records(requests: Sequence[RunRequest]) -> dict[str, RunRecord]:
    """Return the records of the requests that a batch has carried out, by their keys."""
    experiments = _existing([(request.key, _make(request)) for request in requests])
    robots = _existing(
        zip(experiments, _by_halves(robots_of, list(experiments.values())), strict=True)
    )
    arms = [
        (key, arm)
        for key, robot in robots.items()
        for arm in (robot, robot.second)
        if arm is not None
    ]
    sure = _by_halves(surely_in_reach, [arm for _, arm in arms])
    out_of_reach = {
        key
        for (key, arm), is_sure in zip(arms, sure, strict=True)
        if not (is_sure or _in_reach(arm.experiment))
    }
    ready = {key: robot for key, robot in robots.items() if key not in out_of_reach}
    return _existing(zip(ready, _by_halves(_run, list(ready.values())), strict=True))


def _existing(pairs: Iterable[tuple[str, T | None]]) -> dict[str, T]:
    return {key: value for key, value in pairs if value is not None}


def _by_halves(action: Callable[[list[S]], Iterable[T]], items: list[S]) -> list[T | None]:
    """Return the action's result for each item; None for an item that fails, found by halving."""
    if not items:
        return []
    try:
        return list(action(items))
    # `simulate` will report the error, of whatever kind.
    except Exception:
        if len(items) == 1:
            return [None]
        middle = len(items) // 2
        return [*_by_halves(action, items[:middle]), *_by_halves(action, items[middle:])]


def _make(request: RunRequest) -> Experiment | None:
    try:
        experiment = make_experiment(request.document, arms=arms_of(request))
        if not request.options.anyway:
            check_effort(experiment, stored_period(experiment, "none"))
    except Exception:
        return None
    return experiment


def _in_reach(experiment: Experiment) -> bool:
    try:
        forecasts(experiment)
    except Exception:
        return False
    return True


def _run(robots: Sequence[Robot]) -> Iterator[RunRecord | None]:
    many = run_robots(robots)
    for number, robot in enumerate(robots):
        # `simulate` refuses a law that fails at its start.
        unbegun = many.status[number] == "failed" and many.until[number] <= 0.0
        yield None if unbegun else _batch_record(many, number, robot)


def _batch_record(many: Many, number: int, robot: Robot) -> RunRecord:
    experiment, metrics = robot.experiment, many.row(number)
    failure = _fault(robot, metrics)
    if number in many.failures:
        failure = f"controller: {many.failures[number]}{at(float(many.until[number]))}"
    return RunRecord(
        status="failed" if failure else "complete",
        failure=failure,
        until_s=float(many.until[number]),
        metrics=metrics,
        kept={each.metric: each.met for each in verdicts_of(experiment, metrics, not failure)},
        accepted=tuple(experiment.document.accept),
        method="batch",
    )


def _fault(robot: Robot, metrics: dict[str, float]) -> str:
    """Return the error of a law's caveats about its run; empty if there is none."""
    try:
        warnings_of(robot.reading, "caveats", lambda: robot.reading.caveats(metrics))
    except InvalidInputError as error:
        return str(error)
    except Exception as error:
        return describe(error)
    return ""


# Steps of Newton's method at the path's first point, which may be far, and at each of the others.
_FIRST, _NEXT = 50, 2
_LONGEST, _DAMPING = 0.2, 1e-6
# Share of the largest miss up to which a path is in reach without doubt.
_SURELY = 0.1


def surely_in_reach(robots: Sequence[Robot]) -> NDArray[np.bool_]:
    """Return for each robot whether its path is in reach beyond doubt, shape (robots,).

    All follow their paths at once by a few steps of damped least squares, at the points at which
    the check before a single run does. Who comes within a tenth of the miss that this check
    allows passes it. Of others, and of planar tasks and of those with an orientation, nothing is
    said: ask `drake_rnn.experiment.check_reach`. What is said of a robot does not depend on the
    others.

    Args:
        robots: The robots.
    """
    # Those with a target posture have nothing to follow; some need not be able to.
    sure = np.array([_need_not(robot.experiment) for robot in robots], dtype=bool)
    times: dict[object, Array] = {}
    groups: dict[object, tuple[Array, list[int]]] = {}
    for number, robot in enumerate(robots):
        if sure[number] or not _can_tell(robot.experiment):
            continue
        path = _path(robot.experiment)
        if path not in times:
            times[path] = reach_times(robot.experiment)
        at, arm = times[path], robot.arm
        key = at.tobytes(), robot.experiment.task, arm.slides, arm.columns, arm.n
        groups.setdefault(key, (at, []))[1].append(number)
    for at, numbers in groups.values():
        for begin in range(0, len(numbers), BLOCK):
            some = numbers[begin : begin + BLOCK]
            sure[some] = _follow_paths([robots[number] for number in some], at)
    return sure


def _need_not(experiment: Experiment) -> bool:
    return experiment.target is not None or experiment.document.on_unreachable == "follow"


def _can_tell(experiment: Experiment) -> bool:
    task = experiment.law_task
    return not (experiment.holds_orientation or task.objectives) and len(task.axes) == 3


def _path(experiment: Experiment) -> object:
    """Return what identifies the shape of a path and the time in which it is passed."""
    displacement, duration = displacement_of(experiment.desired), experiment.document.duration
    shape = id(experiment.desired) if displacement is None else contents(displacement[0])
    return shape, duration


def _follow_paths(robots: Sequence[Robot], times: Array) -> NDArray[np.bool_]:
    """Return whether robots with the same task and the same times come close to their paths."""
    experiments = [robot.experiment for robot in robots]
    arm, task = arm_of_all(robots), experiments[0].task
    tables, rows = Tables(experiments, times, rotates=False), list(task.axes)
    shift = np.array([_shift(experiment) for experiment in experiments])
    q: Array = np.array([experiment.start for experiment in experiments])
    sure = np.ones(len(robots), dtype=bool)
    with np.errstate(all="ignore"):
        for number in range(times.size):
            target = (tables.position(tables.row(number))[0] - shift)[:, rows]
            for _ in range(_FIRST if number == 0 else _NEXT):
                sight = Sight(task, arm.at(q), q)
                q = q + _step(np.ascontiguousarray(sight.J), target - sight.p_WE)
            miss = target - Sight(task, arm.at(q), q).p_WE
            # A number that is none is not less than any.
            sure &= (miss * miss).sum(axis=-1) < (_SURELY * MISS) ** 2
    return sure


def _shift(experiment: Experiment) -> Array:
    """Return by how much a path lies off the surface that the tool is to touch [m]."""
    if (contact := experiment.contact) is None:
        return np.zeros(3)
    return contact.surface.gap * np.asarray(contact.surface.normal_W)


def _step(J: Array, error: Array) -> Array:
    """Return steps of damped least squares, shape (robots, n), none longer than 0.2 rad."""
    A = J @ J.swapaxes(-1, -2) + _DAMPING * np.eye(J.shape[-2])
    step = (J.swapaxes(-1, -2) @ np.linalg.solve(A, error[..., None]))[..., 0]
    longest = np.abs(step).max(axis=-1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, _LONGEST / np.maximum(longest, _LONGEST)))


#: Called with the number of runs that have ended, the number of all runs, and the newest record;
#: the first call counts the runs kept from before, and its record is None.
Progress = Callable[[int, int, RunRecord | None], None]
#: How a campaign ended.
Ending = Literal["complete", "interrupted", "lost"]


@dataclass(frozen=True)
class CampaignResult:
    """Result of a campaign.

    Attributes:
        plan: The runs that were planned.
        folder: Folder with ``table.csv``, ``campaign.json`` and the files that the campaign was
            run from.
        lines: Rows that have ended, in their order.
        summary: Summary of these rows.
        ending: Whether all rows have ended; ``lost`` if the workers were lost before that.
        reason: Why not all rows have ended; empty if they have.
        kept: Number of runs that were kept from an earlier call.
    """

    plan: Plan
    folder: Path
    lines: list[Line]
    summary: Summary
    ending: Ending
    reason: str
    kept: int

    @property
    def missing(self) -> int:
        """Number of rows that have not ended."""
        return len(self.plan.rows) - len(self.lines)

    def showing(self, metrics: Sequence[str]) -> CampaignResult:
        """Return the result with a summary of other metrics; what is stored stays as it is.

        Args:
            metrics: Their names; those of the campaign's document if empty.
        """
        if not metrics:
            return self
        document = replace(self.plan.campaign, metrics=list(metrics))
        rows, file = len(self.plan.rows), self.folder / "experiment.yaml"
        return replace(self, summary=summarize(document, rows, self.lines, file))

    def groups(self, *by: str) -> list[Group]:
        """Return count, mean, deviation and quantiles of the summary's metrics for groups of rows.

        Args:
            *by: Keys whose values the rows of a group share, e.g. ``law.kind`` and ``arm``.

        Raises:
            InvalidInputError: If one does not vary.
        """
        metrics = [metric.name for metric in self.summary.metrics]
        quantiles = self.plan.campaign.statistics.quantiles
        return group_by(self.lines, by, metrics, quantiles)


@old_arguments(done="progress")
@checked(
    folder=instance(str, Path),
    jobs=whole(),
    perform=function(),
    batch=optional(whole(1)),
    progress=optional(function()),
    again=flag,
)
def run_campaign(
    campaign: str | Path | Mapping[str, Any] | CampaignDocument | Plan,
    folder: str | Path,
    *,
    jobs: int = 1,
    executor: Executor | Workers | None = None,
    perform: Perform = run_each,
    batch: int | None = None,
    progress: Progress | None = None,
    again: bool = False,
) -> CampaignResult:
    """Run the rows of a campaign that have not been run, and return all rows.

    Each row is kept in the folder when it ends. A second call, also after this process was killed,
    runs only the missing rows, and the table is the same to the last bit. A run that fails, is
    refused or kills its worker is a row too.

    Args:
        campaign: A shipped name, a YAML file, a document, or a plan from `plan_campaign`.
        folder: Folder for rows and results.
        jobs: Number of processes; 0 runs everything in this process, which knows the classes
            registered in it, but ends if a run crashes it.
        executor: Executor to use in place of processes: anything with ``submit``, such as an
            executor of `concurrent.futures` or a Dask client. The executor is not shut down.
        perform: Function that carries out a list of requests, in any process; by default each
            request by the method that the campaign's document names.
        batch: Number of rows handed to ``perform`` at a time; chosen by the requests by default.
        progress: Called when a run has ended.
        again: Whether to retry rows whose worker crashed.

    Raises:
        InvalidInputError: If a row is no valid experiment, the folder cannot be written to, or
            another process is running this campaign.
    """
    require_type("jobs", jobs, int)
    plan = campaign if isinstance(campaign, Plan) else plan_campaign(read_campaign(campaign))
    folder = Path(folder)
    store = RecordStore(folder / "rows")
    with store.claim():
        _describe(plan, folder)
        rows = Jobs(plan.rows, store, again)
        workers = processes_of(jobs) if executor is None else workers_of(executor)

        def tell(record: RunRecord | None) -> None:
            if progress is not None:
                progress(len(rows.records), len(rows.requests), record)

        tell(None)
        ending, reason = _run_to_end(
            lambda: rows.run(workers, perform, lambda _, record: tell(record), batch)
        )
        lines = lines_of(plan.rows, rows.records)
        summary = summarize(plan.campaign, len(plan.rows), lines, folder / "experiment.yaml")
        result = CampaignResult(plan, folder, lines, summary, ending, reason, rows.kept)
        _write(result, rows.records)
    return result


def _run_to_end(run: Callable[[], bool]) -> tuple[Ending, str]:
    """Run, and return how that ended and why."""
    try:
        return ("complete", "") if run() else ("interrupted", "interrupted")
    except LostWorkersError as error:
        return "lost", str(error)


def _describe(plan: Plan, folder: Path) -> None:
    """Write the documents of campaign and experiment, so that the folder documents itself."""
    campaign = {
        name: fields_of(value) or value for name, value in fields_of(plan.campaign).items() if value
    }
    try:
        with written_whole(folder / "experiment.yaml") as stream:
            stream.write(written_head("experiment") + to_yaml(plan.experiment))
        # The experiment's file already includes the changes.
        contents = {**campaign, "experiment": "experiment.yaml"}
        contents.pop("changes", None)
        with written_whole(folder / "campaign.yaml") as stream:
            stream.write(written_head("campaign") + to_yaml(contents))
    except OSError as error:
        raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None


def _write(result: CampaignResult, records: Mapping[str, RunRecord]) -> None:
    metrics = result.plan.campaign.metrics or metrics_in(result.lines)
    write_table(result.folder / "table.csv", list(result.plan.campaign.vary), result.lines, metrics)
    record = {
        "status": result.ending,
        "reason": result.reason,
        "rows": len(result.plan.rows),
        "statuses": result.summary.statuses,
        "methods": result.summary.methods,
        "shares": {name: list(share) for name, share in result.summary.shares.items()},
        "versions": versions(),
        "timings": {"runs_wall_time_s": sum(each.wall_time_s for each in records.values())},
    }
    with suppress(OSError), written_whole(result.folder / "campaign.json") as stream:
        stream.write(json.dumps(record, indent=2) + "\n")


class InterruptedSweepError(DrakeRnnError):
    """A sweep that was interrupted from the keyboard.

    Attributes:
        rows: Rows that have ended.
        missing: Values of the rows that have not ended.
    """

    def __init__(self, rows: list[Row], missing: list[tuple[Any, ...]]) -> None:
        super().__init__(f"interrupted: {len(rows)} of {len(rows) + len(missing)} runs have ended")
        self.rows = rows
        self.missing = missing


def parse_axis(text: str) -> tuple[str, list[Any]]:
    """Return key and values of ``KEY=v1,v2,...``; values are parsed as YAML.

    Raises:
        InvalidInputError: If the key or the values are missing.
    """
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise InvalidInputError(f"--over: must be KEY=v1,v2,..., not {text!r}")
    return key.strip(), parse_yaml(f"[{values}]", f"--over {key.strip()}")


@old_arguments(done="progress")
@checked(
    changes=instance(Mapping, None),
    progress=optional(function()),
    anyway=flag,
    keep=instance(str, Path, None),
)
def sweep(
    experiment: ExperimentSource,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
    processes: int = 1,
    progress: Callable[[Row], None] | None = None,
    *,
    anyway: bool = False,
    keep: Path | None = None,
) -> list[Row]:
    """Run an experiment at each combination of values.

    Every combination is checked before the first run. A run that fails gets a row and does not stop
    the other runs.

    Args:
        experiment: A shipped name, a YAML file, a document or an experiment.
        over: Values to run, by dotted key.
        changes: New values of other keys, the same in each run.
        processes: Number of runs at a time; the results do not depend on it.
        progress: Called with each row when it is ready, in order.
        anyway: Whether a run may take any number of steps.
        keep: Folder that keeps each ended row until all rows have ended; rows that the folder
            already holds are not run again.

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, a key
            is both swept and changed, or other processes do not know the classes that it names.
        InterruptedSweepError: If the user interrupts the sweep; the error holds the rows so far.
    """
    return run_sweep(
        plan_sweep(experiment, over, changes, anyway=anyway), processes, progress, keep
    )


def run_sweep(
    plan: Plan,
    processes: int = 1,
    progress: Callable[[Row], None] | None = None,
    keep: Path | None = None,
) -> list[Row]:
    """Make the runs of a sweep; arguments, result and errors are those of `sweep`."""
    if not isinstance(processes, int) or processes < 1:
        raise InvalidInputError(
            f"processes: must be a whole number of at least 1, not {short(processes)}"
        )
    # One run at a time needs no process of its own, and knows the classes of this one.
    workers = processes_of(processes if processes > 1 else 0)
    perform = _simulate_known if processes > 1 else simulate_each
    store = None if keep is None else RecordStore(Path(keep))
    with nullcontext() if store is None else store.claim():
        jobs = Jobs(plan.rows, store)

        def tell(request: RunRequest, record: RunRecord) -> None:
            if progress is not None:
                progress(Row.of(request, record))

        complete = jobs.run(workers, perform, InOrder(plan.rows, jobs.records, tell).take)
        complete_rows = [each for each in plan.rows if each.key in jobs.records]
        rows = [Row.of(request, jobs.records[request.key]) for request in complete_rows]
        if not complete:
            missing = [each.changes for each in plan.rows if each.key not in jobs.records]
            raise InterruptedSweepError(rows, [tuple(values.values()) for values in missing])
        if store is not None:
            store.remove()
    return rows


def _simulate_known(requests: Sequence[RunRequest]) -> list[RunRecord]:
    """Simulate requests in another process than the one that has checked each of them.

    Raises:
        InvalidInputError: If one is refused, as this process lacks a class.
    """
    records = simulate_each(requests)
    for record in records:
        if record.status == "refused":
            raise InvalidInputError(
                f"{record.failure}; only this process knows it: name it so for the others, or run "
                "the sweep in one process"
            )
    return records


def write_csv(file: Path, keys: Sequence[str], rows: Sequence[Row]) -> None:
    """Write all values and metrics of a sweep to a CSV file, one line per run.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    names = list(dict.fromkeys(name for row in rows for name in row.metrics))
    lines = ([*row.values, *numbers_of(row.metrics, names), row.failure or ""] for row in rows)
    write_lines(file, [*keys, *names, "failure"], lines)
