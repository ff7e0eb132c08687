"""One law with the numbers of many, so that one call serves robots with gains of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.dataclass_fields import fields_of, unchecked
from .called import require_many
from .law import Reading
from .trial import try_pair

_R = TypeVar("_R", bound=Reading)


def stacked(readings: Sequence[_R]) -> _R:
    """Return a reading with the numbers of many, for states with one leading axis.

    Numbers that differ have shape (count, 1), vectors that differ shape (count, n); what all have
    in common stays as it is. Options, sizes and what is given or not are the same for all.

    Args:
        readings: Readings of laws of one class, e.g. ``law.sampled(period)`` of each, which has
            checked them.

    Raises:
        InvalidInputError: If there are none, they differ in more than numbers, or are of a law
            that runs one robot at a time; or if two of them, tried side by side, do not get what
            each gets alone.
    """
    if not len(readings):
        raise InvalidInputError("laws: must be given")
    first = readings[0]
    require_many(first)
    differing: set[int] = set()
    together: _R = _stacked("", list(readings), differing)
    for other in sorted(differing) or [0]:
        pair = [first, readings[other]]
        try_pair(pair, _stacked("", pair, set()))
    return together


def with_gains(reading: _R, gains: Mapping[str, Any]) -> _R:
    """Return a reading with other numbers, which nothing checks: e.g. traced by JAX, or of many.

    Args:
        reading: Reading of a law.
        gains: Numbers, or arrays with an entry for each robot, shape (...), by field of the law,
            e.g. ``kappa`` or ``warm_up.rho``. Vectors have shape (..., n): ``limits.velocity``.

    Raises:
        InvalidInputError: If the law has no such number, or runs one robot at a time.
    """
    require_many(reading)
    for path, value in gains.items():
        reading = _replaced(reading, path, path, value)
    return reading


def _stacked(path: str, values: list[Any], differing: set[int]) -> Any:
    """Return values of a field together; of each that differs add a robot with another number."""
    first = values[0]
    kinds = {type(value) for value in values}
    if all(isinstance(value, float) for value in values):
        others = [robot for robot, value in enumerate(values) if value != first]
        differing.update(others[:1])
        return np.array(values)[:, np.newaxis] if others else first
    if kinds == {np.ndarray} and len({value.shape for value in values}) == 1:
        together = np.stack(values)
        others = np.flatnonzero((together != first).reshape(len(values), -1).any(axis=1)).tolist()
        differing.update(others[:1])
        return together if others else first
    if len(kinds) == 1 and fields_of(first):
        parts = {
            name: _stacked(
                f"{path}.{name}".lstrip("."), [fields_of(v)[name] for v in values], differing
            )
            for name in fields_of(first)
        }
        return unchecked(first, **parts)
    for number, value in enumerate(values):
        if type(value) is not type(first) or np.any(np.asarray(value != first)):
            raise InvalidInputError(
                f"laws[{number}]{'.' * bool(path)}{path}: must be as in laws[0], {short(first)}, "
                f"not {short(value)}; only numbers may differ"
            )
    return first


def _replaced(owner: Any, path: str, whole: str, value: Any) -> Any:
    fields = fields_of(owner)
    name, _, rest = path.partition(".")
    if name not in fields and "law" in fields:
        return unchecked(owner, law=_replaced(fields["law"], path, whole, value))
    known = fields.get(name)
    if rest and fields_of(known):
        return unchecked(owner, **{name: _replaced(known, rest, whole, value)})
    if rest or not isinstance(known, (float, np.ndarray)):
        raise InvalidInputError(f"law.{whole}: is no number of {type(owner).__name__}")
    if isinstance(known, float) and not isinstance(value, float):
        value = value[..., np.newaxis]
    return unchecked(owner, **{name: value})
