"""The list of metrics: names, units and meanings, how each is taken, and where it is shown.

It determines the keys that an experiment's ``accept`` may have, the tables on a terminal, the table
of the overview figure, and the page of metrics in the documentation. Runs in Drake, runs side by
side and compiled runs all take their metrics as this list says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Literal

import numpy as np

from ..arrays.algebra import functions_of, root
from ..arrays.namespace import AnyArray
from ..arrays.series import least_singular_squares, lengths, summed
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS
from .gathering import (
    Change,
    FirstTime,
    Gathering,
    Largest,
    Last,
    Mean,
    Median,
    RootMean,
    Settling,
    Share,
    Smallest,
    shortfall,
)
from .motion import Motion
from .yardsticks import Yardsticks

#: Joint error below which an arm has arrived at its target [rad].
ARRIVED = 0.01

#: Values of a metric at the steps of a motion, shape (k, ...), or of the last k - 1 of them; None
#: if the motion has none.
Values = Callable[[Motion, Yardsticks], AnyArray | None]

#: Steps that a metric is taken over: those of the experiment's window, or those of the whole run.
Over = Literal["window", "run"]

#: Places that show a metric: overviews, by what the run is about, and the table of a sweep.
Shown = Literal["path", "posture", "return", "force", "sweep"]


@dataclass(frozen=True)
class Metric:
    """A number computed from a run.

    Attributes:
        name: Key in ``metrics.json``.
        unit: SI unit; "1" for a pure number.
        meaning: Description for the documentation.
        over: Steps it is taken over.
        shown: Places that show it in addition to the metrics in the experiment's ``accept``.
        of: Function that gives the values at the steps of a motion; None if a `Group` takes the
            metric, or if no motion shows it.
        by: How the metric is gathered from these values.
        of_law: Whether the values are observables of the law.
    """

    name: str
    unit: str
    meaning: str
    over: Over = "run"
    shown: frozenset[Shown] = frozenset()
    of: Values | None = None
    by: Gathering = Largest()  # noqa: RUF009 - it has no state
    of_law: bool = False

    @property
    def differentiable(self) -> bool:
        """Whether a compiled run can take the metric and its derivative."""
        return self.of is not None and self.by.differentiable and not self.of_law

    @property
    def words(self) -> str:
        """The name in words, without the unit."""
        return self.name.removesuffix(f"_{_ending(self.unit)}").replace("_", " ")


def violation_metric(limit: str) -> str:
    """Return the name of the metric of a limit's violation.

    Args:
        limit: A key of `LIMIT_UNITS`.
    """
    return f"{limit}_violation_max_{_ending(LIMIT_UNITS[limit])}"


def _ending(unit: str) -> str:
    """Return a unit in the form in which it ends the name of a metric."""
    return unit.replace("/s^", "_s").replace("/", "_")


def _shown(*places: Shown) -> frozenset[Shown]:
    return frozenset(places)


def _top(vectors: AnyArray) -> AnyArray:
    return abs(vectors).max(axis=-1)


def _mean(vectors: AnyArray) -> AnyArray:
    return summed(abs(vectors)) / vectors.shape[-1]


def _root(squares: AnyArray) -> AnyArray:
    return root(functions_of(squares).maximum(0.0, squares))


def _square(values: AnyArray | None) -> AnyArray | None:
    return None if values is None else values**2


def _below(values: AnyArray | None, bound: float) -> AnyArray | None:
    return None if values is None else values < bound


def _apart(places: AnyArray, others: AnyArray | None) -> AnyArray | None:
    return None if others is None else lengths(places - others)


def _margin(motion: Motion, against: Yardsticks) -> AnyArray | None:
    lower, upper = (against.limits[f"position_{side}"] for side in ("lower", "upper"))
    margins = [
        way.min(axis=-1)
        for way in (
            None if lower is None else motion.position - lower,
            None if upper is None else upper - motion.position,
        )
        if way is not None
    ]
    return reduce(functions_of(motion.position).minimum, margins) if margins else None


def _returning(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the joint positions of arms on closed paths; NaN for other arms."""
    if motion.target is not None or not np.any(motion.returns):
        return None
    if np.all(motion.returns):
        return motion.position
    xp = functions_of(motion.position)
    return xp.where(motion.returns[:, None], motion.position, np.nan)


