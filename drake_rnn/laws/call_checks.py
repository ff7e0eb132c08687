"""What a law is given when it is called by hand, checked: time, state, signals and period.

- A controller has ports of the right sizes and checks what comes back, so that it runs the law
  without these checks, which take a few microseconds a call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from math import isfinite
from types import FunctionType, MethodType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays.algebra import (
    is_foreign,
    namespace,
)
from ..errors import InvalidInputError
from ..inputs.messages import is_number, short

#: Methods that are checked; all take time, state and signals, and `step` the period as well.
CHECKED_METHODS = ("step", "derivatives")
# Methods without checks, by those with; what a user puts around these is not among them.
_WITHOUT_CHECKS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
#: The type of numbers that a law computes with.
FLOAT = np.dtype(float)


def check_calls(cls: type) -> None:
    """Let the methods that a class itself defines check what they are given.

    And let `Law.sampled` refuse a period that is not below the inverse of each ``sampled_gains``:
    from there on a feedback takes away all of an error in a sample, and with twice as much swings.
    """
    own = vars(cls)
    for name in CHECKED_METHODS:
        if isinstance(method := own.get(name), FunctionType):
            setattr(cls, name, _with_checks(method))
    if isinstance(method := own.get("sampled"), FunctionType):
        setattr(cls, "sampled", _for_a_period(method))  # noqa: B010  mypy forbids the assignment


def without_checks(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a bound method of a law without the checks of what it is given."""
    if isinstance(method, MethodType) and isinstance(method.__func__, FunctionType):
        plain = _WITHOUT_CHECKS.get(method.__func__)
        return method if plain is None else MethodType(plain, method.__self__)
    return method


def _with_checks(method: Any) -> Any:
    @wraps(method)
    def checked(self: Any, t: Any, x: Any, u: Any, *period: Any, **named: Any) -> Any:
        if not _is_sound(self, t, x, u):
            _check(self, t, x, u)
        for value in (*period, *named.values()):
            _check_period(value)
        return method(self, t, x, u, *period, **named)

    _WITHOUT_CHECKS[checked] = method
    return checked


def _for_a_period(method: Any) -> Any:
    @wraps(method)
    def sampled(self: Any, period: Any) -> Any:
        _check_period(period)
        reading, gains = method(self, period), self.sampled_gains
        name = max(gains, key=lambda name: gains[name], default="")
        if name and gains[name] * period >= 1.0:
            raise InvalidInputError(
                f"period: must be below {1.0 / gains[name]:g} s with law.{name} at "
                f"{gains[name]:g} /s, not {period:g}; or give law.{name} below {1.0 / period:g} /s"
            )
        return reading

    return sampled


def _check_period(period: Any) -> None:
    if not is_number(period) or period <= 0.0:
        raise InvalidInputError(f"period: must be a positive time [s], not {short(period)}")


def _is_sound(law: Any, t: object, x: object, u: object) -> bool:
    """Return whether all is what it mostly is; where this denies, `_check` decides."""
    if not (type(t) is float and isfinite(t) and is_sound(x, (law.state.size,))):
        return False
    if type(u) is not dict:
        return False
    return all(is_sound(u.get(name), shape) for name, (_, shape) in law.inputs.parts.items())


def is_sound(value: Any, shape: tuple[int, ...]) -> bool:
    """Return whether a value is an array of floats of this shape, and finite.

    This is run at every sample and may, for a rare value, be wrong about what is sound: where it
    denies, the checks that raise decide.
    """
    return (
        type(value) is np.ndarray
        and value.dtype is FLOAT
        and value.shape == shape
        # For a few entries faster than NumPy.
        and isfinite(sum(value.ravel().tolist()))
    )


def _check(law: Any, t: object, x: object, u: object) -> None:
    """Raise an InvalidInputError unless time, state and signals are those of the law."""
    if not (is_number(t) or (law.takes_many and is_foreign(t))):
        raise InvalidInputError(f"t: must be a finite time [s], not {short(t)}")
    if isinstance(x, np.ndarray) and x.shape[1:] and x.shape[-1] == law.state.size:
        require_many(law)
    robots = _require("x", x, (law.state.size,), of_many=law.takes_many)
    if not isinstance(u, Mapping):
        raise InvalidInputError(f"u: must be a mapping of signals by name, not {short(u)}")
    for name, (_, shape) in law.inputs.parts.items():
        if name not in u:
            raise InvalidInputError(
                f"u: {type(law).__name__} sees {', '.join(law.inputs.parts)}; there is no {name}"
            )
        own = _require(
            name, u[name], shape, of_many=law.takes_many, gaps=name in law.inputs_with_gaps
        )
        if own not in ((), robots):
            shapes = " or ".join(str((*axes, *shape)) for axes in dict.fromkeys(((), robots)))
            raise InvalidInputError(
                f"{name}: must be an array of numbers, shape {shapes}, not {(*own, *shape)}"
            )


def require_many(law: Any) -> None:
    """Raise an InvalidInputError if a law, or a reading of one, runs one robot at a time."""
    if not law.takes_many:
        raise InvalidInputError(
            f"law: {type(law).__name__} runs one robot at a time; a law whose methods take robots "
            "along leading axes, in NumPy and JAX, declares takes_many = True"
        )


def _require(
    name: str, value: Any, shape: tuple[int, ...], *, of_many: bool, gaps: bool = False
) -> tuple[int, ...]:
    """Return the axes of robots before a shape.

    Raises:
        InvalidInputError: Unless an array of numbers has this shape after these axes, of which
            there are some of many only, and, of NumPy's, only finite numbers, or gaps as well.
    """
    expectation = f"{name}: must be an array of numbers, shape {shape}"
    foreign = of_many and is_foreign(value)
    if foreign:
        namespace(name, value)
    elif not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
        raise InvalidInputError(f"{expectation}, not {short(value)}")
    robots: tuple[int, ...] = value.shape[: value.ndim - len(shape)]
    if value.shape != (*robots, *shape) or (robots and not of_many):
        raise InvalidInputError(f"{expectation}, not {value.shape}")
    if not (foreign or gaps) and not np.isfinite(value).all():
        raise InvalidInputError(f"{name}: must be finite, not {short(value)}")
    return robots
