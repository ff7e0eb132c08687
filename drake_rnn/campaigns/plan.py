"""The rows of a campaign: the values of each row, and the run that they ask for.

- Carrying out many orders at a time, in a batch of runs side by side.
- Whether the paths of many robots are in reach: what can be said of most at little cost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import product
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..batch.grouping import BLOCK, Robot, arm_of_all, contents, why_not_arm, why_not_law
from ..batch.run import Many, robots_of, run_robots
from ..batch.signals import Sight, Tables
from ..errors import InvalidInputError
from ..experiment import (
    MISS,
    Arms,
    Described,
    Experiment,
    Sections,
    document_class,
    forecasts,
    load_experiment,
    make_experiment,
    read_document,
    read_sections,
    require_none_lost,
)
from ..experiment.fingerprint import forget_files, row_key, stamp, surroundings
from ..experiment.reach import reach_times
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.kinds import at, described
from ..inputs.messages import plain
from ..laws.checks import warnings_of
from ..paths.relative import displacement_of
from ..runs.result import verdicts_of
from ..runs.series import stored_period
from ..runs.simulation import check_effort, effort_of, require_effort
from .document import CampaignDocument
from .requests import Method, Order, Outcome, arms_of, require_stamp, simulate_each
from .variation import Distribution


@dataclass(frozen=True)
class PlannedRow:
    """A row of a campaign.

    Attributes:
        number: Number of the row, from 0.
        values: Values of the varied keys.
        order: Order of the row's run; rows with the same values share one order.
    """

    number: int
    values: dict[str, Any]
    order: Order


@dataclass(frozen=True)
class Plan:
    """The runs of a campaign.

    Attributes:
        campaign: Document of the campaign.
        experiment: Contents of the experiment's document, with the changes that all rows share.
        rows: The rows.
        time: Estimated time of all runs one after another, within a factor of a few [s].
    """

    campaign: CampaignDocument
    experiment: dict[str, Any]
    rows: list[PlannedRow]
    time: float


#: Time to load, check and evaluate a run of any length [s], by its method.
_EACH = {"simulate": 0.1, "batch": 0.01}
#: Time of a step of a run in a batch [s].
_STEP = 3e-6


def plan_campaign(
    campaign: CampaignDocument, changes: Mapping[str, Any] | None = None, *, anyway: bool = False
) -> Plan:
    """Return the runs of a campaign, with the document of each row checked.

    The first row is checked as a whole; in the other rows, each section is checked by itself. A
    fault that shows only when the run starts, such as a path out of reach, becomes a row.

    Args:
        campaign: The campaign.
        changes: Further changes of the experiment, by dotted key.
        anyway: Whether a run may take any number of steps.

    Raises:
        InvalidInputError: If a row is no valid experiment, or a run would take too many steps.
    """
    for key in changes or {}:
        if key in campaign.vary:
            raise InvalidInputError(f"--set: {key!r} varies in this campaign; it cannot be both")
    require_none_lost({**(changes or {}), **campaign.vary}, "--set")
    base = shared_document(campaign.experiment, {**campaign.changes, **(changes or {})})
    arms, rows, time = Arms(), [], 0.0
    for number, values in enumerate(row_values(campaign)):
        try:
            if number == 0:
                load_experiment(base, values)
            contents = read_document(base, values)
            parts = read_sections(construct(document_class(contents), contents, ""), arms)
            effort = effort_of(parts.document)
            if not anyway:
                require_effort(effort, parts.document.duration)
            method = _chosen(campaign.method, parts, arms)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error} (row {number})") from None
        order = order_of(contents, anyway=anyway, method=method)
        rows.append(PlannedRow(number, values, order))
        time += _EACH[method] + (_STEP * effort.steps if method == "batch" else effort.time)
    return Plan(campaign, base, rows, time)


def _chosen(asked: str, parts: Sections, arms: Arms) -> Method:
    """Return what carries out a run, chosen by its document alone.

    Raises:
        InvalidInputError: If a batch is asked for and cannot carry it out.
    """
    if asked == "simulate":
        return "simulate"
    reason = why_not_law(parts.document, parts.law) or arms.shared(
        "why not", _joints_of(parts.document.arm), lambda: why_not_arm(parts.arm)
    )
    if reason is not None and asked == "batch":
        raise InvalidInputError(f"method: may not be batch here; {reason}")
    return "batch" if reason is None else "simulate"


def _joints_of(arm: str | Mapping[str, Any]) -> Any:
    """Return what a document says about an arm, without the errors of its links."""
    if isinstance(arm, str):
        return arm
    return {key: value for key, value in arm.items() if key != "link_errors"}


def shared_document(experiment: Described, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the contents of a document with the changes that all rows share, as plain data."""
    forget_files()
    contents: dict[str, Any] = plain(read_document(experiment, changes))
    return contents


def order_of(
    contents: Mapping[str, Any],
    *,
    anyway: bool = False,
    learning: bool = False,
    method: Method = "simulate",
) -> Order:
    """Return the order of the run of a document.

    Args:
        contents: Contents of the document.
        anyway: Whether the run may take any number of steps.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run.
    """
    document: dict[str, Any] = plain(contents)
    around = surroundings(document)
    # A run that is refused for its many steps is kept apart from the same run made anyway.
    said = f"row 2 {method}{' learning' * learning}{' anyway' * anyway}"
    key = row_key(document, around, said)
    return Order(key, document, stamp(), around, anyway, learning, method)


