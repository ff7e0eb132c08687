"""The last values of something, and what an arm has moved since a measurement that comes late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays.algebra import functions_of
from ...errors import InvalidInputError
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


# Share of a delay by which it may be off a multiple of the period.
_ROUNDING = 1e-9

Kept = dict[str, Array]


def samples_late(delay: float, period: float) -> int:
    """Return the number of samples by which measurements are late.

    Args:
        delay: Delay of the measurements [s].
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the delay is no multiple of the period.
    """
    late = delay / period
    if abs(late - round(late)) > _ROUNDING * max(late, 1.0):
        raise InvalidInputError(
            f"law.measurement.delay, in a document sensing.delay: must be a multiple of the "
            f"period, {period:g} s, not {delay:g}"
        )
    return round(late)


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
