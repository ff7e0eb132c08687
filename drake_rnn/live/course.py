"""A motion that is written piece by piece while it is followed."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from ..inputs.fields import Array

# Pieces that are forgotten together.
_MANY = 256


class Course:
    """A motion in pieces of constant acceleration, written up to a time that only grows.

    What has been written never changes, so values at times before `until` are those of a function
    of time. Beyond, the last piece goes on, which matters for rounding errors of a time alone.

    Args:
        value: Value at time 0, shape (k,).
        rate: Its rate from then on, shape (k,) [1/s]; zero if None.
    """

    def __init__(self, value: Array, rate: Array | None = None) -> None:
        self.until = 0.0
        p = np.array(value, dtype=float)
        v = np.zeros_like(p) if rate is None else np.array(rate, dtype=float)
        self._begins, self._pieces = [0.0], [(p, v, np.zeros_like(p))]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Return value, rate and acceleration at a time [s]; at rest before the first piece."""
        k = bisect_right(self._begins, t) - 1
        p, v, a = self._pieces[max(k, 0)]
        if k < 0:
            return p, np.zeros_like(p), np.zeros_like(p)
        since = t - self._begins[k]
        return p + since * v + 0.5 * since**2 * a, v + since * a, a

    def go_on(self, until: float, acceleration: Array) -> None:
        """Write the next piece, up to a later time [s].

        Args:
            until: Time at which it ends [s].
            acceleration: Its acceleration, shape (k,) [1/s^2].
        """
        p, v, a = self.at(self.until)
        # A motion that goes on as it was is one piece, exact however long it takes.
        if np.any(acceleration != 0.0) or np.any(a != 0.0):
            self._begins.append(self.until)
            self._pieces.append((p, v, np.array(acceleration, dtype=float)))
        self.until = until

    def forget(self, before: float) -> None:
        """Forget the pieces that end before a time [s], which is not asked for again."""
        k = bisect_right(self._begins, before) - 1
        if k >= _MANY:
            del self._begins[:k], self._pieces[:k]
