"""The cost of one calculation in that of another."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np


def time_ratio(one: Callable[[], object], other: Callable[[], object], rounds: int = 1000) -> float:
    """Return the time of a calculation, per that of another [1].

    Both are timed in turn, and the least time of each counts, as the least disturbed one.

    Args:
        one: The calculation.
        other: The other one.
        rounds: Number of times that each is made.
    """
    times = [[_time(one), _time(other)] for _ in range(rounds)]
    first, second = np.min(times, axis=0)
    return float(first / second)


def _time(calculation: Callable[[], object]) -> float:
    began = perf_counter()
    calculation()
    return perf_counter() - began