def row_values(campaign: CampaignDocument) -> Iterator[dict[str, Any]]:
    """Yield the values of the varied keys of each row, the last list fastest, then the samples.

    The same sample draws the same values in each combination, so that combinations can be compared
    draw by draw. Values depend on the seed, the key and the number of the sample alone.
    """
    axes, groups, distributions = campaign.axes, campaign.groups, campaign.distributions
    walked = [list(zip(*(axes[key].listed() for key in group), strict=True)) for group in groups]
    samples = [
        {key: _drawn(one, campaign.seed, key, k) for key, one in distributions.items()}
        for k in range(campaign.samples or 1)
    ]
    for combination in product(*walked):
        chosen: dict[str, Any] = {}
        for group, values in zip(groups, combination, strict=True):
            chosen |= zip(group, values, strict=True)
        for sample in samples:
            every = chosen | sample
            yield {key: every[key] for key in campaign.vary}


def _drawn(distribution: Distribution, seed: int, key: str, sample: int) -> Any:
    words = np.frombuffer(sha256(key.encode()).digest()[:16], dtype=np.uint32)
    sequence = np.random.SeedSequence(seed, spawn_key=(*map(int, words), sample))
    return distribution.draw(np.random.default_rng(sequence))


def unique_orders(rows: Sequence[PlannedRow]) -> list[Order]:
    """Return the orders of rows, each once, in their order."""
    return list({row.order.key: row.order for row in rows}.values())


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
        key = at.tobytes(), robot.experiment.document.task, arm.slides, arm.columns, arm.n
        groups.setdefault(key, (at, []))[1].append(number)
    for at, numbers in groups.values():
        for begin in range(0, len(numbers), BLOCK):
            some = numbers[begin : begin + BLOCK]
            sure[some] = _followed([robots[number] for number in some], at)
    return sure


def _need_not(experiment: Experiment) -> bool:
    return experiment.target is not None or experiment.document.on_unreachable == "follow"


def _can_tell(experiment: Experiment) -> bool:
    return not experiment.holds_orientation and len(experiment.task.axes) == 3


def _path(experiment: Experiment) -> object:
    """Return what identifies the shape of a path and the time in which it is passed."""
    shared, duration = displacement_of(experiment.desired), experiment.document.duration
    shape = id(experiment.desired) if shared is None else contents(shared[0])
    return shape, duration


def _followed(robots: Sequence[Robot], times: Array) -> NDArray[np.bool_]:
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


S = TypeVar("S")
T = TypeVar("T")


def run_each(orders: Sequence[Order]) -> list[Outcome]:
    """Return the outcomes of orders, each carried out by its method.

    Orders for a batch run side by side, after the same checks as before a single run. An order that
    is refused there, fails at its start or does not fit a batch is handed to `simulate`, which
    reports what is wrong. The outcome of an order does not depend on the other orders.

    Raises:
        InvalidInputError: If this process has other versions than the orders ask for.
        KeyboardInterrupt: If it is interrupted; runs that have not ended have no outcome.
    """
    for order in orders:
        require_stamp(order)
    began = perf_counter()
    together = [order for order in orders if order.method == "batch"]
    found = _outcomes(together)
    each = (perf_counter() - began) / max(len(together), 1)
    return [
        replace(found[order.key], wall_time_s=each)
        if order.key in found
        else simulate_each([order])[0]
        for order in orders
    ]


def _outcomes(orders: Sequence[Order]) -> dict[str, Outcome]:
    """Return the outcomes of the orders that a batch has carried out, by their keys."""
    made = _existing([(order.key, _made(order)) for order in orders])
    robots = _existing(zip(made, _by_halves(robots_of, list(made.values())), strict=True))
    sure = _by_halves(surely_in_reach, list(robots.values()))
    ready = {
        key: robot
        for (key, robot), known in zip(robots.items(), sure, strict=True)
        if known or _in_reach(robot.experiment)
    }
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


def _made(order: Order) -> Experiment | None:
    try:
        experiment = make_experiment(order.document, arms=arms_of(order))
        if not order.anyway:
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


def _run(robots: Sequence[Robot]) -> Iterator[Outcome | None]:
    many = run_robots(robots)
    for number, robot in enumerate(robots):
        # `simulate` refuses a law that fails at its start.
        unbegun = many.status[number] == "failed" and many.until[number] <= 0.0
        yield None if unbegun else _told(many, number, robot)


def _told(many: Many, number: int, robot: Robot) -> Outcome:
    experiment, metrics = robot.experiment, many.row(number)
    failure = _fault(robot, metrics)
    if number in many.failures:
        failure = f"controller: {many.failures[number]}{at(float(many.until[number]))}"
    return Outcome(
        status="failed" if failure else "complete",
        failure=failure,
        until_s=float(many.until[number]),
        metrics=metrics,
        kept={verdict.metric: verdict.met for verdict in verdicts_of(experiment, metrics)},
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
        return described(error)
    return ""
