"""Sweeps: runs of one experiment with all combinations of some values."""

from __future__ import annotations

import csv
import json
from collections import deque
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
    require_apart,
    require_distinct,
    require_none_lost,
)
from ..inputs.documents import parse_yaml
from ..inputs.fields import (
    Array,
    checked,
    flag,
    function,
    instance,
    optional,
)
from ..inputs.messages import (
    require_type,
    short,
)
from ..runs.folder import written_whole
from ..runs.simulation import check_experiment, effort_of
from .campaign import kept_rows
from .plan import order_of, shared_document
from .requests import (
    Order,
    Outcome,
    RowStore,
    simulate_each,
)
from .workers import Processes, ThisProcess, carry_out


class Planned(NamedTuple):
    """A planned run of a sweep.

    Attributes:
        values: Values of the swept keys, in their order.
        order: Order of the run with these values.
        time: Estimated time of the run, within a factor of a few [s]; 0 if unknown.
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
        not_met: Metrics outside the bounds that they are expected to keep.
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


@checked(
    changes=instance(Mapping, None),
    done=optional(function()),
    anyway=flag,
    keep=instance(str, Path, None),
)
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

    Every combination is checked before the first run. A run that fails gets a row and does not stop
    the other runs.

    Args:
        experiment: A shipped name, a YAML file, a document or an experiment.
        over: Values to run, by dotted key.
        changes: New values of other keys, the same in each run.
        processes: Number of runs at a time; the results do not depend on it.
        done: Called with each row when it is ready, in order.
        anyway: Whether a run may take any number of steps.
        keep: Folder that keeps each ended row until all rows have ended; rows that the folder
            already holds are not run again.

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, a key
            is both swept and changed, or other processes do not know the classes that it names.
        InterruptedSweepError: If the user interrupts the sweep; the error holds the rows so far.
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
        known = _Outcomes(orders, store, processes > 1, done)
        every = {run.order.key: run.order for run in orders}
        tasks = [[order] for key, order in every.items() if key not in known.outcomes]
        workers = Processes(processes) if processes > 1 else ThisProcess()
        finished = carry_out(tasks, simulate_each, workers, known.take)
        ended = [run for run in orders if run.order.key in known.outcomes]
        rows = [_row(run.values, known.outcomes[run.order.key]) for run in ended]
        if not finished:
            missing = [run.values for run in orders if run.order.key not in known.outcomes]
            raise InterruptedSweepError(rows, missing)
        if store is not None:
            store.remove()
    return rows


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
    require_none_lost({**changes, **over}, "--over")
    require_apart(over, "--over")
    base = shared_document(experiment, changes)
    arms, followed = Arms(), set[str]()
    orders = []
    for values in product(*over.values()):
        changed = dict(zip(over, values, strict=True))
        loaded = load_experiment(base, changed, arms=arms)
        # Following a path takes most of the time, and most combinations share one path.
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
        if not isinstance(key, str):
            raise InvalidInputError(f"over: keys must be dotted keys, e.g. law.kappa, not {key!r}")
        require_type(f"over.{key}", values, list, tuple)
        if not values:
            raise InvalidInputError(f"over.{key}: must have one value or more, not []")
        require_distinct(f"over.{key}", values)


#: Keys that decide whether a path is in reach, besides whether the law holds the orientation.
_REACH = ("arm", "task", "path", "level", "environment", "force", "start", "duration")


def _path_text(experiment: Experiment) -> str:
    contents = experiment.document.contents()
    told = [*(contents.get(key) for key in _REACH), experiment.holds_orientation]
    return json.dumps(told, default=repr)


class _Outcomes:
    """The outcomes of a sweep's runs, which end in any order; rows are told of in theirs.

    Args:
        orders: The runs.
        store: Store of the outcomes; None to keep none.
        apart: Whether the runs are made in other processes.
        done: Called with each row when it is ready, in order.
    """

    def __init__(
        self,
        orders: Sequence[Planned],
        store: RowStore | None,
        apart: bool,
        done: Callable[[Row], None] | None,
    ) -> None:
        self._untold, self._store = deque(orders), store
        self._apart, self._done = apart, done
        kept = {} if store is None else kept_rows(store, [run.order for run in orders])
        self.outcomes: dict[str, Outcome] = kept
        self._tell()

    def take(self, order: Order, outcome: Outcome) -> None:
        """Take the outcome of an order."""
        if outcome.status == "refused" and self._apart:
            # This process has checked every combination, so the other one lacks a class.
            raise InvalidInputError(
                f"{outcome.failure}; only this process knows it: name it so for the others, or run "
                "the sweep in one process"
            )
        if self._store is not None:
            self._store.put(order, outcome)
        self.outcomes[order.key] = outcome
        self._tell()

    def _tell(self) -> None:
        while self._untold and (key := self._untold[0].order.key) in self.outcomes:
            row = _row(self._untold.popleft().values, self.outcomes[key])
            if self._done is not None:
                self._done(row)


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
        with written_whole(file) as stream:
            writer = csv.writer(stream)
            writer.writerow([*keys, *names, "failure"])
            for row in rows:
                metrics = [repr(row.metrics[n]) if n in row.metrics else "" for n in names]
                writer.writerow([*row.values, *metrics, row.failure or ""])
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None
