r"""The fastest stop of joints whose velocities are held, and whose accelerations are bounded.

A velocity w is held for a period h; then each joint loses a h of its speed at every sample, until
it rests. After k samples, with m = min(k - 1, floor(|w| / (a h))), it is

.. math::
    (m + 1) h |w| - \tfrac12 m (m + 1) a h^2

from where it was. After its first sample, what is left of a stop is the stop from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..inputs.fields import Array

# A loss of speed that stops any joint within a sample [rad/s].
_AT_ONCE = 1e9


@dataclass(frozen=True, eq=False)
class HeldStop:
    """The fastest stop of n joints.

    Attributes:
        acceleration: Their bounds, shape (n,) [rad/s^2]; may be infinite.
        period: Time for which a velocity is held [s].
    """

    acceleration: Array
    period: float

    def after(self, v: Array) -> Array:
        """Return the velocities one sample later, shape (n,) [rad/s].

        Args:
            v: Velocities, shape (n,) [rad/s].
        """
        slower = np.maximum(np.abs(v) - self.acceleration * self.period, 0.0)
        return np.copysign(slower, v)

    def samples(self, w: Array) -> float:
        """Return after how many samples all joints rest that have velocities w, shape (n,)."""
        return float(self._braking(w).max()) + 1.0

    def way(self, w: Array) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return self._gone(np.abs(w), self._braking(w))

    def moved(self, w: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad].

        Args:
            w: Velocities in the first of them, shape (n,) [rad/s].
            k: Numbers of samples, at least 0, shape (s,); between two, velocities are held.
        """
        whole, speed, k = np.floor(k)[:, None], np.abs(w), k[:, None]
        gone = self._gone(speed, np.minimum(whole - 1.0, self._braking(w)))
        if np.count_nonzero(part := k - whole):
            gone = gone + part * self.period * np.maximum(speed - whole * self._loss, 0.0)
        return np.copysign(gone, w)

    def gone(self, w: Array, k: Array) -> tuple[Array, Array]:
        """Return what `moved` does, and the way of each joint until then, shape (s, n) [rad].

        None turns on it.
        """
        moved = self.moved(w, k)
        return moved, np.abs(moved)

    def leverage(self, w: Array, k: Array) -> Array:
        """Return by how much a change of w moves the joints after k samples, shape (s, n) [s].

        Args:
            w: Velocities, shape (n,) [rad/s].
            k: Numbers of samples, at least 1, shape (s,).
        """
        return self.period * (1.0 + np.minimum(k[:, None] - 1.0, self._braking(w)))

    def _braking(self, w: Array) -> Array:
        """Return for how many samples a joint brakes before it rests, shape (n,)."""
        return np.floor(np.abs(w) / self._loss)

    def _gone(self, speed: Array, m: Array) -> Array:
        """Return how far a joint has gone after m + 1 samples, in m of which it braked."""
        return (m + 1.0) * (self.period * speed - m * self._half)

    @cached_property
    def _loss(self) -> Array:
        """What a joint loses of its speed in a sample; a number also where it may stop at once."""
        return np.minimum(self.acceleration * self.period, _AT_ONCE)

    @cached_property
    def _half(self) -> Array:
        return 0.5 * self.period * self._loss
