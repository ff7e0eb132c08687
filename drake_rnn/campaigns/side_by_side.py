"""Carrying out many orders at a time, in a batch of runs side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TypeVar

from ..batch.grouping import Robot
from ..batch.in_reach import surely_in_reach
from ..batch.run import Many, robots_of, run_robots
from ..errors import InvalidInputError
from ..experiment import Experiment, forecasts, make_experiment
from ..inputs.own_code import at, described
from ..laws.checks import warnings_of
from ..runs.effort import check_effort
from ..runs.stored import stored_period
from ..runs.verdict import verdicts_of
from .outcome import Order, Outcome
from .perform import arms_of, require_stamp, simulate_each

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
