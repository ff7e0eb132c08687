"""What is asked of a result before it is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..paths import Rest
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.result import Result
from .style import largest

#: The arm's curves are shown apart from the law's if they differ by more than this share.
_APART = 0.01


def has_target(result: Result) -> bool:
    """Whether there is a posture to reach."""
    return result.experiment.target is not None


def commands_acceleration(result: Result) -> bool:
    """Whether its law commands accelerations, as those that bring the joints back do."""
    return not {"velocity_error_predicted", "torque"}.isdisjoint(result.series)


def has_path(result: Result) -> bool:
    """Whether the end effector is to go anywhere."""
    path = result.experiment.path
    return not isinstance(path, Rest) or bool(path.offset.any())


def presses(result: Result) -> bool:
    """Whether a tool is pressed against a surface."""
    return result.experiment.contact is not None


def bounds_jerk(result: Result) -> bool:
    """Whether the experiment itself bounds derivatives beyond the acceleration."""
    declared = result.experiment.document.limits
    enough = result.time.size > len(DERIVATIVE_UNITS)
    return enough and isinstance(declared, dict) and declared.get("jerk") is not None


def shows_signals(result: Result) -> bool:
    """Whether its law has signals that stand for derivatives and are none."""
    return not result.experiment.law.levels_are_derivatives


def bounds_are_felt(result: Result) -> bool:
    """Whether a bound on the velocity that is not what it can be comes near a joint's."""
    v = law_velocity(result)
    for sign, name in ((1, "velocity_upper"), (-1, "velocity_lower")):
        bound = sign * result.series[name]
        widest = np.fmax.reduce(bound, axis=0)
        if ((bound < 0.95 * widest) & (sign * v > 0.5 * bound)).any():
            return True
    return False


def law_velocity(result: Result) -> Array:
    """What the law asks for; the arm's own velocity may be hidden in noise."""
    return result.series.get("network_velocity", result.series["velocity"])


def first_lap(result: Result) -> NDArray[np.bool_]:
    """Which samples belong to it: laps drawn over one another would fill the dashes' gaps."""
    setup = result.experiment
    lap = setup.path.period + setup.path_delay
    return result.time <= lap + result.experiment.document.log_period


def evaluated(result: Result) -> NDArray[np.bool_]:
    """Which samples errors are taken over; all of a run that did not come to its window."""
    start, end = result.experiment.document.window or (-np.inf, np.inf)
    within = (result.time >= start - 1e-9) & (result.time <= end + 1e-9)
    return within if within.any() else ~within


def apart(result: Result, quantity: str) -> bool:
    """Whether the arm's joints do something else than the law asks for."""
    law = result.series.get(f"network_{quantity}")
    if law is None:
        return False
    return largest(result.series[quantity] - law) > _APART * largest(law)
