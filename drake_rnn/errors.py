"""The exceptions that this package raises, and its warnings of old names.

Catching `DrakeRnnError` catches all exceptions.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])
_PACKAGE = __name__.partition(".")[0]


class DrakeRnnError(Exception):
    """Base class of all errors raised on purpose by this package."""


class InvalidInputError(DrakeRnnError, ValueError):
    """An invalid input; the message gives its name, its value and what it may be."""


class SimulationError(DrakeRnnError, RuntimeError):
    """A run that could not continue.

    Attributes:
        time: Simulated time at which the run stopped [s].
        result: The `drake_rnn.Result` of `drake_rnn.simulate` up to that time, or None.
    """

    # Typed as Any, because this module must not import the modules that raise its errors.
    result: Any = None

    def __init__(self, message: str, time: float) -> None:
        super().__init__(f"{message} (at t = {time:.6g} s)")
        self.time = time


class InterruptedRunError(SimulationError):
    """A run that was interrupted, from the keyboard or by SIGTERM.

    If that was after its last step, its ``result`` is complete.
    """


class RobotError(DrakeRnnError, RuntimeError):
    """A robot that cannot be driven as it was found; nothing was commanded."""


class UnprotectedWarning(UserWarning):
    """What commands are not kept from: bodies without shapes, pairs that touch at home, bounds."""


def warn_unprotected(doubts: Sequence[str]) -> None:
    """Warn of what commands are not kept from, once, at the call from outside of this package.

    Args:
        doubts: What that is, in sentences; nothing is said without any.
    """
    if not doubts:
        return
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn("; ".join(doubts), UnprotectedWarning, stacklevel=level)


class OldName:
    """An attribute of a class under an old name, which works until the next release.

    Args:
        new: Name of the attribute.
    """

    def __init__(self, new: str) -> None:
        self._new = new
        self._old = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = f"{owner.__name__}.{name}"

    def __get__(self, instance: object, owner: type) -> Any:
        if instance is None:
            return self
        warnings.warn(
            f"{self._old} is now {self._new}; its old name works until the next release",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(instance, self._new)


def old_arguments(**names: str) -> Callable[[F], F]:
    """Return a decorator of a function whose arguments have old names, until the next release.

    Args:
        names: The new name of an argument, by the old one.
    """

    def decorate(function: F) -> F:
        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            for old in names.keys() & kwargs.keys():
                warnings.warn(
                    f"{function.__qualname__}: {old} is now {names[old]}; its old name works until "
                    "the next release",
                    DeprecationWarning,
                    stacklevel=2,
                )
                kwargs[names[old]] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call  # type: ignore[return-value]

    return decorate
