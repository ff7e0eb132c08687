"""A given contact stiffness, with the same methods as `OnlineStiffness`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...inputs.fields import Array


@dataclass(frozen=True)
class FixedStiffness:
    """A linear spring: force is proportional to depth.

    Args:
        value: Stiffness [N/m].
    """

    value: Any

    #: Size of the state: nothing is stored.
    size = 0

    def start(self) -> Array:
        """Return the initial state, shape (0,)."""
        return np.zeros(0)

    def update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return the state unchanged, because nothing is learned."""
        return state

    def retreat_speed(self, state: Array, force: Any, desired: Any, gain: Any) -> Any:
        """Return the speed out of the surface that corrects the force error [m/s].

        Args:
            state: State, shape (..., 0).
            force: Measured force [N].
            desired: Desired force [N].
            gain: Gain of the feedback [1/s].
        """
        return gain * (force - desired) / self.value
