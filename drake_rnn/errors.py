"""The exceptions that this package raises; catching `DrakeRnnError` catches all of them."""

from __future__ import annotations

from typing import Any


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
