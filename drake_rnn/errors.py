"""What this package raises. Whoever catches DrakeRnnError catches all of it."""

from __future__ import annotations

from typing import Any


class DrakeRnnError(Exception):
    """Base of all errors raised on purpose by this package."""


class InvalidInputError(DrakeRnnError, ValueError):
    """Something given is not what it may be; says which thing, its value and what it may be."""


class SimulationError(DrakeRnnError, RuntimeError):
    """A run could not go on.

    Attributes:
        time: Simulated time at which it stopped [s].
        result: The `drake_rnn.Result` that `drake_rnn.simulate` had until then, or None.
    """

    # Errors stand below everything else: they do not import what raises them.
    result: Any = None

    def __init__(self, message: str, time: float) -> None:
        super().__init__(f"{message} (at t = {time:.6g} s)")
        self.time = time


class InterruptedRunError(SimulationError):
    """A run was interrupted from the keyboard."""
