"""Checks of what a path returns, so that a wrong path is refused by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array

_COUNTS = {2: "two", 3: "three"}
# Distance up to which two points count as the same [m].
_MEET = 1e-6
# Largest entry by which a rotation matrix may miss being one.
_ROTATION = 1e-6


def require_values(
    name: str,
    function: Callable[[float], Any],
    argument: str,
    at: Iterable[float],
    shapes: Sequence[tuple[int, ...]],
) -> None:
    """Raise an InvalidInputError unless a function returns finite arrays of these shapes.

    Args:
        name: Name of the function in messages.
        function: The function.
        argument: Name of its argument.
        at: Arguments at which it is called.
        shapes: Shape of each array that it must return.
    """
    wanted = f"must return {_COUNTS[len(shapes)]} arrays of finite numbers, of shapes " + ", ".join(
        map(str, shapes)
    )
    for value in at:
        where = f"path: {name}({argument} = {value:.4g})"
        try:
            returned = function(value)
        except (InvalidInputError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise InvalidInputError(
                f"{where}: fails with {type(error).__name__}: {error}; it {wanted}"
            ) from error
        fault = _fault(returned, shapes)
        if fault:
            raise InvalidInputError(f"{where}: {wanted}, not {fault}")


def _fault(returned: Any, shapes: Sequence[tuple[int, ...]]) -> str:
    """Return what is wrong with returned arrays; empty if they are right."""
    if not isinstance(returned, (tuple, list)) or len(returned) != len(shapes):
        return short(returned)
    for value, shape in zip(returned, shapes, strict=True):
        try:
            array = np.asarray(value)
        except (TypeError, ValueError):
            return short(value)
        if array.dtype.kind not in "iuf":
            return short(value)
        if array.shape != shape:
            return f"one of shape {array.shape}"
        if not np.isfinite(array).all():
            return short(value)
    return ""


def require_times(name: str, duration: Any, traversal: Any) -> None:
    """Raise an InvalidInputError unless a path's duration and traversal are times."""
    for key, value, finite in (("duration", duration, False), ("traversal", traversal, True)):
        number = isinstance(value, (int, float)) and value > 0.0
        if not number or (finite and not math.isfinite(value)):
            kind = "a finite time" if finite else "a time"
            raise InvalidInputError(
                f"path: {name}.{key}: must be {kind} above 0 [s], not {short(value)}"
            )


def require_pose(p_WE: Any, R_WE: Any) -> None:
    """Raise an InvalidInputError unless a pose has the shapes (3,) and (3, 3); each may be None."""
    for key, value, shape in (("p_WE", p_WE, (3,)), ("R_WE", R_WE, (3, 3))):
        if value is not None and (fault := _fault([value], [shape])):
            raise InvalidInputError(
                f"{key}: must be finite numbers of shape {shape}, not {fault.removeprefix('one ')}"
            )
    if R_WE is not None and not _is_rotation(np.asarray(R_WE, dtype=float)):
        raise InvalidInputError(f"R_WE: must be a rotation matrix, not {short(R_WE)}")


def _is_rotation(R: Array) -> bool:
    off = np.abs(R @ R.T - np.eye(3)).max()
    return bool(off < _ROTATION and np.linalg.det(R) > 0.0)


def require_start(name: str, first: Array, last: Array | None) -> None:
    """Raise an InvalidInputError unless a path starts at its first point, and closes if it says so.

    Args:
        name: Name of the path's class.
        first: Displacement at the start, shape (3,) [m].
        last: Displacement at the end of a lap, shape (3,) [m]; None for an open path.
    """
    away = float(np.linalg.norm(first))
    if away > _MEET:
        raise InvalidInputError(
            f"path: {name} must start at its first point, with a displacement of zero, not "
            f"{away:.3g} m away"
        )
    if last is not None and (away := float(np.linalg.norm(last))) > _MEET:
        raise InvalidInputError(
            f"path: {name} says that it is closed, and a lap ends {away:.3g} m from where it began"
        )


def require_count(count: object) -> None:
    """Raise an InvalidInputError unless a number of points is a whole number of at least 1."""
    if not isinstance(count, (int, np.integer)) or count < 1:
        raise InvalidInputError(f"count: must be a whole number of at least 1, not {short(count)}")


def require_time(t: object) -> None:
    """Raise an InvalidInputError unless a time is a finite number."""
    if not isinstance(t, Real) or not math.isfinite(t):
        raise InvalidInputError(f"t: must be finite, not {short(t)}")
