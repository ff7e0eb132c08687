"""Requests of runs, which any process can carry out, and their records, both as plain data.

- The store of records: one file for each run, written whole or not at all.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import StrictBool, StrictFloat, TypeAdapter

from ..errors import DrakeRnnError, InvalidInputError
from ..experiment.files import row_key, stamp, surroundings
from ..inputs.fields import Array
from ..inputs.files import json_of
from ..inputs.messages import field_names, fields_of, plain
from ..runs.folder import claim_folder, written_whole
from ..runs.result import Result
from ..runs.series import RunOptions

#: How a run is carried out: by simulating its diagram, or in a batch of runs side by side.
Method = Literal["simulate", "batch"]
#: How a run ended: at its full duration; before it; refused for bad input; with a crash; or by the
#: user, which is never stored.
Ending = Literal["complete", "failed", "refused", "killed its worker", "interrupted"]


@dataclass(frozen=True)
class RunRequest:
    """A run to carry out, as plain data.

    Attributes:
        key: Name under which its record is stored; that of `request_of` depends on all that the
            numbers of the run depend on.
        document: Contents of the experiment's document.
        stamp: Versions of the packages that the run needs; empty for any.
        around: Digest of these versions and of the files that the document names.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run; the key depends on the method too.
        experiment: Name or file of the experiment; empty for one without.
        changes: Changes of that experiment by dotted key, of a row the values of what varies.
        folder: Folder for the whole result; None for a record alone.
        options: How the run is made.
    """

    key: str
    document: dict[str, Any]
    stamp: str = ""
    around: str = ""
    learning: bool = False
    method: Method = "simulate"
    experiment: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    options: RunOptions = field(default_factory=RunOptions)

    @property
    def effort(self) -> float:
        """Expected effort in steps of an arm without dynamics, at least 1."""
        noise = self.document.get("dither") or self.document.get("disturbance") or {}
        period = self.document.get("period") or _PERIOD
        steps = float(self.document["duration"] / min(period, noise.get("hold", period)))
        has_plant = self.document.get("level") in ("dynamic", "torque")
        return max(1.0, steps * (_DYNAMIC if has_plant else 1.0))


# Step that stands for those of an integrator [s], and the cost of a step with dynamics.
_PERIOD, _DYNAMIC = 1e-3, 4.0


def request_of(
    contents: Mapping[str, Any],
    *,
    anyway: bool = False,
    learning: bool = False,
    method: Method = "simulate",
    experiment: str = "",
    changes: Mapping[str, Any] | None = None,
) -> RunRequest:
    """Return the request of the run of a document.

    Args:
        contents: Contents of the document, with all changes.
        anyway: Whether the run may take any number of steps.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run.
        experiment: Name or file of the experiment.
        changes: Changes of that experiment, by dotted key.
    """
    document: dict[str, Any] = plain(contents)
    around = surroundings(document)
    # A run that is refused for its many steps is stored apart from the same run made anyway.
    text = f"row 2 {method}{' learning' * learning}{' anyway' * anyway}"
    key, values = row_key(document, around, text), dict(changes or {})
    options = RunOptions(anyway=anyway)
    return RunRequest(
        key, document, stamp(), around, learning, method, experiment, values, options=options
    )


def unique_requests(requests: Iterable[RunRequest]) -> list[RunRequest]:
    """Return requests in their order, of those with the same key the last one."""
    return list({request.key: request for request in requests}.values())


@dataclass(frozen=True)
class RunRecord:
    """What came of a run.

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

    status: Ending
    failure: str = ""
    until_s: StrictFloat = 0.0
    metrics: dict[str, StrictFloat] = field(default_factory=dict)
    kept: dict[str, StrictBool] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()
    learning: tuple[()] | tuple[list[StrictFloat], list[StrictFloat]] = ()
    wall_time_s: StrictFloat = 0.0
    method: Method = "simulate"

    @property
    def complete(self) -> bool:
        """Whether the run reached its full duration."""
        return self.status == "complete"

    @property
    def not_met(self) -> tuple[str, ...]:
        """Metrics outside the bounds that they are expected to keep."""
        return tuple(name for name, is_met in self.kept.items() if not is_met)

    def require_complete(self) -> None:
        """Raise a DrakeRnnError if the run did not complete, an InvalidInputError if refused."""
        if self.status == "refused":
            raise InvalidInputError(self.failure)
        if not self.complete:
            raise DrakeRnnError(self.failure)

    @classmethod
    def of_result(cls, result: Result, learning: bool = False) -> Self:
        """Return the record of a result.

        Args:
            result: The result, as far as the run came.
            learning: Whether the error of a learned Jacobian is wanted over time.
        """
        return cls(
            status=result.status,
            failure=result.failure,
            until_s=result.record["until_s"],
            metrics={name: float(value) for name, value in result.metrics.items()},
            kept=_kept(result),
            accepted=tuple(result.experiment.document.accept),
            learning=_learning(result) if learning else (),
        )

    def contents(self) -> dict[str, Any]:
        """Return the record as plain data that JSON can hold, bit for bit."""
        contents: dict[str, Any] = plain(fields_of(self))
        return contents

    @classmethod
    def of(cls, contents: Any) -> RunRecord:
        """Return the record with these `contents`.

        Raises:
            ValueError: If the contents are not those of a record.
        """
        names = field_names(cls)
        if not isinstance(contents, dict) or not contents.keys() >= {*names}:
            raise ValueError("no record of a run")
        try:
            return _RECORD.validate_python({name: contents[name] for name in names})
        except OverflowError as error:
            raise ValueError("no record of a run") from error


