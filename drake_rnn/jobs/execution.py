"""Carrying out requests: one after another by `simulate`, or in a batch of runs side by side.

- Whether the paths of many robots are in reach: what can be said of most at little cost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from threading import local
from time import perf_counter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..batch.grouping import BLOCK, Robot, arm_of_all, contents
from ..batch.run import Many, robots_of, run_robots
from ..batch.signals import Sight, Tables
from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import MISS, Arms, Experiment, forecasts, make_experiment
from ..experiment.files import stamp
from ..experiment.reach import reach_times
from ..inputs.fields import Array
from ..inputs.kinds import at, describe
from ..inputs.messages import fields_of
from ..laws.checks import warnings_of
from ..paths.relative import displacement_of
from ..runs.result import Result, verdicts_of
from ..runs.series import stored_period
from ..runs.simulation import check_effort, simulate
from .requests import RunRecord, RunRequest


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
