"""Figures of numbers of many robots that come step by step, each of shape (robots,)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array

# Bins of a histogram: a bin is a factor of 10^(1 / 200), 1.2 % wide, and the first begins at 1e-9.
_PER_DECADE, _LEAST, _BINS = 200, 9, 2400


class Largest:
    """The largest of all numbers.

    Args:
        count: Number of robots.
    """

    def __init__(self, count: int) -> None:
        self._value = np.full(count, -np.inf)

    def add(self, numbers: Array) -> None:
        """Add numbers, shape (..., robots)."""
        top = numbers if numbers.ndim == 1 else numbers.max(axis=0)
        np.maximum(self._value, top, out=self._value)

    @property
    def value(self) -> Array:
        """The largest; not a number where there were none."""
        return np.where(np.isinf(self._value), np.nan, self._value)


class Smallest:
    """The smallest of all numbers.

    Args:
        count: Number of robots.
    """

    def __init__(self, count: int) -> None:
        self._value = np.full(count, np.inf)

    def add(self, numbers: Array) -> None:
        """Add numbers, shape (..., robots)."""
        low = numbers if numbers.ndim == 1 else numbers.min(axis=0)
        np.minimum(self._value, low, out=self._value)

    @property
    def value(self) -> Array:
        """The smallest; not a number where there were none."""
        return np.where(np.isinf(self._value), np.nan, self._value)


class Mean:
    """The mean of all numbers.

    Args:
        count: Number of robots.
    """

    def __init__(self, count: int) -> None:
        self._sum = np.zeros(count)
        self._count = 0.0

    def add(self, numbers: Array, weight: float = 1.0) -> None:
        """Add numbers, shape (robots,), each as often as ``weight`` says."""
        self._sum += numbers if weight == 1.0 else weight * numbers
        self._count += weight

    def pass_by(self, weight: float) -> None:
        """Add zeros as often as ``weight`` says."""
        self._count += weight

    @property
    def value(self) -> Array:
        """The mean; not a number where there were none."""
        return self._sum / self._count if self._count else np.full(self._sum.size, np.nan)

    @property
    def root(self) -> Array:
        """The root of the mean."""
        return np.sqrt(self.value)


class Median:
    """The median of all numbers, from a histogram: within 0.6 % of it, from 1e-9 to 1e3.

    Args:
        count: Number of robots.
    """

    def __init__(self, count: int) -> None:
        self._robots = np.arange(count)
        # Made when there is something to count.
        self._often = np.zeros((count, 0), dtype=np.int32)

    def add(self, numbers: Array, counts: NDArray[np.bool_] | None = None) -> None:
        """Add numbers, shape (robots,), or those that count."""
        if not self._often.size:
            self._often = np.zeros((self._robots.size, _BINS), dtype=np.int32)
        place = _PER_DECADE * (np.log10(numbers) + _LEAST)
        # What is no number is beyond all.
        place = np.clip(np.where(np.isnan(place), _BINS, place), 0, _BINS - 1)
        self._often[self._robots, place.astype(int)] += 1 if counts is None else counts

    @property
    def value(self) -> Array:
        """The median; not a number where there were none."""
        if not self._often.size:
            return np.full(self._robots.size, np.nan)
        below = np.cumsum(self._often, axis=1)
        count = below[:, -1:]
        # Of an even number of numbers two are in the middle, with a gap between them perhaps.
        middle = [
            10.0 ** (((below >= place).argmax(axis=1) + 0.5) / _PER_DECADE - _LEAST)
            for place in ((count + 1) // 2, count // 2 + 1)
        ]
        return np.where(count[:, 0] > 0, 0.5 * (middle[0] + middle[1]), np.nan)


class Settling:
    """The time after which an error stays below a tolerance: its last crossing.

    Args:
        tolerance: The tolerances, shape (robots,).
    """

    def __init__(self, tolerance: Array) -> None:
        self._tolerance = tolerance
        self._since = np.full(tolerance.size, np.inf)

    def add(self, t: float, error: Array) -> None:
        """Add the errors at a time [s], shape (robots,)."""
        np.minimum(self._since, t, out=self._since)
        self._since[~(error < self._tolerance)] = np.inf

    @property
    def time(self) -> Array:
        """The time [s]; not a number where the error is not below in the end."""
        return np.where(np.isinf(self._since), np.nan, self._since)
