"""Which robots run side by side: those whose laws differ in nothing but numbers.

- Filters between the laws and the arms of many robots.
- Why a batch cannot run an experiment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument, ExperimentSource, load_experiment
from ..experiment.document import combination_of
from ..features.filter import Averages, averaging_windows
from ..features.pairs import refuse
from ..inputs.fields import Array
from ..inputs.messages import fields_of
from ..laws import Law, SampledReading
from ..laws.call_checks import require_many
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.load_arm import screws_of
from ..robot.screws import PairScrews, Screws, pairs_side_by_side, side_by_side
from ..signals import PATH_AHEAD, names_of


class Filters:
    """Moving averages of the velocities that move the arms.

    Args:
        experiments: The robots' experiments, all with the same windows.

    Attributes:
        apart: Whether the laws see virtual arms, ahead of the filter, in place of their own.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        first = experiments[0]
        assert first.document.filter is not None
        self.apart = first.feedback == "unfiltered"
        velocity = [each.limits.require("velocity", "filter") for each in experiments]
        self._averages = Averages(
            _windows(first),
            np.stack(velocity, axis=-1),
            precompensate=first.document.filter.precompensate,
        )

    def start(self) -> Array:
        """Return states at rest, shape (size, robots)."""
        return np.zeros(self._averages.shape)

    def velocity(self, states: Array) -> Array:
        """Return the filtered velocities, shape (robots, n) [rad/s]."""
        return self._averages.mean(states).T

    def add(self, states: Array, velocity: Array) -> None:
        """Add velocities, shape (robots, n) [rad/s], to the states, in place."""
        self._averages.add(states, velocity.T)


def alike(experiment: Experiment) -> object:
    """Return what robots side by side have in common of their filters."""
    settings = experiment.document.filter
    if settings is None:
        return None
    windows = _windows(experiment)
    return (
        experiment.feedback,
        settings.precompensate,
        settings.delay_desired,
        windows.shape,
        windows.tobytes(),
    )


def _windows(experiment: Experiment) -> np.ndarray:
    settings, period = experiment.document.filter, experiment.document.period
    assert settings is not None
    assert period is not None
    return averaging_windows(experiment.limits, period, settings.above)


#: Robots that run side by side; what they need then fits the cache of a processor.
BLOCK = 1000


@dataclass(frozen=True)
class Robot:
    """One of many runs.

    Attributes:
        experiment: The experiment.
        reading: Reading of its law.
        arm: Kinematics of its arm.
        second: The same of an arm beside it; None without one.
    """

    experiment: Experiment
    reading: SampledReading
    arm: Screws | PairScrews
    second: Robot | None = None


def blocks(robots: Sequence[Robot], most: int | None = BLOCK) -> list[list[int]]:
    """Return the numbers of the robots that run side by side.

    Args:
        robots: The robots.
        most: How many at a time; None for any number.
    """
    groups: dict[object, list[int]] = {}
    for number, robot in enumerate(robots):
        groups.setdefault(_group(robot), []).append(number)
    return [
        numbers[begin : begin + (most or len(numbers))]
        for numbers in groups.values()
        for begin in range(0, len(numbers), most or len(numbers))
    ]


def arm_of_all(robots: Sequence[Robot]) -> Screws | PairScrews:
    """Return the one arm that all robots have, or the arms of each, side by side."""
    arms = [robot.arm for robot in robots]
    if all(arm is arms[0] for arm in arms):
        return arms[0]
    if pairs := [arm for arm in arms if isinstance(arm, PairScrews)]:
        return pairs_side_by_side(pairs)
    return side_by_side([arm for arm in arms if isinstance(arm, Screws)])


def contents(value: object) -> object:
    """Return what two objects have in common if, and only if, they hold the same.

    Of an object that is neither a number, an array, a text, a mapping, a sequence nor a dataclass,
    it is the object's identity, as long as it exists.
    """
    return _describe(
        value, lambda number: number, lambda array: array.tobytes(), lambda pairs: pairs.contents
    )


