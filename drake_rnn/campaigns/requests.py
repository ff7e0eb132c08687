"""Orders of runs, which any process can carry out, and their outcomes, both as plain data.

- Functions that carry out orders, in any process.
- Rows of a campaign on disk: one file for each row, written whole or not at all.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import local
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import Arms, make_experiment
from ..experiment.fingerprint import stamp
from ..inputs.files import json_of
from ..inputs.kinds import described
from ..inputs.messages import field_names, fields_of, plain
from ..runs.folder import claimed, written_whole
from ..runs.result import Result
from ..runs.series import Series
from ..runs.simulation import simulate

#: How a run is carried out: by simulating its diagram, or in a batch of runs side by side.
Method = Literal["simulate", "batch"]
#: How a run ended: at its full duration; before it; refused for bad input; or with a crash.
Ended = Literal["complete", "failed", "refused", "killed its worker"]


@dataclass(frozen=True)
class Order:
    """A run to carry out, as plain data.

    Attributes:
        key: Name under which the outcome is kept, see `row_key`.
        document: Contents of the experiment's document.
        stamp: Versions of the packages that the run needs.
        around: Digest of these versions and of the files that the document names.
        anyway: Whether the run may take any number of steps.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run; the key depends on the method too.
    """

    key: str
    document: dict[str, Any]
    stamp: str
    around: str
    anyway: bool = False
    learning: bool = False
    method: Method = "simulate"


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run.

    Attributes:
        status: How the run ended.
        failure: Why the run did not complete; empty if it did.
        until_s: Simulated time that the run reached [s].
        metrics: Metrics up to that time, by name.
        kept: Whether each metric that is expected to keep a bound keeps it, by name.
        accepted: Metrics whose bounds stand in the document, under ``accept``.
        learning: Times [s] and Frobenius norms of J - J_hat; empty unless asked for and learned.
        wall_time_s: Wall time of the run, loading included [s]; in a batch, its share.
        method: How the run was carried out: a run that a batch refuses is simulated.
    """

    status: Ended
    failure: str = ""
    until_s: float = 0.0
    metrics: dict[str, float] = field(default_factory=dict)
    kept: dict[str, bool] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()
    learning: tuple[list[float], ...] = ()
    wall_time_s: float = 0.0
    method: Method = "simulate"

    @property
    def not_met(self) -> tuple[str, ...]:
        """Metrics outside the bounds that they are expected to keep."""
        return tuple(name for name, met in self.kept.items() if not met)

    def contents(self) -> dict[str, Any]:
        """Return the outcome as plain data that JSON can hold, bit for bit."""
        contents: dict[str, Any] = plain(fields_of(self))
        return contents

    @classmethod
    def of(cls, contents: Any) -> Outcome:
        """Return the outcome with these `contents`.

        Raises:
            ValueError: If the contents are not those of an outcome.
        """
        names = field_names(cls)
        if not isinstance(contents, dict) or not contents.keys() >= {*names}:
            raise ValueError("no outcome of a run")
        if contents["status"] not in get_args(Ended):
            raise ValueError(f"no status of a run: {contents['status']!r}")
        if contents["method"] not in get_args(Method):
            raise ValueError(f"no method of a run: {contents['method']!r}")
        values = {name: contents[name] for name in names}
        _require_kinds(values)
        values["accepted"] = tuple(values["accepted"])
        values["learning"] = tuple(values["learning"])
        return cls(**values)


def _require_kinds(values: Mapping[str, Any]) -> None:
    """Raise a ValueError unless the contents of an outcome are of the kinds that a run writes."""
    metrics, kept, learning = values["metrics"], values["kept"], values["learning"]
    right = (
        isinstance(values["failure"], str),
        all(map(_is_number, (values["until_s"], values["wall_time_s"]))),
        isinstance(metrics, dict) and all(map(_is_number, metrics.values())),
        isinstance(kept, dict) and all(isinstance(each, bool) for each in kept.values()),
        isinstance(values["accepted"], list)
        and all(isinstance(each, str) for each in values["accepted"]),
        isinstance(learning, list)
        and len(learning) in (0, 2)
        and all(isinstance(each, list) and all(map(_is_number, each)) for each in learning),
    )
    if not all(right):
        raise ValueError("no outcome of a run")


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return isinstance(float(value), float)
    except OverflowError:
        return False


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


class RowStore:
    """A folder with the outcome of each run that has ended.

    Even if this process is killed, each file is complete or absent. The name of a file is a digest
    of all that its numbers depend on.

    Args:
        folder: The folder, which is created if missing.

    Raises:
        InvalidInputError: If it cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInputError(f"rows {folder}: {error.strerror}") from None

    def get(self, key: str) -> Outcome | None:
        """Return the outcome kept under a key; None if it is missing or damaged."""
        try:
            return Outcome.of(json_of(self._file(key)))
        except (OSError, ValueError):
            return None

    def put(self, order: Order, outcome: Outcome) -> None:
        """Keep the outcome of an order.

        Raises:
            InvalidInputError: If it cannot be written.
        """
        file = self._file(order.key)
        contents = {**outcome.contents(), "versions": order.stamp, "document": order.document}
        try:
            file.parent.mkdir(exist_ok=True)
            with written_whole(file) as stream:
                stream.write(json.dumps(contents, default=repr))
        except OSError as error:
            raise InvalidInputError(f"row {file}: {error.strerror}") from None

    def kept(self) -> list[str]:
        """Return the keys under which something is kept."""
        return sorted(file.stem for file in self.folder.glob("*/*.json"))

    def forget(self, key: str) -> None:
        """Forget what is kept under a key."""
        self._file(key).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Keep other processes from working at the same rows within a with-block.

        The operating system releases the lock when this process ends, however it ends.

        Raises:
            InvalidInputError: If another process holds the lock.
        """
        with claimed(self.folder):
            yield

    def _file(self, key: str) -> Path:
        # A folder with many thousand files is slow.
        return self.folder / key[:2] / f"{key}.json"