def _kept(result: Result) -> dict[str, bool]:
    """Return which bounds are kept, by metric; those of a second arm behind ``second.``."""
    kept = {verdict.metric: verdict.met for verdict in result.verdicts}
    if result.second is not None:
        kept |= {f"second.{verdict.metric}": verdict.met for verdict in result.second.verdicts}
    return kept


def _learning(result: Result) -> tuple[()] | tuple[list[float], list[float]]:
    if "J_hat" not in result.series:
        return ()
    difference = result.series["J"] - result.series["J_hat"]
    norm = np.asarray(np.linalg.norm(difference, axis=(1, 2)))
    return result.time.tolist(), norm.tolist()


#: Function that carries out a task, which is a list of requests, in any process. The record of a
#: request must not depend on the other requests of the task.
Perform = Callable[[Sequence[RunRequest]], Sequence[RunRecord]]


_RECORD = TypeAdapter(RunRecord)


@dataclass(frozen=True)
class Row:
    """One run of a sweep or a comparison.

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

    @classmethod
    def of(cls, request: RunRequest, record: RunRecord) -> Row:
        """Return the row of a request and its record."""
        values = tuple(request.changes.values())
        if not record.complete:
            return cls(values, record.metrics, record.failure)
        learning = None
        if record.learning:
            time, error = map(np.array, record.learning)
            learning = time, error
        return cls(values, record.metrics, None, record.not_met, learning)


class RecordStore:
    """A folder with the record of each run that has ended.

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

    def get(self, key: str) -> RunRecord | None:
        """Return the record stored under a key; None if it is missing or damaged."""
        try:
            return RunRecord.of(json_of(self._file(key)))
        except (OSError, ValueError):
            return None

    def records(self, requests: Iterable[RunRequest], again: bool = False) -> dict[str, RunRecord]:
        """Return the records stored for requests, by their keys.

        Args:
            requests: The requests.
            again: Whether to leave out runs whose worker crashed, so that they are retried.
        """
        entries = {request.key: self.get(request.key) for request in requests}
        return {
            key: record
            for key, record in entries.items()
            if record is not None and not (again and record.status == "killed its worker")
        }

    def put(self, request: RunRequest, record: RunRecord) -> None:
        """Store the record of a request.

        Raises:
            InvalidInputError: If it cannot be written.
        """
        file = self._file(request.key)
        contents = {**record.contents(), "versions": request.stamp, "document": request.document}
        try:
            file.parent.mkdir(exist_ok=True)
            with written_whole(file) as stream:
                stream.write(json.dumps(contents, default=repr))
        except OSError as error:
            raise InvalidInputError(f"row {file}: {error.strerror}") from None

    def all_keys(self) -> list[str]:
        """Return the keys under which something is stored."""
        return sorted(file.stem for file in self.folder.glob("*/*.json"))

    def forget(self, key: str) -> None:
        """Remove what is stored under a key."""
        self._file(key).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @contextmanager
    def claim(self) -> Iterator[None]:
        """Keep other processes from working at the same records within a with-block.

        The operating system releases the lock when this process ends, however it ends.

        Raises:
            InvalidInputError: If another process holds the lock.
        """
        with claim_folder(self.folder):
            yield

    def _file(self, key: str) -> Path:
        # A folder with many thousand files is slow.
        return self.folder / key[:2] / f"{key}.json"
