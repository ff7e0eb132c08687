"""Where a sampled law takes its Jacobian from, if it is told: the middle of the coming sample."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...inputs.fields import Array
from ..layout import Signals
from .late import pushed

# Samples of J that are kept, of however late a measurement.
_LONGEST = 10


@dataclass(frozen=True)
class MiddleJacobian:
    """The Jacobian half a sample ahead, from the last ones.

    A velocity held for a period moves the arm along a chord, which the Jacobian at its middle
    gives to the third order of the period, that at its beginning to the second only. That is the
    error where the task is nearly an equality; the adaptive law's price of the task leaves more, in
    proportion to the period, and most of what is left as it is shipped. The change over the last
    sample stands for that over the next. Of a measurement that is late, the change
    over as many samples stands for that since then: over one alone, its errors would be multiplied.

    Attributes:
        task_size: Number m of rows.
        size: Number n of joints.
        late: Number of samples by which the posture that J is of is late.
    """

    task_size: int
    size: int
    late: int = 0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"J_before": (self._span, self.task_size, self.size)}

    @cached_property
    def _span(self) -> int:
        """Number of samples over which the change is taken."""
        return min(max(self.late, 1), _LONGEST)

    @cached_property
    def _ahead(self) -> float:
        """Share of that change that is to come until the middle of the sample."""
        return (self.late + 0.5) / self._span

    def start(self, rng: np.random.Generator, u: Signals) -> dict[str, Array]:
        """Return its parts of the initial state, by name."""
        return {"J_before": np.broadcast_to(u["J"], self.shapes["J_before"])}

    def advanced(
        self, kept: dict[str, Array], u: Signals, period: float
    ) -> tuple[Array, dict[str, Array]]:
        """Return Jacobian and parts of the next state, as `LearnedJacobian.advanced` does."""
        J = u["J"]
        before = kept["J_before"]
        return J + self._ahead * (J - before[..., -1, :, :]), {"J_before": pushed(before, J, -3)}
