"""Bounds between which gains are tuned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, sqrt
from numbers import Real

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..inputs.complaints import short
from ..inputs.fields import Array
from ..inputs.numbers import decimal

#: Lowest and highest value of a gain.
Between = tuple[float, float]

# Factor from the start to a bound that is not given.
_FACTOR = 30.0
# How often the way to a value that the law refuses is halved.
_HALVES = 12


def parse_between(text: str) -> tuple[str, Between]:
    """Return key and bounds of ``KEY=LOW,HIGH``.

    Raises:
        InvalidInputError: If the text is not of this form.
    """
    key, _, values = text.partition("=")
    try:
        low, high = (decimal(value) for value in values.split(","))
    except ValueError:
        raise InvalidInputError(f"--between: must be KEY=LOW,HIGH, not {text!r}") from None
    return key.strip(), (low, high)


def bounds_of(
    experiment: Experiment,
    keys: Sequence[str],
    start: Array,
    between: Mapping[str, Between],
) -> tuple[Array, Array]:
    """Return the lowest and the highest gains, each of shape (keys,).

    Bounds that are not given are 30 times lower and higher than the start, or as far on the way
    there as the law allows with the other gains at the start.

    Args:
        experiment: The experiment.
        keys: Dotted keys of numbers of its law.
        start: Their values.
        between: Bounds by key.

    Raises:
        InvalidInputError: If a start is not greater than 0, or a bound is not one that the law
            allows, with the start between both.
    """
    if unknown := [key for key in between if key not in keys]:
        raise InvalidInputError(f"between: {unknown[0]} is not among {', '.join(keys)}")
    pairs = []
    for key, value in zip(keys, start.tolist(), strict=True):
        if not value > 0.0:
            raise InvalidInputError(
                f"{key}: must be greater than 0 to be tuned by factors, not {value:g}"
            )
        if key in between:
            pairs.append(_given(experiment, key, value, between[key]))
        else:
            low, high = value / _FACTOR, value * _FACTOR
            lowest = _allowed(experiment, key, value, low)
            pairs.append((lowest, _allowed(experiment, key, value, high)))
    return np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])


def _given(experiment: Experiment, key: str, start: float, pair: Between) -> Between:
    numbers = isinstance(pair, (list, tuple)) and len(pair) == 2
    numbers = numbers and all(isinstance(each, Real) and isfinite(each) for each in pair)
    if not numbers or not 0.0 < pair[0] < pair[1]:
        raise InvalidInputError(
            f"between: {key}: must be two numbers greater than 0, the lower one first, not "
            f"{short(pair)}"
        )
    if not pair[0] <= start <= pair[1]:
        raise InvalidInputError(
            f"between: {key}: must have the start, {start:g}, between both, not {short(pair)}"
        )
    for bound in pair:
        load_experiment(experiment, {key: float(bound)})
    return float(pair[0]), float(pair[1])


def _allowed(experiment: Experiment, key: str, start: float, end: float) -> float:
    """Return the value farthest on the way from a start to an end that the law allows."""
    if _allows(experiment, key, end):
        return end
    good, bad = start, end
    for _ in range(_HALVES):
        middle = sqrt(good * bad)
        if _allows(experiment, key, middle):
            good = middle
        else:
            bad = middle
    return good


def _allows(experiment: Experiment, key: str, value: float) -> bool:
    try:
        load_experiment(experiment, {key: value})
    except InvalidInputError:
        return False
    return True