def structure(value: object) -> object:
    """Return what two objects have in common if they differ at most in numbers that vary."""
    return _describe(value, lambda number: None, lambda array: None, lambda pairs: pairs.structure)


def _describe(value: object, *ways: Callable[[Any], object]) -> object:
    """Describe an object, its numbers, arrays and pairs in the given ways, beside their types."""
    of_number, of_array, of_pairs = ways
    if isinstance(value, float):
        return float, of_number(value)
    if value is None or isinstance(value, (str, int, type)):
        return value
    if isinstance(value, np.ndarray):
        return value.shape, of_array(value)
    if isinstance(value, Clearance):
        return of_pairs(value)
    if fields := fields_of(value):
        parts = ((name, _describe(part, *ways)) for name, part in fields.items())
        return type(value), *parts
    if isinstance(value, Mapping):
        return tuple((key, _describe(part, *ways)) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(_describe(part, *ways) for part in value)
    return id(value)


def _group(robot: Robot) -> object:
    experiment, arm = robot.experiment, robot.arm
    document, noise = experiment.document, experiment.document.joint_noise
    bounds = experiment.limits.bounds
    clearance = experiment.clearance
    return (
        structure(robot.reading),
        None if clearance is None else clearance.structure,
        (arm.slides, arm.columns, arm.n),
        (document.period, document.duration, document.window, experiment.law_task),
        None if noise is None else (noise.model, noise.hold),
        (document.sensing is None, experiment.motions is None),
        tuple(name for name, bound in bounds.items() if bound is not None),
        alike(experiment),
        (experiment.holds_orientation, experiment.target is None, experiment.contact is None),
        None if robot.second is None else _group(robot.second),
    )


#: Signals that a law in a batch may see.
_BATCH_SIGNALS = PATH_AHEAD | {
    *names_of("joints", "kinematics", "path", "surface"),
    *("p_WO", "other_commanded", "other_v", "other_a", "detour", "posture"),
}
_SCHEMES = ("explicit_euler", "runge_kutta2")


def why_not(experiment: ExperimentSource) -> str | None:
    """Return why `run_many` cannot run an experiment, in a sentence; None if it can.

    `simulate` and, in processes, `sweep` run the others.

    Args:
        experiment: The experiment, or what `load_experiment` takes.
    """
    candidate = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    why = why_not_law(candidate.document, candidate.law) or why_not_arm(candidate.arm)
    if why is None and candidate.second is not None:
        why = why_not(candidate.second)
        return why and f"second: {why}"
    return why


def why_not_law(document: ExperimentDocument, law: Law) -> str | None:
    """Return why a batch cannot run a document with its law, whatever the arm is; None if it can.

    Args:
        document: The document.
        law: Its law.
    """
    return _refusal(lambda: able_reading(document, law))


def why_not_arm(arm: Arm) -> str | None:
    """Return why a batch knows no kinematics of an arm; None if it does.

    Args:
        arm: The arm.
    """
    return _refusal(lambda: screws_of(arm))


def _refusal(attempt: Callable[[], object]) -> str | None:
    try:
        attempt()
    except InvalidInputError as error:
        return str(error)
    return None


def able_reading(document: ExperimentDocument, law: Law) -> SampledReading:
    """Return the reading of the law that a batch runs, whatever the arm is.

    Raises:
        InvalidInputError: If a batch cannot run the experiment; the message says why.
    """
    refuse(replace(combination_of(document, type(law), law), host="batch"))
    assert document.period is not None
    return _able_reading(law, document.period)


def _able_reading(law: Law, period: float) -> SampledReading:
    name = type(law).__name__
    # The law's declarations were checked when the experiment was made.
    reading = law.sampled(period)
    require_many(reading)
    if unknown := sorted(reading.inputs.parts.keys() - _BATCH_SIGNALS):
        raise InvalidInputError(
            f"law: {name} sees {', '.join(unknown)}, which a batch does not compute"
        )
    if (scheme := reading.integration_scheme) not in _SCHEMES:
        raise InvalidInputError(
            f"law: the command of {name} is integrated by {scheme}; a batch knows "
            f"{' and '.join(_SCHEMES)}"
        )
    return reading
