"""Runs that are kept in the folder of a report, and the numbers measured from them."""

from __future__ import annotations

import inspect
import json
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from ..campaigns import Order, Outcome
from ..campaigns.plan import order_of
from ..campaigns.store import RowStore
from ..claims import Claims, Quantity, RunSource
from ..diagrams import EXPERIMENTS
from ..errors import DrakeRnnError, InvalidInputError
from ..experiment import read_document
from ..experiment.fingerprint import stamp
from ..inputs.given_file import json_of
from ..runs.result import Result
from ..runs.whole_file import written_whole

#: Statuses of runs that may succeed when repeated, such as on a machine with more memory.
_FAILED = ("failed", "killed its worker")
_CLAIMS = Path(inspect.getfile(Claims)).parent
_ROWS = "rows"
# Names of the folders of runs, one for each state of the code.
_DIGEST = re.compile("[0-9a-f]{12}")


class MissingRunError(DrakeRnnError):
    """A run that has not been made yet.

    Attributes:
        order: What is to be run.
    """

    def __init__(self, order: Order) -> None:
        super().__init__(f"the run of {order.document['name']} has not been made")
        self.order = order


@dataclass(frozen=True)
class AskedRun:
    """A run that somebody asked for.

    Attributes:
        name: Name of a shipped experiment.
        changes: Its changes, by dotted key.
        order: What is to be run.
    """

    name: str
    changes: dict[str, Any]
    order: Order


class KeptRuns(RunSource):
    """Runs that are read from a folder.

    Each run is found by everything that it depends on, its document and the code, and each number
    also by the functions that measure it. Runs of other code are not read.

    Args:
        folder: The folder of the report, which is created if missing.

    Attributes:
        place: Folder of the runs of this code, each in a folder of the name of its key.
        rows: Outcomes of the runs, also of those that failed.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.place = folder / "runs" / sha256(stamp().encode()).hexdigest()[:12]
        self.rows = RowStore(self.place / _ROWS)
        self._orders: dict[str, Order] = {}
        self._asked: dict[str, list[AskedRun]] = {}

    def asked(self, name: str, changes: Mapping[str, Any] | None = None) -> AskedRun:
        """Return the run of an experiment with changes by dotted key.

        Raises:
            InvalidInputError: If the changes are none of this experiment.
        """
        given = dict(changes or {})
        key = json.dumps([name, given], sort_keys=True)
        if key not in self._orders:
            self._orders[key] = order_of(read_document(name, given))
        return AskedRun(name, given, self._orders[key])

    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            MissingRunError: If it has not been made.
            DrakeRnnError: If it was refused or has failed.
        """
        order = self._ended(name, changes)[0]
        try:
            return Result.load(self.place / order.key)
        except InvalidInputError:
            raise MissingRunError(order) from None

    def metrics(self, name: str, changes: Mapping[str, Any] | None = None, /) -> dict[str, float]:
        """Return the metrics of an experiment with changes by dotted key.

        Raises:
            MissingRunError: If it has not been made.
            DrakeRnnError: If it was refused or has failed.
        """
        return self._ended(name, changes)[1].metrics

    def measured(self, claims: Claims, quantity: Quantity) -> float:
        """Return the number that a measure gives, and keep it for the next time.

        Raises:
            MissingRunError: If a run that it looks at has not been made.
            DrakeRnnError: If one was refused or has failed.
        """
        name = _name_of(claims, quantity)
        if (known := self._known(name)) is not None:
            return known
        asked = self._asked[name] = []

        def run(experiment: str, changes: Mapping[str, Any] | None = None, /) -> Result:
            asked.append(self.asked(experiment, changes))
            return self.run(experiment, changes)

        measure = claims.measures[str(quantity.measure)]
        value = float(measure(run, **quantity.given))
        told = [[each.name, each.changes, each.order.key] for each in asked]
        file = self._file(name)
        file.parent.mkdir(exist_ok=True)
        with written_whole(file) as stream:
            stream.write(json.dumps({"value": value, "runs": told}))
        return value

    def used_by(self, claims: Claims, quantity: Quantity) -> list[AskedRun]:
        """Return the runs that a number was taken from; none if it has not been measured."""
        if quantity.run is not None:
            with suppress(InvalidInputError):
                return [self.asked(quantity.run, quantity.set)]
            return []
        return list(self._asked.get(_name_of(claims, quantity), []))

    def remove_others(self) -> None:
        """Remove the runs that reports of other code have kept, and nothing else."""
        for folder in self.place.parent.iterdir():
            kept = _DIGEST.fullmatch(folder.name) and (folder / _ROWS).is_dir()
            if kept and folder != self.place:
                shutil.rmtree(folder, ignore_errors=True)

    def forget_failed(self) -> None:
        """Forget the runs that failed or cannot be read, so that they are made again."""
        for key in self.rows.kept():
            outcome = self.rows.get(key)
            if outcome is not None and (outcome.status in _FAILED or not self._is_whole(key)):
                self.rows.forget(key)

    def _is_whole(self, key: str) -> bool:
        """Return whether the result of a run can be read; a run that was refused has none."""
        folder = self.place / key
        try:
            return not folder.is_dir() or bool(Result.load(folder))
        except InvalidInputError:
            return False

    def _ended(self, name: str, changes: Mapping[str, Any] | None) -> tuple[Order, Outcome]:
        order = self.asked(name, changes).order
        if (outcome := self.rows.get(order.key)) is None:
            raise MissingRunError(order)
        if outcome.status == "refused":
            raise InvalidInputError(outcome.failure)
        if outcome.status != "complete":
            raise DrakeRnnError(outcome.failure)
        return order, outcome

    def _known(self, name: str) -> float | None:
        """Return a number that was measured before, if its runs are still kept."""
        try:
            told = json_of(self._file(name))
            asked = [self.asked(each, changes) for each, changes, _ in told["runs"]]
            value = float(told["value"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if [each.order.key for each in asked] != [key for _, _, key in told["runs"]]:
            return None
        if not all(self.rows.get(each.order.key) for each in asked):
            return None
        self._asked[name] = asked
        return value

    def _file(self, name: str) -> Path:
        return self.place / "measured" / f"{name}.json"


def _name_of(claims: Claims, quantity: Quantity) -> str:
    """Return the name under which a measured number is kept, a digest of measure and code."""
    measure = claims.measures[str(quantity.measure)]
    told = [measure.__module__, measure.__name__, quantity.given, _code(measure.__module__)]
    return sha256(json.dumps(told, sort_keys=True, default=repr).encode()).hexdigest()[:32]


@cache
def _code(module: str) -> str:
    """Return a digest of a module with measures, its imports from claims, and all experiments."""
    digest = sha256()
    own = _CLAIMS / "papers" / f"{module.rpartition('.')[2]}.py"
    shipped = (file for file in EXPERIMENTS.rglob("*") if file.suffix in {".yaml", ".csv"})
    for file in (own, *sorted(_CLAIMS.glob("*.py")), *sorted(shipped)):
        if file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()
