"""A contact whose stiffness is given, with the methods of one that is learned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...inputs.fields import Array


@dataclass(frozen=True)
class FixedStiffness:
    """A spring: force over depth is the same everywhere.

    Args:
        value: Stiffness [N/m].
    """

    value: float

    #: Entries of its state: it remembers nothing.
    size = 0

    def start(self) -> Array:
        """Return its first state, shape (0,)."""
        return np.zeros(0)

    def update(self, state: Array, force: float, desired: float, depth: float) -> Array:
        """Return the same state: it learns nothing."""
        return state

    def retreat_speed(self, state: Array, force: float, desired: float, gain: float) -> float:
        """Return the speed out of the surface that mends the force error [m/s].

        Args:
            state: Shape (0,).
            force: Measured force [N].
            desired: Force to press with [N].
            gain: Of the feedback [1/s].
        """
        return gain * (force - desired) / self.value
