"""Sweeps: runs of one experiment at many values."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import Described, load_experiment, read_document
from ..inputs.complaints import require_type, short
from ..inputs.documents import parse_yaml
from ..inputs.fields import Array
from .result import Result
from .simulation import check_experiment, simulate


class Job(NamedTuple):
    """A run of a sweep, as plain data that another process understands.

    Attributes:
        experiment: Name, file or contents of the document.
        changes: New values by dotted key.
        values: Those of the swept keys, in their order.
    """

    experiment: str | Path | dict[str, Any]
    changes: dict[str, Any]
    values: tuple[Any, ...]


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

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, a key
            is both swept and changed, or other processes do not know the classes that it names.
    """
    return run_jobs(checked_jobs(experiment, over, changes), processes, done)


def checked_jobs(
    experiment: Described,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
) -> list[Job]:
    """Return the runs of a sweep, each of them checked; the arguments are those of `sweep`.

    Raises:
        InvalidInputError: As `sweep` does.
    """
    _check_axes(over)
    if both := sorted(over.keys() & (changes or {}).keys()):
        raise InvalidInputError(f"--over: {both[0]!r} is also set; it cannot be both")
    if not isinstance(experiment, (str, Path)):
        # Only plain data can be sent to another process.
        experiment = read_document(experiment)
    jobs = []
    for values in product(*over.values()):
        changed = {**(changes or {}), **dict(zip(over, values, strict=True))}
        check_experiment(load_experiment(experiment, changed))
        jobs.append(Job(experiment, changed, values))
    return jobs


def run_jobs(
    jobs: Sequence[Job], processes: int = 1, done: Callable[[Row], None] | None = None
) -> list[Row]:
    """Make the runs of a sweep; the arguments are those of `sweep`."""
    if not isinstance(processes, int) or processes < 1:
        raise InvalidInputError(
            f"processes: must be a whole number of at least 1, not {short(processes)}"
        )
    rows = []
    for row in _run_all(jobs, processes):
        rows.append(row)
        if done is not None:
            done(row)
    return rows


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


def _run_all(jobs: Sequence[Job], processes: int) -> Iterator[Row]:
    if processes <= 1:
        yield from map(_run, jobs)
        return
    # Drake has started threads, which a forked process would not inherit.
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        try:
            yield from pool.map(_run, jobs)
        except InvalidInputError as error:
            raise InvalidInputError(
                f"{error}; only this process knows it: name it so for the others, or run the sweep "
                "in one process"
            ) from None


def _run(job: Job) -> Row:
    described, changed, values = job
    # Every combination was checked before, so what is refused now is unknown to this process.
    experiment = load_experiment(described, changed)
    try:
        result = simulate(experiment)
        not_met = tuple(verdict.metric for verdict in result.verdicts if not verdict.met)
        return Row(values, result.metrics, not_met=not_met, learning=_learning(result))
    except InterruptedRunError:
        raise
    except SimulationError as error:
        metrics = {} if error.result is None else error.result.metrics
        return Row(values, metrics, str(error))
    except DrakeRnnError as error:
        return Row(values, {}, str(error))


def _learning(result: Result) -> tuple[Array, Array] | None:
    if "J_hat" not in result.series:
        return None
    difference = result.series["J"] - result.series["J_hat"]
    return result.time, np.asarray(np.linalg.norm(difference, axis=(1, 2)))


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
