"""The register of figures.

- Properties of a result that decide which figures are drawn, and how.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..paths import Rest
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.result import Result
from .style import common_style, largest

Draw = Callable[[Result], Figure]


@dataclass(frozen=True)
class Drawing:
    """A registered figure.

    Attributes:
        draw: Function that draws it.
        needs: Names of the series it needs.
        applies: Whether it is meaningful for a result that has these series.
        least: Least width in which it can be read [inch].
    """

    draw: Draw
    needs: frozenset[str]
    applies: Callable[[Result], bool]
    least: float


#: All figures, by name.
FIGURES: dict[str, Drawing] = {}


def draws(
    *needs: str,
    applies: Callable[[Result], bool] = lambda result: True,
    least: float = 0.0,
) -> Callable[[Draw], Draw]:
    """Register a function as the figure of that name, drawn in the common style.

    Args:
        needs: Names of the series that the figure needs.
        applies: Whether it is meaningful for a result that has these series.
        least: Least width in which it can be read [inch].
    """

    def register(draw: Draw) -> Draw:
        @wraps(draw)
        def wrapped(result: Result) -> Figure:
            with common_style():
                return draw(result)

        FIGURES[draw.__name__] = Drawing(wrapped, frozenset(needs), applies, least)
        return wrapped

    return register


#: Difference between arm and law, relative to the law's peak, above which both are drawn.
_APART = 0.01


def has_target(result: Result) -> bool:
    """Return whether the experiment has a target posture."""
    return result.experiment.target is not None


def commands_acceleration(result: Result) -> bool:
    """Return whether the law commands accelerations, as joint-drift-free laws do."""
    weighed = {"velocity_error_predicted", "torque"} & result.series.keys()
    return bool(weighed) and "acceleration_demand" in result.series


def has_path(result: Result) -> bool:
    """Return whether the end effector should move, and not stay at its start."""
    path = result.experiment.path
    return not isinstance(path, Rest) or bool(path.offset.any())


def presses(result: Result) -> bool:
    """Return whether the tool presses against a surface."""
    return result.experiment.contact is not None


def bounds_jerk(result: Result) -> bool:
    """Return whether the experiment itself sets a bound on the jerk, and enough was sampled."""
    limits = result.experiment.document.limits
    enough = result.time.size > len(DERIVATIVE_UNITS)
    return enough and isinstance(limits, dict) and limits.get("jerk") is not None


def shows_signals(result: Result) -> bool:
    """Return whether the law has signals in place of derivatives that differ from them."""
    return not result.experiment.law.levels_are_derivatives


def moving_bounds_matter(result: Result) -> bool:
    """Return whether a joint comes close to a velocity bound while that bound is reduced."""
    v = law_velocity(result)
    for sign, name in ((1, "velocity_upper"), (-1, "velocity_lower")):
        bound = sign * result.series[name]
        widest = np.fmax.reduce(bound, axis=0)
        if ((bound < 0.95 * widest) & (sign * v > 0.5 * bound)).any():
            return True
    return False


def law_velocity(result: Result) -> Array:
    """Return the joint velocities of the law, as the arm's may be noisy, shape (k, n) [rad/s]."""
    return result.series.get("network_velocity", result.series["velocity"])


def first_pass(result: Result) -> NDArray[np.bool_]:
    """Return which samples show the path passed once, shape (k,): one lap, or an open path.

    Several laps drawn over one another would fill the gaps of a dashed line.
    """
    experiment = result.experiment
    first_pass_end = experiment.desired.traversal + experiment.path_delay
    return result.time <= first_pass_end + experiment.document.log_period


def strokes_of(result: Result, series: str) -> Array:
    """Return a series of points, shape (k, m), with NaN where a pen is lifted.

    See `drake_rnn.paths.Path.pen_is_down`; on most paths none is.
    """
    down = result.experiment.path.pen_is_down(result.desired_position)
    return np.asarray(np.where(down[:, None], result.series[series], np.nan))


def returns(result: Result) -> bool:
    """Return whether the path ends where it began, so that the joints should as well."""
    return result.experiment.desired.closed


def open_end(result: Result) -> NDArray[np.bool_]:
    """Return which sample shows the end of an open path, shape (k,); none if it is not reached."""
    experiment = result.experiment
    end = experiment.desired.traversal + experiment.path_delay
    mask = np.zeros(result.time.size, dtype=bool)
    if not returns(result) and result.time[-1] >= end * (1.0 - 1e-9):
        mask[np.flatnonzero(first_pass(result))[-1]] = True
    return mask


def samples_in_window(result: Result) -> NDArray[np.bool_]:
    """Return which samples are in the window, shape (k,); all of them if none is."""
    start, end = result.experiment.document.window or (-np.inf, np.inf)
    within = (result.time >= start - 1e-9) & (result.time <= end + 1e-9)
    return within if within.any() else ~within


def apart(result: Result, quantity: str) -> bool:
    """Return whether the motion of the arm visibly differs from the motion of the law.

    Args:
        result: The run.
        quantity: ``velocity`` or ``acceleration``.
    """
    law = result.series.get(f"network_{quantity}")
    if law is None:
        return False
    return largest(result.series[quantity] - law) > _APART * largest(law)
