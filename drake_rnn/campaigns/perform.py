"""Functions that carry out orders, in any process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from threading import local
from time import perf_counter

import numpy as np

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import Arms, make_experiment
from ..experiment.fingerprint import stamp
from ..inputs.own_code import described
from ..runs.result import Result
from ..runs.simulation import simulate
from ..runs.stored import Series
from .outcome import Order, Outcome

#: Function that carries out a task, which is a list of orders, in any process. The outcome of an
#: order must not depend on the other orders of the task.
Perform = Callable[[Sequence[Order]], list[Outcome]]


def simulate_each(orders: Sequence[Order]) -> list[Outcome]:
    """Return the outcomes of orders that are run one after another by `simulate`.

    Raises:
        InvalidInputError: If this process has other versions than the orders ask for.
        KeyboardInterrupt: If a run is interrupted; that run has no outcome.
    """
    return [_timed(order) for order in orders]


def require_stamp(order: Order) -> None:
    """Raise an InvalidInputError if this process has other versions than an order asks for."""
    if order.stamp != stamp():
        raise InvalidInputError(
            f"worker: has {stamp()}; the campaign was started with {order.stamp}; install the same "
            "on both"
        )


def _timed(order: Order) -> Outcome:
    require_stamp(order)
    began = perf_counter()
    outcome, _ = attempt(order, "full" if order.learning else "none")
    return replace(outcome, wall_time_s=perf_counter() - began)


def attempt(order: Order, series: Series) -> tuple[Outcome, Result | None]:
    """Simulate an order; return its outcome and, as far as the run came, its result.

    Args:
        order: The order.
        series: Which series to store.

    Raises:
        KeyboardInterrupt: If the run is interrupted.
    """
    try:
        experiment = make_experiment(order.document, arms=arms_of(order))
        result = simulate(experiment, anyway=order.anyway, series=series)
        return _told(result, order.learning), result
    except InterruptedRunError:
        raise KeyboardInterrupt from None
    except SimulationError as error:
        if error.result is None:
            return Outcome("failed", str(error), error.time), None
        partial = replace(error.result, status="failed", failure=str(error))
        return _told(partial, order.learning), partial
    except InvalidInputError as error:
        return Outcome("refused", str(error)), None
    except DrakeRnnError as error:
        return Outcome("failed", str(error)), None
    # An error in a user's own code affects that run only.
    except Exception as error:
        return Outcome("failed", described(error)), None


class _Known(local):
    """Arms that a thread keeps between two tasks.

    Attributes:
        around: Digest of the files that the arms were read from.
        arms: The arms.
    """

    around = ""
    arms = Arms()


_KNOWN = _Known()


def arms_of(order: Order) -> Arms:
    """Return the arms of this thread, loaded anew only if the order's files have changed."""
    if _KNOWN.around != order.around:
        _KNOWN.around, _KNOWN.arms = order.around, Arms()
    return _KNOWN.arms


def _told(result: Result, learning: bool) -> Outcome:
    return Outcome(
        status="complete" if result.status == "complete" else "failed",
        failure=result.failure,
        until_s=result.record["until_s"],
        metrics={name: float(value) for name, value in result.metrics.items()},
        kept={verdict.metric: verdict.met for verdict in result.verdicts},
        accepted=tuple(result.experiment.document.accept),
        learning=_learning(result) if learning else (),
    )


def _learning(result: Result) -> tuple[list[float], ...]:
    if "J_hat" not in result.series:
        return ()
    difference = result.series["J"] - result.series["J_hat"]
    norm = np.asarray(np.linalg.norm(difference, axis=(1, 2)))
    return result.time.tolist(), norm.tolist()
