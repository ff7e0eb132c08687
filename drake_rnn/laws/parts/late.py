"""The last values of something, and what an arm has moved since a measurement that comes late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array
from ..layout import Signals


def pushed(rows: Array, newest: Array, axis: int) -> Array:
    """Return the last values with one more, of which the oldest is dropped.

    Args:
        rows: The values along an axis, newest first, shape (..., k, ...).
        newest: The one more, without that axis.
        axis: The axis, counted from the end: -2 for vectors, -3 for matrices.
    """
    if rows.shape[axis] == 1:
        return newest[..., None, :] if axis == -2 else newest[..., None, :, :]
    kept = rows[..., :-1, :] if axis == -2 else rows[..., :-1, :, :]
    xp = functions_of(newest)
    return xp.concatenate((xp.expand_dims(newest, axis), kept), axis=axis)


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
