"""The files of a saved result: what they may hold, and how what they cannot hold is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..inputs.given_file import ArrayHead, arrays_of, content_of, heads_of, json_of
from ..signals import OF_EVERY_MOTION, SERIES_SHAPES

#: Whether a run came to its end, and if not, what stopped it.
Status = Literal["complete", "failed", "interrupted"]

_T = TypeVar("_T")
# What is driven or played may take longer than asked for: by this factor and time [s].
_LONGER, _LATER = 2.0, 60.0
# Largest number of numbers of a sample, and of samples beyond those that the document asks for.
_MOST_NUMBERS, _MORE_SAMPLES = 100_000, 1000
# What is said of a file itself begins with these words.
_OF_FILE = ("must ", "has ", "is ")
# Largest size of a diagram's text [bytes].
_MOST_TEXT = 10_000_000


def read_file(folder: Path, name: str, read: Callable[[Path], _T]) -> _T:
    """Return what a function reads from a file of a result.

    Raises:
        InvalidInputError: If the file is missing, or the function raises an OSError or ValueError.
    """
    try:
        return read(folder / name)
    except FileNotFoundError:
        why = f"{name} is missing" if folder.is_dir() else "there is no such folder"
    except OSError as error:
        why = f"{name}: {error.strerror or error}"
    except ValueError as error:
        said = str(error)
        why = f"{name} {said}" if said.startswith(_OF_FILE) else f"{name}: {said}"
    raise InvalidInputError(f"{folder}: holds no result: {why}")


def told_in(record: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return what the record of a folder says of its result: status, failure, warnings, timings.

    Raises:
        InvalidInputError: If no run has written it.
    """
    told = {
        "status": record.get("status", "complete"),
        "failure": record.get("failure", ""),
        "warnings": record.get("warnings", []),
        "timings": record.get("timings", {}),
    }
    warnings, timings = told["warnings"], told["timings"]
    right = {
        f"status must be one of {', '.join(get_args(Status))}": told["status"] in get_args(Status),
        "failure must be a text": isinstance(told["failure"], str),
        "warnings must be texts": isinstance(warnings, list)
        and all(isinstance(text, str) for text in warnings),
        "timings must be numbers by name": isinstance(timings, dict)
        and all(isinstance(value, (int, float)) for value in timings.values()),
    }
    for what, holds in right.items():
        if not holds:
            raise InvalidInputError(f"{folder}: holds no result: run.json: {what}")
    return told


def metrics_of(file: Path) -> dict[str, float]:
    """Return the metrics in a file, by name; OSError and ValueError if no run has written it."""
    metrics = json_of(file)
    if isinstance(metrics, dict):
        try:
            numbers = {name: value + 0.0 for name, value in metrics.items()}
        except (TypeError, OverflowError):
            pass
        else:
            return numbers
    raise ValueError("must hold numbers by name")


def graph_of(file: Path) -> str:
    """Return the text of a diagram; empty if there is none."""
    try:
        return content_of(file, _MOST_TEXT).decode()
    except FileNotFoundError:
        return ""


def series_of(file: Path, experiment: Experiment) -> dict[str, Array]:
    """Return the series in a file, ``time`` included.

    Args:
        file: The file.
        experiment: The experiment that was run.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it holds anything but series of such a run.
    """
    document = experiment.document
    most = _MORE_SAMPLES + int(_LONGER * document.duration / document.log_period)
    joints = len(experiment.arm.joints)
    _require_series(heads_of(file), joints, most)
    series = {name: np.asarray(each, dtype=float) for name, each in arrays_of(file).items()}
    time = series["time"]
    if not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise ValueError("time must be finite numbers that do not fall")
    longest = _LONGER * document.duration + _LATER
    if time.size and not (time[0] >= 0.0 and time[-1] <= longest):
        raise ValueError(f"time must be from 0 to {longest:g} s, not to {time[-1]:g} s")
    return series


def _require_series(heads: Mapping[str, ArrayHead], joints: int, most: int) -> None:
    """Refuse arrays that are none of a run.

    Args:
        heads: What is said of the arrays, by name.
        joints: Number of joints of the arm.
        most: Largest number of samples.
    """
    for name in ("time", *OF_EVERY_MOTION):
        if name not in heads:
            raise ValueError(f"{name} is missing")
    if len(heads["time"].shape) != 1:
        raise ValueError("time must be finite numbers that do not fall, shape (k,)")
    (count,) = heads["time"].shape
    if count > most:
        raise ValueError(f"has {count} samples, and its experiment makes at most {most}")
    if sum(head.size for head in heads.values()) > 8 * _MOST_NUMBERS * max(count, 1):
        raise ValueError(f"has more than {_MOST_NUMBERS} numbers at each time")
    lengths = {"n": joints}
    for name, head in heads.items():
        _require_shape(name, head.shape, count, lengths)


def _require_shape(name: str, shape: tuple[int, ...], count: int, lengths: dict[str, int]) -> None:
    """Refuse a series of another shape; lengths that were not known before are noted."""
    if shape[:1] != (count,):
        raise ValueError(f"{name} has shape {shape}, but there are {count} samples")
    if name not in SERIES_SHAPES or _fits(shape[1:], SERIES_SHAPES[name], lengths):
        return
    expected = ", ".join(
        str(lengths.get(each, each)) for each in (str(count), *SERIES_SHAPES[name])
    )
    raise ValueError(f"{name} has shape {shape}, not ({expected})")


def _fits(shape: tuple[int, ...], expected: tuple[str, ...], lengths: dict[str, int]) -> bool:
    """Return whether a shape is the expected one."""
    return len(shape) == len(expected) and all(
        lengths.setdefault(name, length) == length
        for name, length in zip(expected, shape, strict=True)
    )
