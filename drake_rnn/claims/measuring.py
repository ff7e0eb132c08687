"""Shared parts of the papers' measures: the runs they look at, costs, and signals of laws."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from ..experiment import load_experiment
from ..runs.result import Result

#: Signals that only a model of the arm can give.
STRUCTURE = frozenset({"J", "J_omega", "Jdot_v", "M", "bias", "gravity"})


class Run(Protocol):
    """A function that returns the result of a shipped experiment with changes by dotted key."""

    def __call__(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result; the run is made once, however often it is asked for."""


def signals_of_structure(name: str, among: Collection[str] = STRUCTURE) -> float:
    """Return the number of signals of an arm's structure that a law sees [1].

    Args:
        name: Name of the shipped experiment with the law.
        among: Signals that count.
    """
    return float(len(set(among) & set(load_experiment(name).law.inputs.parts)))


def time_ratio(one: Callable[[], object], other: Callable[[], object], rounds: int = 1000) -> float:
    """Return the ratio of the times of two calculations [1].

    Both are timed in turn, and the least time of each counts, as it is the least disturbed.

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
