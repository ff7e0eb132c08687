"""Sweeps: runs of one experiment at many values."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import DrakeRnnError, InvalidInputError
from ..experiment import (
    Arms,
    Described,
    Experiment,
    load_experiment,
    read_document,
    require_none_lost,
)
from ..inputs.complaints import require_type, short
from ..inputs.documents import parse_yaml
from ..inputs.fields import Array
from ..runs.effort import effort_of
from ..runs.simulation import check_experiment
from .campaign import kept_rows
from .engine import carry_out
from .outcome import Order, Outcome
from .perform import simulate_each
from .plan import order_of, shared_document
from .store import RowStore
from .workers import Processes, ThisProcess


class Planned(NamedTuple):
    """A run of a sweep that is to be made.

    Attributes:
        values: Values of the swept keys, in their order.
        order: The run that they stand for.
        time: Time that it may take, within a factor of a few [s]; 0 if that is not known.
    """

    values: tuple[Any, ...]
    order: Order
    time: float


@dataclass(frozen=True)
class Row:
    """One run of a sweep.

    Attributes:
        values: Values of the swept keys, in their order.
        metrics: Metrics of the run, up to its failure if it failed.
        failure: Reason for the failure; None if the run did not fail.
        not_met: Metrics that do not keep the bounds that they are expected to keep.
        learning: Times [s] and Frobenius norms of J - J_hat, shape (k,); None without a J_hat.
    """

    values: tuple[Any, ...]
    metrics: dict[str, float]
    failure: str | None = None
    not_met: tuple[str, ...] = ()
    learning: tuple[Array, Array] | None = None


class InterruptedSweepError(DrakeRnnError):
    """A sweep that was interrupted from the keyboard.

    Attributes:
        rows: Rows that have ended.
        missing: Values of the rows that have not.
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


def sweep(
    experiment: Described,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
    processes: int = 1,
    done: Callable[[Row], None] | None = None,
    *,
    anyway: bool = False,
    keep: Path | None = None,
) -> list[Row]:
    """Run an experiment at each combination of values.

    Every combination is checked before the first one runs. A run that fails gets a row and does
    not stop the others.

    Args:
        experiment: A shipped name, a YAML file, a document or an experiment.
        over: Values to run, by dotted key.
        changes: New values of other keys, the same in each run.
        processes: Number of runs at a time; the results do not depend on it.
        done: Called with each row when it is ready, in order.
        anyway: Whether a run may take as many steps as it likes.
        keep: Folder in which each row is kept as soon as it has ended, until all have; rows that
            are there already are not run again.

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, a key
            is both swept and changed, or other processes do not know the classes that it names.
        InterruptedSweepError: If it is interrupted from the keyboard; it has the rows so far.
    """
    orders = planned(experiment, over, changes, anyway=anyway)
    return run_planned(orders, processes, done, keep)


def run_planned(
    orders: Sequence[Planned],
    processes: int = 1,
    done: Callable[[Row], None] | None = None,
    keep: Path | None = None,
) -> list[Row]:
    """Make the runs of a sweep; arguments, result and errors are those of `sweep`."""
    if not isinstance(processes, int) or processes < 1:
        raise InvalidInputError(
            f"processes: must be a whole number of at least 1, not {short(processes)}"
        )
    store = None if keep is None else RowStore(keep)
    with nullcontext() if store is None else store.claimed():
        rows = _Rows(orders, store, processes > 1, done)
        workers = Processes(processes) if processes > 1 else ThisProcess()
        tasks = [[order] for order in rows.missing()]
        finished = carry_out(tasks, simulate_each, workers, rows.take)
        if not finished:
            raise InterruptedSweepError(rows.ended(), rows.lacking())
        if store is not None:
            store.remove()
    return rows.ended()


def planned(
    experiment: Described,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
    *,
    anyway: bool = False,
) -> list[Planned]:
    """Return the runs of a sweep, each checked as a whole; the arguments are those of `sweep`.

    Raises:
        InvalidInputError: As `sweep` does.
    """
    _check_axes(over)
    changes = changes or {}
    if both := sorted(over.keys() & changes.keys()):
        raise InvalidInputError(f"--over: {both[0]!r} is also set; it cannot be both")
    require_none_lost([*changes, *over], "--over")
    base = shared_document(experiment, changes)
    arms, followed = Arms(), set[str]()
    orders = []
    for values in product(*over.values()):
        changed = dict(zip(over, values, strict=True))
        loaded = load_experiment(base, changed, arms=arms)
        # To follow a path takes most of the time, and most combinations share it.
        path = _path_text(loaded)
        check_experiment(loaded, anyway, in_reach=path in followed)
        followed.add(path)
        contents = read_document(base, changed)
        order = order_of(contents, anyway=anyway, learning=True)
        orders.append(Planned(values, order, effort_of(loaded.document).time))
    return orders


