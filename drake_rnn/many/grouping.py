"""Which robots run side by side: those whose laws differ in nothing but numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..experiment import Experiment
from ..inputs.dataclass_fields import fields_of
from ..laws.checks import sampled_reading
from ..robot.screws import Screws

#: Robots that run side by side; what they need then fits the cache of a processor.
BLOCK = 1000


def blocks(experiments: Sequence[Experiment], arms: Sequence[Screws]) -> list[list[int]]:
    """Return the numbers of the experiments that run side by side, some 1000 at a time.

    Args:
        experiments: The experiments.
        arms: The kinematics of their arms.
    """
    groups: dict[object, list[int]] = {}
    for number, (experiment, arm) in enumerate(zip(experiments, arms, strict=True)):
        groups.setdefault(_group(experiment, arm), []).append(number)
    return [
        numbers[begin : begin + BLOCK]
        for numbers in groups.values()
        for begin in range(0, len(numbers), BLOCK)
    ]


def contents(value: object) -> object:
    """Return what two objects have in common if, and only if, they hold the same.

    Of an object that is neither a number, an array, a text, a mapping, a sequence nor a dataclass,
    it is the object's identity, as long as it exists.
    """
    return _described(value, lambda number: number, lambda array: array.tobytes())


def structure(value: object) -> object:
    """Return what two objects have in common if they differ at most in numbers that vary."""
    return _described(value, lambda number: None, lambda array: None)


def _described(value: object, of_number: Any, of_array: Any) -> object:
    """Describe an object, its numbers and arrays in the given ways, beside their types."""
    if isinstance(value, float):
        return float, of_number(value)
    if value is None or isinstance(value, (str, int, type)):
        return value
    if isinstance(value, np.ndarray):
        return value.shape, of_array(value)
    if fields := fields_of(value):
        parts = ((name, _described(part, of_number, of_array)) for name, part in fields.items())
        return type(value), *parts
    if isinstance(value, Mapping):
        return tuple((key, _described(part, of_number, of_array)) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(_described(part, of_number, of_array) for part in value)
    return id(value)


def _group(experiment: Experiment, arm: Screws) -> object:
    document, dither = experiment.document, experiment.document.dither
    assert document.period is not None
    bounds = experiment.limits.bounds
    return (
        structure(sampled_reading(experiment.law, document.period)),
        (arm.slides, arm.columns, arm.n),
        (document.period, document.duration, document.window, document.task),
        None if dither is None else (dither.model, dither.hold),
        tuple(name for name, bound in bounds.items() if bound is not None),
        (experiment.holds_orientation, experiment.target is None),
    )
