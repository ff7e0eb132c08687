"""Which robots run side by side: those whose laws differ in nothing but numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..experiment import Experiment
from ..inputs.dataclass_fields import fields_of
from ..laws import SampledReading
from ..robot.screws import Screws, side_by_side
from .filtering import alike

#: Robots that run side by side; what they need then fits the cache of a processor.
BLOCK = 1000


@dataclass(frozen=True)
class Robot:
    """One of many runs.

    Attributes:
        experiment: The experiment.
        reading: Reading of its law.
        arm: Kinematics of its arm.
    """

    experiment: Experiment
    reading: SampledReading
    arm: Screws


def blocks(robots: Sequence[Robot]) -> list[list[int]]:
    """Return the numbers of the robots that run side by side, some 1000 at a time.

    Args:
        robots: The robots.
    """
    groups: dict[object, list[int]] = {}
    for number, robot in enumerate(robots):
        groups.setdefault(_group(robot), []).append(number)
    return [
        numbers[begin : begin + BLOCK]
        for numbers in groups.values()
        for begin in range(0, len(numbers), BLOCK)
    ]


def arm_of_all(robots: Sequence[Robot]) -> Screws:
    """Return the one arm that all robots have, or the arms of each, side by side."""
    arms = [robot.arm for robot in robots]
    return arms[0] if all(arm is arms[0] for arm in arms) else side_by_side(arms)


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


def _group(robot: Robot) -> object:
    experiment, arm = robot.experiment, robot.arm
    document, noise = experiment.document, experiment.document.joint_noise
    bounds = experiment.limits.bounds
    return (
        structure(robot.reading),
        (arm.slides, arm.columns, arm.n),
        (document.period, document.duration, document.window, document.task),
        None if noise is None else (noise.model, noise.hold),
        document.sensing is None,
        tuple(name for name, bound in bounds.items() if bound is not None),
        alike(experiment),
        (experiment.holds_orientation, experiment.target is None, experiment.contact is None),
    )
