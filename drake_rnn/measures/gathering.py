"""How a metric is gathered from values of steps that come in parts.

A gathering is a function from what was gathered so far and new values to what is gathered now; the
state that it was given is not used again (the histogram of a median is updated in place).
It serves one run, many side by side, and a run that JAX traces. What is gathered is a tuple of
arrays of shape (...): nothing for one run, or the number of robots.

Extremes, times and medians do not depend on the parts. A mean of several parts does in its last
digits, because sums are rounded in another order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..arrays.algebra import functions_of, root
from ..arrays.namespace import AnyArray
from ..arrays.series import added_up

#: What is gathered so far.
State = tuple[Any, ...]
#: From what was gathered to the metric.
Finish = Callable[[AnyArray], AnyArray]

# Bins of a histogram: a bin is a factor of 10^(1 / 200), 1.2 % wide, and the first begins at 1e-9.
_PER_DECADE, _LEAST, _BINS = 200, 9, 2400


class Gathering(Protocol):
    """A way to gather a metric.

    Attributes:
        differentiable: Whether JAX can trace it and take its derivative.
        start: What is gathered before the first step.
    """

    differentiable: bool

    @property
    def start(self) -> State: ...

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        """Return what is gathered with further values.

        Args:
            state: What was gathered before.
            values: Values of at least one step, shape (k, ...) or as the gathering says.
            time: Times of the steps, shape (k,) [s].
        """

    def value(self, state: State) -> AnyArray:
        """Return the metric, shape (...); not finite where there is none."""


def _same(value: AnyArray) -> AnyArray:
    return value


def excess(value: AnyArray) -> AnyArray:
    """Return by how much a value is above 0, or 0; NaN where it is not finite."""
    xp = functions_of(value)
    return xp.where(xp.isfinite(value), xp.maximum(0.0, value), np.nan)


def shortfall(value: AnyArray) -> AnyArray:
    """Return by how much a value is below 0, or 0; NaN where it is not finite."""
    return excess(-value)


@dataclass(frozen=True)
class _OfOneNumber:
    """A gathering whose metric follows from one number for each robot."""

    finish: Finish = _same

    def value(self, state: State) -> AnyArray:
        return self.finish(state[0])


@dataclass(frozen=True)
class Largest(_OfOneNumber):
    """The largest of all values."""

    differentiable = True
    start = (-np.inf,)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (functions_of(values).maximum(state[0], values.max(axis=0)),)


@dataclass(frozen=True)
class Smallest(_OfOneNumber):
    """The smallest of all values."""

    differentiable = True
    start = (np.inf,)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (functions_of(values).minimum(state[0], values.min(axis=0)),)


@dataclass(frozen=True)
class Mean:
    """The mean of all values."""

    finish: Finish = _same
    differentiable = True
    start = (0.0, 0.0)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        # Truth values count as 0 and 1.
        return added_up(state[0], 1.0 * values), state[1] + float(len(values))

    def value(self, state: State) -> AnyArray:
        total, count = state
        some = functions_of(count).where(count > 0.0, count, np.nan)
        return self.finish(total / some)


#: The root of the mean of values that are squares.
RootMean = Mean(root)


@dataclass(frozen=True)
class Share(Mean):
    """The share of the steps at which something is so, of truth values: it has no slope."""

    differentiable = False


@dataclass(frozen=True)
class Last(_OfOneNumber):
    """The value of the last step."""

    differentiable = True
    start = (np.nan,)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (values[-1],)


@dataclass(frozen=True)
class Change:
    """The change from the first step to the last one, of vectors, shape (k, ..., n).

    A single step makes no change.
    """

    finish: Finish
    differentiable = True
    start = (np.nan, np.nan)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        first, last = state
        xp = functions_of(values)
        begins = xp.isnan(first)
        first = xp.where(begins, values[0], first)
        if len(values) > 1:
            # A copy: the next part may be written to the same place.
            return first, xp.array(values[-1])
        return first, xp.where(begins, last, values[-1])

    def value(self, state: State) -> AnyArray:
        first, last = state
        return self.finish(abs(last - first))


@dataclass(frozen=True)
class FirstTime(_OfOneNumber):
    """The time at which something is first so, of truth values."""

    differentiable = False
    start = (np.nan,)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        (known,) = state
        so = values != 0
        now = np.where(so.any(axis=0), time[np.argmax(so, axis=0)], np.nan)
        return (np.where(np.isnan(known), now, known),)


@dataclass(frozen=True)
class Settling(_OfOneNumber):
    """The time from which on something stays so, of truth values; none if it is not in the end."""

    differentiable = False
    start = (np.inf,)

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        otherwise = ~values
        # The step after the last at which it was not so.
        after = len(values) - np.argmax(otherwise[::-1], axis=0)
        again = np.where(after < len(values), time[np.minimum(after, len(values) - 1)], np.inf)
        return (np.where(otherwise.any(axis=0), again, np.minimum(state[0], time[0])),)


@dataclass(frozen=True)
class Median:
    """The median of all values that are numbers; NaN does not count.

    The values of one run are kept, 8 bytes each. Those of robots side by side are counted in a
    histogram: their median is found within 0.6 %, from 1e-9 to 1e3.
    """

    differentiable = False
    start: State = ()

    def added(self, state: State, values: AnyArray, time: AnyArray) -> State:
        if values.ndim == 1:
            return (*state, values[~np.isnan(values)])
        often = state[0] if state else np.zeros((values.shape[1], _BINS), dtype=np.int32)
        robots = np.arange(len(often))
        place = np.clip(_PER_DECADE * (np.log10(values) + _LEAST), 0, _BINS - 1)
        for row in place:
            counts = ~np.isnan(row)
            often[robots, np.where(counts, row, 0.0).astype(int)] += counts
        return (often,)

    def value(self, state: State) -> AnyArray:
        if not state:
            return np.float64(np.nan)
        if state[0].ndim == 1:
            values = np.concatenate(state)
            return np.median(values) if values.size else np.float64(np.nan)
        below = np.cumsum(state[0], axis=1)
        count = below[:, -1:]
        # Of an even number of values two are in the middle, perhaps with a gap between them.
        middle = [
            10.0 ** (((below >= place).argmax(axis=1) + 0.5) / _PER_DECADE - _LEAST)
            for place in ((count + 1) // 2, count // 2 + 1)
        ]
        return np.where(count[:, 0] > 0, 0.5 * (middle[0] + middle[1]), np.nan)
