"""Where a sampled law takes its Jacobian from, if it is told: the middle of the coming sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...inputs.fields import Array
from ..layout import Signals


@dataclass(frozen=True)
class MiddleJacobian:
    """The Jacobian half a sample ahead, from the last two.

    A velocity held for a period moves the arm along a chord, which the Jacobian at its middle
    gives to the third order of the period, that at its beginning to the second only. The change
    over the last sample stands for that over the next.

    Attributes:
        task_size: Number m of rows.
        size: Number n of joints.
    """

    task_size: int
    size: int

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"J_before": (self.task_size, self.size)}

    def start(self, rng: np.random.Generator, u: Signals) -> dict[str, Array]:
        """Return its parts of the initial state, by name."""
        return {"J_before": u["J"]}

    def advanced(
        self, kept: dict[str, Array], u: Signals, period: float
    ) -> tuple[Array, dict[str, Array]]:
        """Return the Jacobian, shape (..., m, n), and its parts of the next state.

        Args:
            kept: Its parts of the state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
        """
        J = u["J"]
        return J + 0.5 * (J - kept["J_before"]), {"J_before": J}
