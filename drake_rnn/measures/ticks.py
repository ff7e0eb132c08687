"""Ticks: the times for which a velocity is held, and its changes from one to the next."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array


def secant(time: Array, values: Array, tick: float | None, origin: float) -> Array:
    """Return difference quotients over ticks, shape (k - 1, ...), for the tick each step ends in.

    Without a tick they are taken over the steps themselves; steps that events split a rounding
    error apart are merged.

    Args:
        time: Time of each step, shape (k,) [s]; the first is that of the run or ends a tick.
        values: Values at these, shape (k, ...).
        tick: Time for which a value is held [s]; None if it changes at every step.
        origin: Time at which the first tick begins [s].
    """
    if time.size < 2:
        return np.zeros((0, *values.shape[1:]))
    last, ends = tick_ends(time, tick, origin)
    lengths = np.diff(ends).reshape(-1, *(1,) * (values.ndim - 1))
    if last.size == time.size:
        return np.asarray(np.diff(values, axis=0) / lengths)
    quotients = np.diff(values[last], axis=0) / lengths
    return np.asarray(quotients[np.searchsorted(last, np.arange(1, time.size)) - 1])


def tick_ends(time: Array, tick: float | None, origin: float) -> tuple[NDArray[np.int_], Array]:
    """Return the last step of each tick and the time at which the tick ends [s].

    Args:
        time: Time of each step, shape (k,) [s], of at least two; see `secant`.
        tick: Time for which a value is held [s]; None if it changes at every step.
        origin: Time at which the first tick begins [s].
    """
    number = _numbers(time, tick, origin)
    last = np.flatnonzero(np.diff(number, append=number[-1] + 1))
    ends = time[last] if tick is None else np.asarray(number[last] * tick, dtype=float)
    return last, ends


def last_end(time: Array, ticks: Iterable[float | None], origin: float) -> int:
    """Return the number of the last step known to end a tick of each kind; 0 if none is.

    Args:
        time: Time of each step, shape (k,) [s].
        ticks: Times for which values are held [s]; None for one that changes at every step.
        origin: Time at which the first ticks begin [s].
    """
    if time.size < 2:
        return 0
    ends = np.all([np.diff(_numbers(time, tick, origin)) > 0 for tick in ticks], axis=0)
    return int(np.flatnonzero(ends)[-1]) if ends.any() else 0


def _numbers(time: Array, tick: float | None, origin: float) -> NDArray[np.int_]:
    """Return the number of the tick that each step ends in, shape (k,)."""
    if tick is None:
        step = np.diff(time)
        # In a long run, the rounding error of the time exceeds that of a step.
        apart = step >= max(1e-9 * step.max(), 4.0 * np.spacing(time[-1]))
        # A change at the start counts as one over the first step.
        apart[: np.argmax(apart) + 1] = False
        return np.concatenate(([0], 1 + np.cumsum(apart)))
    # A tick includes its end, where its value still holds; a step that ends a rounding error
    # later belongs to the next tick.
    passed = (time - origin) / tick
    number = np.ceil(passed - 1e-6).astype(int)
    ended = number - passed < 1e-6
    number[1:] += ended[:-1] & (number[1:] == number[:-1])
    return number
