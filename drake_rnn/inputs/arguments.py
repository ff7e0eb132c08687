"""Checks of arguments where no `validated` class makes them: each refused by its name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from functools import wraps
from types import NoneType
from typing import Any, TypeVar

import numpy as np

from ..errors import InvalidInputError
from .complaints import nearest, require_type, short
from .fields import Array
from .numbers import is_number, is_whole

F = TypeVar("F", bound=Callable[..., Any])
#: Function of an argument's name and value that raises an `InvalidInputError` if it is wrong.
Check = Callable[[str, Any], None]


def checked(**checks: Check) -> Callable[[F], F]:
    """Return a decorator of a function, or of a class, whose arguments are checked before it runs.

    Defaults are not checked. What is missing or unknown is left to Python's own `TypeError`.

    Args:
        checks: For each argument, by its name, what checks it; in this order.
    """

    def decorate(made: F) -> F:
        function = made.__init__ if isinstance(made, type) else made  # type: ignore[misc]
        signature = inspect.signature(function)

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:
                given = {}
            for name, check in checks.items():
                if name in given:
                    check(name, given[name])
            return function(*args, **kwargs)

        if not isinstance(made, type):
            return call  # type: ignore[return-value]
        setattr(made, "__init__", call)  # noqa: B010  mypy forbids the assignment
        return made

    return decorate


def instance(*kinds: type | None) -> Check:
    """Return a check that a value is of one of these classes, or None if that is among them."""
    classes = tuple(NoneType if kind is None else kind for kind in kinds)
    return lambda key, value: require_type(key, value, *classes)


def optional(check: Check) -> Check:
    """Return a check that a value is None or passes another one."""

    def check_given(key: str, value: Any) -> None:
        if value is not None:
            check(key, value)

    return check_given


def number(least: float = -np.inf, *, above: float = -np.inf) -> Check:
    """Return a check that a value is a finite number of at least ``least`` and above ``above``."""
    bounds = [f" of at least {least:g}"] if least > -np.inf else []
    bounds += [f" above {above:g}"] if above > -np.inf else []

    def check(key: str, value: Any) -> None:
        if above == 0.0 and isinstance(value, float) and not 0.0 < value < np.inf:
            what = "positive" if value <= 0.0 else "positive and finite"
            raise InvalidInputError(f"{key}: must be {what}, not {short(value)}")
        if not is_number(value) or value < least or value <= above:
            raise InvalidInputError(
                f"{key}: must be a finite number{''.join(bounds)}, not {short(value)}"
            )

    return check


def whole(least: int = 0, most: int = 2**63 - 1) -> Check:
    """Return a check that a value is a whole number between two bounds."""

    def check(key: str, value: Any) -> None:
        if not is_whole(value) or value < least:
            raise InvalidInputError(
                f"{key}: must be a whole number of at least {least}, not {short(value)}"
            )
        if value > most:
            raise InvalidInputError(f"{key}: may be at most {most}, not {short(value)}")

    return check


def choice(names: Collection[str]) -> Check:
    """Return a check that a value is one of several names."""

    def check(key: str, value: Any) -> None:
        if not isinstance(value, str):
            raise InvalidInputError(f"{key}: may be {', '.join(names)}, not {short(value)}")
        if value not in names:
            raise InvalidInputError(f"{key}: no {value!r}; {nearest(value, list(names))}")

    return check


def each(*kinds: type) -> Check:
    """Return a check that a value is a list or tuple of objects of these classes."""

    def check(key: str, value: Any) -> None:
        if not isinstance(value, (list, tuple)):
            raise InvalidInputError(f"{key}: must be a list, not {short(value)}")
        for number, entry in enumerate(value):
            require_type(f"{key}[{number}]", entry, *kinds)

    return check


def function(of: str = "") -> Check:
    """Return a check that a value can be called, as a function ``of`` something."""

    def check(key: str, value: Any) -> None:
        if not callable(value):
            what = f"a function of {of}" if of else "a function"
            raise InvalidInputError(f"{key}: must be {what}, not {short(value)}")

    return check


def offering(*methods: str) -> Check:
    """Return a check that an object has methods of these names, of whatever class it is."""

    def check(key: str, value: Any) -> None:
        if not all(callable(getattr(value, name, None)) for name in methods):
            raise InvalidInputError(
                f"{key}: must have the methods {' and '.join(methods)}, not {short(value)}"
            )

    return check


def flag(key: str, value: Any) -> None:
    """Raise an InvalidInputError unless a value is true or false."""
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidInputError(f"{key}: must be true or false, not {short(value)}")


def vector(key: str, value: Any) -> None:
    """Raise an InvalidInputError unless a value is one list of finite numbers."""
    if not is_vector(value) or not np.isfinite(np.asarray(value, dtype=float)).all():
        raise InvalidInputError(f"{key}: must be one list of finite numbers, not {short(value)}")


def real_array(key: str, value: Any) -> Array:
    """Return a value as an array of floats; NaN and infinity are such.

    Raises:
        InvalidInputError: If it is no array of real numbers.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0, dtype=object)
    if array.dtype.kind not in "iuf" and array.size:
        raise InvalidInputError(f"{key}: must be real numbers, not {short(value)}")
    if array.dtype.kind == "O":
        raise InvalidInputError(f"{key}: must be real numbers, not {short(value)}")
    return np.asarray(array, dtype=float)


def is_flags(value: Any) -> bool:
    """Return whether a value is one list of true and false."""
    try:
        array = np.asarray(value)
    except ValueError:
        return False
    return array.ndim == 1 and array.dtype.kind == "b"


def is_vector(value: Any) -> bool:
    """Return whether a value is one list of real numbers; NaN and infinity are such."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return array.ndim == 1 and array.size > 0 and array.dtype.kind in "iuf"
