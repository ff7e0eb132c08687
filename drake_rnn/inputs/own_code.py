"""Errors in a user's own code, as a sentence that names the code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import DrakeRnnError, InvalidInputError


@contextmanager
def naming(
    place: str, t: float | None = None, *, but: type[Exception] = DrakeRnnError
) -> Iterator[None]:
    """Turn any error raised within into an `InvalidInputError` that names the place.

    Errors of this package already say what is wrong, and pass.

    Args:
        place: Code that runs within, e.g. ``MyLaw.step``.
        t: Simulated time [s]; None outside of a simulation.
        but: Further errors that pass.
    """
    try:
        yield
    except (DrakeRnnError, KeyboardInterrupt, but):
        raise
    except BaseException as error:
        raise InvalidInputError(f"{place} raised {described(error)}{at(t)}") from error


def described(error: BaseException) -> str:
    """Return an error as a text of one line: its class and its message."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def at(t: float | None) -> str:
    """Return a simulated time [s] as the end of a message; nothing for None."""
    return "" if t is None else f" (at t = {t:.6g} s)"
