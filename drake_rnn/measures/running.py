"""Figures of numbers that come in parts: in one part, to the last bit those of all at once.

Extremes do not depend on the parts at all. A mean of several does in its last digits, because sums
are rounded in another order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array

#: Numbers of any shape, or which of some things are so.
Numbers = Array | NDArray[np.bool_]


class _Extreme:
    """The extreme of all numbers; not a number if one of them is none.

    Attributes:
        value: The extreme; None if there were no numbers.
    """

    value: float | None = None
    _of: np.ufunc

    def add(self, numbers: Array) -> None:
        """Add numbers of any shape."""
        if numbers.size:
            found = self._of.reduce(numbers, axis=None)
            self.value = float(found if self.value is None else self._of(self.value, found))


class Largest(_Extreme):
    """The largest of all numbers."""

    _of = np.maximum


class Smallest(_Extreme):
    """The smallest of all numbers."""

    _of = np.minimum


class Mean:
    """The mean of all numbers."""

    def __init__(self) -> None:
        self._sum = 0.0
        self._count = 0

    def add(self, numbers: Numbers) -> None:
        """Add numbers of any shape."""
        self._sum += numbers.sum()
        self._count += numbers.size

    @property
    def value(self) -> float | None:
        """The mean; None if there were no numbers."""
        return float(self._sum / self._count) if self._count else None

    @property
    def root(self) -> float | None:
        """The root of the mean; None if there were no numbers."""
        return None if self.value is None else float(np.sqrt(self.value))


class Median:
    """The median of all numbers, which are kept: 8 bytes each."""

    def __init__(self) -> None:
        self._parts: list[Array] = []

    def add(self, numbers: Array) -> None:
        """Add numbers, shape (k,)."""
        self._parts.append(numbers)

    @property
    def value(self) -> float | None:
        """The median; None if there were no numbers."""
        numbers = np.concatenate(self._parts) if self._parts else np.empty(0)
        return float(np.median(numbers)) if numbers.size else None


class Settling:
    """The time after which an error stays below a tolerance.

    Args:
        tolerance: The tolerance.

    Attributes:
        time: The time [s]; None if the error is not below it in the end.
    """

    time: float | None = None

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._begun = False

    def add(self, time: Array, error: Array) -> None:
        """Add a part, shapes (k,), that begins with the last step of the part before."""
        late = np.flatnonzero(~(error < self._tolerance))
        if late.size:
            after = int(late[-1]) + 1
            self.time = float(time[after]) if after < time.size else None
        elif not self._begun:
            self.time = float(time[0])
        self._begun = True
