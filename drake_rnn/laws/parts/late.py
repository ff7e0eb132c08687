"""What an arm has moved since a measurement that comes late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...inputs.fields import Array
from ..layout import Signals
from .newest import pushed

Kept = dict[str, Array]


@dataclass(frozen=True)
class Late:
    """The last commanded positions, as far back as the measurement.

    Attributes:
        samples: Number of samples by which measurements are late; 0 keeps nothing.
        size: Number n of joints.
    """

    samples: int
    size: int

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"q_late": (self.samples, self.size)} if self.samples else {}

    def start(self, u: Signals) -> Kept:
        """Return its parts of the initial state, by name."""
        return {name: np.broadcast_to(u["position"], s) for name, s in self.shapes.items()}

    def moved(self, kept: Kept, q: Array) -> tuple[Array | None, Kept]:
        """Return how far the joints were told to move since, None if nothing is late.

        And its parts of the next state.

        Args:
            kept: Its parts of the state, by name.
            q: Commanded positions now, shape (..., n) [rad].
        """
        if not self.samples:
            return None, {}
        rows = kept["q_late"]
        return q - rows[..., -1, :], {"q_late": pushed(rows, q, -2)}