def _initial_acceleration(motion: Motion) -> AnyArray | None:
    return _top(motion.joint_acceleration[:1]) if motion.begins else None


def _observed(name: str) -> Values:
    """Return a function that gives the largest magnitude in an observable of the law."""

    def values(motion: Motion, against: Yardsticks) -> AnyArray | None:
        observed = motion.observed.get(name)
        return None if observed is None else _top(observed)

    return values


_DIFFERENCES = ", from velocity differences over 10 ms"

#: All metrics, in the order in which they are shown.
METRICS: tuple[Metric, ...] = (
    Metric(
        "position_error_max_m",
        "m",
        "largest norm of the position error; in contact, of its part along the surface",
        over="window",
        shown=_shown("path", "return", "sweep"),
        of=lambda motion, against: motion.error_length,
        by=Largest(),
    ),
    Metric(
        "position_error_component_max_m",
        "m",
        "largest position error along any axis",
        over="window",
        of=lambda motion, against: _top(motion.error),
        by=Largest(),
    ),
    Metric(
        "position_error_rms_m",
        "m",
        "root mean square of the norm of the position error",
        over="window",
        shown=_shown("path", "sweep"),
        of=lambda motion, against: motion.error_length**2,
        by=RootMean,
    ),
    Metric(
        "path_delay_s",
        "s",
        "delay with which the arm follows its path because of the filter",
    ),
    Metric(
        "velocity_error_max_m_s",
        "m/s",
        "largest norm of the end effector's velocity error",
        over="window",
        shown=_shown("return", "sweep"),
        of=lambda motion, against: lengths(motion.velocity_error),
        by=Largest(),
    ),
    Metric(
        "velocity_error_component_max_m_s",
        "m/s",
        "largest velocity error along any axis",
        over="window",
        of=lambda motion, against: _top(motion.velocity_error),
        by=Largest(),
    ),
    Metric(
        "settling_time_s",
        "s",
        "time after which the position error stays below settling_tolerance_m",
        shown=_shown("path", "sweep"),
        of=lambda motion, against: motion.error_length < against.settling_tolerance,
        by=Settling(),
    ),
    Metric(
        "force_error_mean_N",
        "N",
        "mean of the true normal force minus the desired one",
        over="window",
        shown=_shown("force"),
        of=lambda motion, against: motion.pressing and motion.pressing.error,
        by=Mean(),
    ),
    Metric(
        "force_error_rms_N",
        "N",
        "root mean square of the force error",
        over="window",
        shown=_shown("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.pressing.error**2,
        by=RootMean,
    ),
    Metric(
        "force_error_max_N",
        "N",
        "largest magnitude of the force error",
        over="window",
        shown=_shown("force", "sweep"),
        of=lambda motion, against: motion.pressing and abs(motion.pressing.error),
        by=Largest(),
    ),
    Metric(
        "normal_force_peak_N",
        "N",
        "largest true force along the surface's normal",
        shown=_shown("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.pressing.force,
        by=Largest(),
    ),
    Metric(
        "force_rise_time_s",
        "s",
        "time at which the true normal force first reaches 95 % of what is desired in the end",
        of=lambda motion, against: motion.pressing and motion.pressing.risen,
        by=FirstTime(),
    ),
    Metric(
        "lateral_error_max_m",
        "m",
        "largest position error along the surface",
        over="window",
        shown=_shown("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.error_length,
        by=Largest(),
    ),
    Metric(
        "joint_error_max_rad",
        "rad",
        "largest distance of a joint from the target posture at the end of the run",
        shown=_shown("posture", "sweep"),
        of=lambda motion, against: motion.target_error,
        by=Last(),
    ),
    Metric(
        "joint_settling_time_s",
        "s",
        "time after which all joints stay within 0.01 rad of the target posture",
        shown=_shown("posture", "sweep"),
        of=lambda motion, against: _below(motion.target_error, ARRIVED),
        by=Settling(),
    ),
    Metric(
        "end_effector_drift_max_m",
        "m",
        "largest distance of the end effector from its start",
        shown=_shown("posture", "sweep"),
    ),
    Metric(
        "end_effector_drift_end_m",
        "m",
        "distance of the end effector from its start at the end of the run",
        shown=_shown("posture"),
    ),
    Metric(
        "orientation_error_max_rad",
        "rad",
        "largest angle between the end effector's orientation and the desired one",
        over="window",
        shown=_shown("path", "posture", "force", "sweep"),
        of=lambda motion, against: motion.orientation_error,
        by=Largest(),
    ),
    Metric(
        "orientation_error_rms_rad",
        "rad",
        "root mean square of that angle",
        over="window",
        of=lambda motion, against: _square(motion.orientation_error),
        by=RootMean,
    ),
    Metric(
        "orientation_rank_min",
        "1",
        "smallest rank of the Jacobian rows with which the law holds the orientation",
        of=_observed("orientation_rank"),
        by=Smallest(),
        of_law=True,
    ),
    Metric(
        "contact_lost_fraction",
        "1",
        "fraction of the steps without contact",
        over="window",
        shown=_shown("force"),
        of=lambda motion, against: motion.pressing and ~motion.pressing.touching,
        by=Share(),
    ),
    Metric(
        "contact_lost_time_s",
        "s",
        "time at which contact was lost for more than 50 ms, or the law detected a loss",
        shown=_shown("force"),
        of=_observed("contact_lost"),
        by=FirstTime(),
        of_law=True,
    ),
    Metric(
        "invariant_error_max_m",
        "m",
        "largest difference of the end effector's displacement from that in the multipliers",
        shown=_shown("posture"),
        of_law=True,
    ),
    Metric(
        "shortest_duration_s",
        "s",
        "shortest duration of the path within the limits (`drake-rnn fastest`)",
    ),
    Metric(
        "joint_drift_mean_rad",
        "rad",
        "joint displacement from the window's first to its last step, mean over the joints; "
        "only for a path that ends where it began",
        over="window",
        shown=_shown("return", "sweep"),
        of=_returning,
        by=Change(_mean),
    ),
    Metric(
        "joint_drift_max_rad",
        "rad",
        "joint displacement from the window's first to its last step, largest over the joints; "
        "only for a path that ends where it began",
        over="window",
        shown=_shown("path", "return", "sweep"),
        of=_returning,
        by=Change(_top),
    ),
    Metric(
        "lap_drift_max_rad",
        "rad",
        "joint displacement over the last whole lap, whatever the window, largest over the joints; "
        "from its beginning to the last step of the run",
    ),
    Metric(
        "joint_velocity_initial_rad_s",
        "rad/s",
        "largest joint speed after the first step",
        shown=_shown("posture"),
        of=lambda motion, against: _top(motion.speed[1:2]) if motion.begins else None,
        by=Largest(),
    ),
    Metric(
        "joint_acceleration_initial_rad_s2",
        "rad/s^2",
        "largest joint acceleration over the first step",
        shown=_shown("posture"),
        of=lambda motion, against: _initial_acceleration(motion),
        by=Largest(),
    ),
    Metric(
        "joint_velocity_max_rad_s",
        "rad/s",
        "largest joint speed",
        shown=_shown("path", "posture", "return", "force"),
        of=lambda motion, against: _top(motion.speed),
        by=Largest(),
    ),
    Metric(
        "joint_acceleration_max_rad_s2",
        "rad/s^2",
        "largest joint acceleration: velocity change over the time for which a velocity is held",
        shown=_shown("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: _top(motion.acceleration_magnitude),
        by=Largest(),
    ),
    Metric(
        "joint_jerk_max_rad_s3",
        "rad/s^3",
        "largest joint jerk" + _DIFFERENCES,
    ),
    Metric(
        "joint_jerk_rms_rad_s3",
        "rad/s^3",
        "root mean square of the jerk of all joints" + _DIFFERENCES,
    ),
    Metric(
        "network_acceleration_max_rad_s2",
        "rad/s^2",
        "largest acceleration of the law's own velocity, where that differs from the arm's",
        shown=_shown("path", "sweep"),
    ),
    Metric(
        "joint_acceleration_demand_max_rad_s2",
        "rad/s^2",
        "largest joint acceleration that the law demanded before it was bounded",
        shown=_shown("return"),
        of=_observed("acceleration_demand"),
        by=Largest(),
        of_law=True,
    ),
    Metric(
        "joint_limit_margin_min_rad",
        "rad",
        "smallest distance to a position limit; negative beyond it",
        shown=_shown("path", "posture", "force"),
        of=_margin,
        by=Smallest(),
    ),
    Metric(
        "command_error_max_m",
        "m",
        "largest distance of the end effector from where the command to the motors places it",
        shown=_shown("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: _apart(motion.p_WE, motion.p_WE_commanded),
        by=Largest(),
    ),
    Metric(
        "command_error_max_rad",
        "rad",
        "largest distance of a joint from the command to its motor",
    ),
    Metric(
        "jacobian_error_median",
        "m",
        "median of the Frobenius norm of J - J_hat",
        over="window",
        shown=_shown("path", "force", "sweep"),
        of=lambda motion, against: motion.seen.jacobian_error_size,
        by=Median(),
    ),
    Metric(
        "jacobian_error_max",
        "m",
        "largest Frobenius norm of J - J_hat",
        over="window",
        shown=_shown("sweep"),
        of=lambda motion, against: motion.seen.jacobian_error_size,
        by=Largest(),
    ),
    Metric(
        "jacobian_error_excited_median",
        "m",
        "median norm of J - J_hat in the direction of the joint velocity",
        over="window",
        of=lambda motion, against: motion.seen.jacobian_error_along,
        by=Median(),
    ),
    Metric(
        "singular_value_min",
        "m",
        "smallest singular value of J; for a pose task, rotation rows included",
        shown=_shown("path", "posture", "return", "force"),
        of=lambda motion, against: least_singular_squares(motion.J),
        by=Smallest(_root),
    ),
    Metric(
        "saturated_fraction",
        "1",
        "fraction of the steps in which a bound cut the law's demand",
        shown=_shown("path", "posture", "return", "force", "sweep"),
        of=_observed("saturated"),
        by=Share(),
        of_law=True,
    ),
    *(
        metric
        for name in ("velocity", "acceleration")
        for metric in (
            Metric(
                f"{name}_bound_fraction",
                "1",
                f"fraction of the steps in which a joint's {name} is at its bound, within 1 %",
            ),
            Metric(
                f"{name}_bound_joint",
                "1",
                f"number, from 1, of the joint whose {name} is there most often; "
                "absent if none ever is",
            ),
        )
    ),
    *(
        Metric(
            f"limit_ratio_{order}_max",
            "1",
            f"largest ratio of a joint's {name} to its bound" + (_DIFFERENCES if order > 2 else ""),
            shown=_shown("return") if order <= 2 else frozenset(),
        )
        for order, name in enumerate(DERIVATIVE_UNITS, start=1)
    ),
    *(
        Metric(
            violation_metric(name),
            unit,
            f"largest excess of a joint's {name} over its bound; 0 within it"
            + (_DIFFERENCES if order > 2 else ""),
            of=_margin if name == "position" else None,
            by=Smallest(shortfall) if name == "position" else Largest(),
        )
        for order, (name, unit) in enumerate(LIMIT_UNITS.items())
    ),
    Metric(
        "held_jerk_violation_max_rad_s3",
        "rad/s^3",
        "largest excess over its bound of a joint's jerk from one held velocity to the next; 0 "
        "within it",
    ),
)

#: Names of all metrics.
METRIC_NAMES: tuple[str, ...] = tuple(metric.name for metric in METRICS)


def shown_in(place: Shown) -> tuple[str, ...]:
    """Return the names of the metrics that are shown in a place, in their order."""
    return tuple(metric.name for metric in METRICS if place in metric.shown)
