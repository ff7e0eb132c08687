r"""Time derivatives of signals by differences over the last samples.

Of the second order in the period h once there are three samples,
:math:`\dot s \approx (3 s_k - 4 s_{k-1} + s_{k-2}) / 2h`, of the first before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array
from ..layout import Signals
from .late import pushed

_SUFFIX = "_before"


@dataclass(frozen=True, eq=False)
class SignalRates:
    """What is kept of matrices that a law sees, and how fast they change.

    Attributes:
        signals: Shapes of the matrices, by name.
    """

    signals: Mapping[str, tuple[int, ...]]

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {f"{name}{_SUFFIX}": (2, *shape) for name, shape in self.signals.items()}

    def start(self, u: Signals) -> dict[str, Array]:
        """Return its parts of the initial state, by name."""
        shapes = self.shapes
        return {
            f"{name}{_SUFFIX}": np.broadcast_to(u[name], shapes[f"{name}{_SUFFIX}"])
            for name in self.signals
        }

    def advanced(
        self, kept: Signals, u: Signals, count: Array, period: float
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the rates by name, and its parts of the next state.

        Args:
            kept: Its parts of the state, by name.
            u: Signals at the sample.
            count: Number of samples before this one, shape (..., 1).
            period: Time between samples [s].
        """
        rates, after = {}, {}
        where = functions_of(count).where
        # At the first sample both differences vanish.
        second = where(count >= 2.0, 0.5, 0.0)[..., None]
        for name in self.signals:
            now, before = u[name], kept[f"{name}{_SUFFIX}"]
            last = now - before[..., 0, :, :]
            earlier = before[..., 0, :, :] - before[..., 1, :, :]
            rates[name] = (last + second * (last - earlier)) / period
            after[f"{name}{_SUFFIX}"] = pushed(before, now, -3)
        return rates, after