def _check_axes(over: Mapping[str, Sequence[Any]]) -> None:
    """Raise an InvalidInputError unless each key has values, none of them twice."""
    require_type("over", over, Mapping)
    if not over:
        raise InvalidInputError("over: must have one key or more, not {}")
    for key, values in over.items():
        require_type(f"over.{key}", values, list, tuple)
        if not values:
            raise InvalidInputError(f"over.{key}: must have one value or more, not []")
        told = [short(value) for value in values]
        if twice := [each for each in told if told.count(each) > 1]:
            raise InvalidInputError(f"over.{key}: has the value {twice[0]} twice")


#: Keys of a document that decide whether its path is in reach, with what its law holds.
_REACH = ("arm", "task", "path", "level", "environment", "force", "start", "duration")


def _path_text(experiment: Experiment) -> str:
    contents = experiment.document.contents()
    told = [*(contents.get(key) for key in _REACH), experiment.holds_orientation]
    return json.dumps(told, default=repr)


class _Rows:
    """The rows of a sweep as they end, in whatever order.

    Args:
        orders: Values and order of each.
        store: Where rows are kept; None if nowhere.
        apart: Whether they are run in other processes.
        done: Called with each row when it is ready, in order.
    """

    def __init__(
        self,
        orders: Sequence[Planned],
        store: RowStore | None,
        apart: bool,
        done: Callable[[Row], None] | None,
    ) -> None:
        self._orders, self._store = orders, store
        self._apart, self._done = apart, done
        self._outcomes: dict[str, Outcome] = {}
        self._told = 0
        if store is not None:
            self._outcomes = kept_rows(store, [run.order for run in orders])

    def missing(self) -> list[Order]:
        """Return the orders that have no outcome, each once."""
        self._tell()
        every = {run.order.key: run.order for run in self._orders}
        return [order for key, order in every.items() if key not in self._outcomes]

    def take(self, order: Order, outcome: Outcome) -> None:
        """Take the outcome of an order."""
        if outcome.status == "refused" and self._apart:
            # Every combination was checked before, so the other process lacks something.
            raise InvalidInputError(
                f"{outcome.failure}; only this process knows it: name it so for the others, or run "
                "the sweep in one process"
            )
        if self._store is not None:
            self._store.put(order, outcome)
        self._outcomes[order.key] = outcome
        self._tell()

    def ended(self) -> list[Row]:
        """Return the rows that have ended, in their order."""
        return [
            _row(run.values, self._outcomes[run.order.key])
            for run in self._orders
            if run.order.key in self._outcomes
        ]

    def lacking(self) -> list[tuple[Any, ...]]:
        """Return the values of the rows that have not ended."""
        return [run.values for run in self._orders if run.order.key not in self._outcomes]

    def _tell(self) -> None:
        while self._told < len(self._orders):
            values, order, _ = self._orders[self._told]
            if order.key not in self._outcomes:
                return
            self._told += 1
            if self._done is not None:
                self._done(_row(values, self._outcomes[order.key]))


def _row(values: tuple[Any, ...], outcome: Outcome) -> Row:
    complete, learning = outcome.status == "complete", None
    if outcome.learning and complete:
        time, error = map(np.array, outcome.learning)
        learning = time, error
    return Row(
        values,
        outcome.metrics,
        None if complete else outcome.failure,
        outcome.not_met if complete else (),
        learning,
    )


def write_csv(file: Path, keys: Sequence[str], rows: Sequence[Row]) -> None:
    """Write all values and metrics of a sweep to a CSV file, one line per run.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    names = list(dict.fromkeys(name for row in rows for name in row.metrics))
    try:
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow([*keys, *names, "failure"])
            for row in rows:
                metrics = [repr(row.metrics[n]) if n in row.metrics else "" for n in names]
                writer.writerow([*row.values, *metrics, row.failure or ""])
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None
