"""The algebra of a chain of moving averages, of one robot or of many."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array


class Averages:
    """Moving averages of joint velocities, one window per joint and level, at rest at first.

    The windows of robots that stand side by side are the same; their bounds may differ. See
    `drake_rnn.systems.moving_average` for what is computed, and how it is rounded.

    Args:
        windows: Lengths of the windows in samples, shape (levels, n).
        velocity: Bounds of the velocities, shape (n,), or (n, robots) [rad/s].
        precompensate: Whether to amplify beforehand what the means attenuate.

    Attributes:
        shape: Shape of the state, (size,), or (size, robots).
    """

    def __init__(self, windows: NDArray[np.intp], velocity: Array, *, precompensate: bool) -> None:
        levels, n = windows.shape
        lengths = windows.astype(float).reshape(levels, n, *np.ones(velocity.ndim - 1, int))
        gain = (lengths**2 - 1.0).sum(axis=0) / 24.0
        self._windows = windows
        self._gain = gain if precompensate else None

        # Sums of fewer than 2^53 lattice steps are exact. Adding and subtracting 1.5 * 2^52 steps
        # rounds a number to the lattice, if it is small enough beside them.
        _, exponent = np.frexp(np.maximum(lengths, 4.0) * velocity)
        coarsest = np.ldexp(1.0, exponent.max(axis=0) - 53)
        self._most = np.floor(velocity / coarsest) * coarsest
        self._least = -self._most
        self._rounding = list(np.ldexp(1.5, exponent - 1))
        self._lengths = list(lengths)

        # The state: the number of samples, the two velocities before, the sums, and all windows one
        # after another; in each of them the newest value overwrites the oldest.
        first = 1 + 2 * n + levels * n
        self.shape = (first + int(windows.sum()), *velocity.shape[1:])
        self._previous, self._sums = slice(1, 1 + 2 * n), slice(1 + 2 * n, first)
        self._last = slice(first - n, first)
        ends = np.cumsum(windows.ravel()).reshape(windows.shape)
        self._starts = first + ends - windows

    def mean(self, x: Array) -> Array:
        """Return the last means, shape (n,) or (n, robots) [rad/s]."""
        mean: Array = x[self._last] / self._lengths[-1]
        return mean

    def add(self, x: Array, u: Array) -> Array:
        """Add velocities, shape (n,) or (n, robots) [rad/s], to a state, in place.

        Returns:
            The velocities that are averaged, which lie within their bounds.
        """
        n = len(u)
        if self._gain is not None:
            before, last = x[self._previous].reshape(2, n, *u.shape[1:])
            compensated = u - self._gain * (u - 2.0 * last + before)
            before[:] = last
            last[:] = u
            u = compensated
        added: Any = np.minimum(np.maximum(u, self._least), self._most)
        y, sums = added, x[self._sums].reshape(-1, n, *u.shape[1:])
        places = self._starts + int(x.item(0)) % self._windows
        levels = zip(places, sums, self._rounding, self._lengths, strict=True)
        for place, total, rounding, length in levels:
            y = (y + rounding) - rounding
            total += y - x[place]
            x[place] = y
            y = total / length
        x[0] += 1.0
        return added
