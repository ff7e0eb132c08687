"""The list of metrics: names, units and meanings, how each is taken, and where it is shown.

It determines the keys that an experiment's ``accept`` may have, the tables on a terminal, the table
of the overview figure, and the page of metrics in the documentation. Runs in Drake, runs side by
side and compiled runs all take their metrics as this list says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import overload

from ..arrays.algebra import (
    least_singular_squares,
    lengths,
)
from ..errors import InvalidInputError
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS
from .metric import (
    LASTING,
    NEAR_PX,
    RATIO_METRICS,
    Change,
    FirstTime,
    Integral,
    Largest,
    LargestObservable,
    Last,
    Mean,
    Median,
    Metric,
    ReportPart,
    RootMean,
    Settling,
    Share,
    Smallest,
    below,
    distance,
    envelope_margin,
    envelope_ratio,
    error_after_lock,
    error_before_lock,
    error_lasting,
    margin,
    mean,
    pixel_error,
    pixel_error_after_swap,
    pixel_error_before_swap,
    returning,
    root_of,
    seen_close,
    seen_close_again,
    settled_after_lock,
    shortfall,
    square,
    top,
    violation_metric,
)

#: Joint error below which an arm has arrived at its target [rad].
ARRIVAL_TOLERANCE = 0.01

# Distances to limits that are no magnitudes of a derivative.
_MARGINS = {"position": margin, "envelope": envelope_margin}
_EXCESS = {"envelope": "largest excess of a joint's velocity over its envelope; 0 within it"}
_DIFFERENCES = ", from velocity differences over 10 ms"

# All metrics of this package, in the order in which they are shown.
_OWN_METRICS: tuple[Metric, ...] = (
    Metric(
        "position_error_max_m",
        "largest norm of the position error; in contact, of its part along the surface",
        over="window",
        shown=("path", "return", "sweep"),
        of=lambda motion, against: motion.error_length,
    ),
    Metric(
        "position_error_component_max_m",
        "largest position error along any axis",
        over="window",
        of=lambda motion, against: top(motion.error),
    ),
    Metric(
        "position_error_rms_m",
        "root mean square of the norm of the position error",
        over="window",
        shown=("path", "sweep"),
        of=lambda motion, against: motion.error_length**2,
        by=RootMean,
    ),
    Metric("path_delay_s", "delay with which the arm follows its path because of the filter"),
    Metric(
        "velocity_error_max_m_s",
        "largest norm of the end effector's velocity error",
        over="window",
        shown=("return", "sweep"),
        of=lambda motion, against: lengths(motion.velocity_error),
    ),
    Metric(
        "velocity_error_component_max_m_s",
        "largest velocity error along any axis",
        over="window",
        of=lambda motion, against: top(motion.velocity_error),
    ),
    Metric(
        "settling_time_s",
        "time after which the position error stays below settling_tolerance_m",
        shown=("path", "sweep"),
        of=lambda motion, against: motion.error_length < against.settling_tolerance,
        by=Settling(),
    ),
    Metric(
        "position_error_before_lock_max_m",
        "largest norm of the position error before the first joint locks",
        over="window",
        shown=("path", "return", "sweep"),
        of=error_before_lock,
    ),
    Metric(
        "position_error_after_lock_max_m",
        "largest norm of the position error once the last joint that locks has begun to",
        over="window",
        shown=("path", "return", "sweep"),
        of=error_after_lock,
    ),
    Metric(
        "position_error_lasting_max_m",
        f"the same from {LASTING:g} s later: what is left when the arm has had time to settle",
        over="window",
        shown=("path", "return", "sweep"),
        of=error_lasting,
    ),
    Metric(
        "resettling_time_s",
        "time of the run, at or after the last lock of a joint, from which on the position error "
        "stays below settling_tolerance_m",
        shown=("path", "sweep"),
        of=settled_after_lock,
        by=Settling(),
    ),
    Metric(
        "pixel_error_max_px",
        "largest distance of a point on the tool from where a camera is to see it",
        over="window",
        shown=("path", "sweep"),
        of=pixel_error,
    ),
    Metric(
        "pixel_error_rms_px",
        "root mean square of the distance of the point that is farthest off",
        over="window",
        shown=("path", "sweep"),
        of=lambda motion, against: square(pixel_error(motion, against)),
        by=RootMean,
    ),
    Metric(
        "pixel_settling_time_s",
        f"time after which all points stay within {NEAR_PX:g} px of their target pixels",
        shown=("path", "sweep"),
        of=seen_close,
        by=Settling(),
    ),
    Metric(
        "pixel_error_before_swap_max_px",
        "largest distance of a point before the camera is swapped first",
        over="window",
        shown=("path", "sweep"),
        of=pixel_error_before_swap,
    ),
    Metric(
        "pixel_error_after_swap_max_px",
        "largest distance of a point from the last swap of the camera on",
        over="window",
        shown=("path", "sweep"),
        of=pixel_error_after_swap,
    ),
    Metric(
        "pixel_resettling_time_s",
        "time of the run, at or after the last swap of the camera, from which on all points stay "
        f"within {NEAR_PX:g} px",
        shown=("path", "sweep"),
        of=seen_close_again,
        by=Settling(),
    ),
    Metric(
        "image_margin_min_px",
        "smallest distance of a point from the edge of the image; negative out of it",
        shown=("path",),
        of=lambda motion, against: motion.image and motion.image.margin,
        by=Smallest(),
    ),
    Metric(
        "force_error_mean_N",
        "mean of the true normal force minus the desired one",
        over="window",
        shown=("force",),
        of=lambda motion, against: motion.pressing and motion.pressing.error,
        by=Mean(),
    ),
    Metric(
        "force_error_rms_N",
        "root mean square of the force error",
        over="window",
        shown=("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.pressing.error**2,
        by=RootMean,
    ),
    Metric(
        "force_error_max_N",
        "largest magnitude of the force error",
        over="window",
        shown=("force", "sweep"),
        of=lambda motion, against: motion.pressing and abs(motion.pressing.error),
    ),
    Metric(
        "force_error_end_N",
        "the true normal force minus the desired one when the run ends",
        of=lambda motion, against: motion.pressing and motion.pressing.error,
        by=Last(),
    ),
    Metric(
        "normal_force_peak_N",
        "largest true force along the surface's normal",
        shown=("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.pressing.force,
    ),
    Metric(
        "force_rise_time_s",
        "time at which the true normal force first reaches 95 % of what is desired in the end",
        of=lambda motion, against: motion.pressing and motion.pressing.has_risen,
        by=FirstTime(),
    ),
    Metric(
        "lateral_error_max_m",
        "largest position error along the surface",
        over="window",
        shown=("force", "sweep"),
        of=lambda motion, against: motion.pressing and motion.error_length,
    ),
    Metric(
        "joint_error_max_rad",
        "largest distance of a joint from the target posture at the end of the run",
        shown=("posture", "sweep"),
        of=lambda motion, against: motion.target_error,
        by=Last(),
    ),
    Metric(
        "joint_settling_time_s",
        "time after which all joints stay within 0.01 rad of the target posture",
        shown=("posture", "sweep"),
        of=lambda motion, against: below(motion.target_error, ARRIVAL_TOLERANCE),
        by=Settling(),
    ),
    Metric(
        "target_error_max_rad",
        "largest norm of the way of the joints to the newest of joint targets",
        over="window",
        shown=("path", "sweep"),
        of=lambda motion, against: motion.following_error,
    ),
    Metric(
        "target_error_rms_rad",
        "root mean square of that norm",
        over="window",
        shown=("path", "sweep"),
        of=lambda motion, against: square(motion.following_error),
        by=RootMean,
    ),
    Metric(
        "end_effector_drift_max_m",
        "largest distance of the end effector from its start",
        shown=("posture", "sweep"),
    ),
    Metric(
        "end_effector_drift_end_m",
        "distance of the end effector from its start at the end of the run",
        shown=("posture",),
    ),
    Metric(
        "orientation_error_max_rad",
        "largest angle between the end effector's orientation and the desired one",
        over="window",
        shown=("path", "posture", "force", "sweep"),
        of=lambda motion, against: motion.orientation_error,
    ),
    Metric(
        "orientation_error_rms_rad",
        "root mean square of that angle",
        over="window",
        of=lambda motion, against: square(motion.orientation_error),
        by=RootMean,
    ),
    Metric(
        "orientation_rank_min",
        "smallest rank of the Jacobian rows with which the law holds the orientation",
        of=LargestObservable("orientation_rank"),
        by=Smallest(),
    ),
    Metric(
        "contact_lost_fraction",
        "fraction of the steps without contact",
        over="window",
        shown=("force",),
        of=lambda motion, against: motion.pressing and ~motion.pressing.touching,
        by=Share(),
    ),
    Metric(
        "contact_lost_time_s",
        "time at which contact was lost for more than 50 ms, or the law detected a loss",
        shown=("force",),
        of=LargestObservable("contact_lost"),
        by=FirstTime(),
    ),
    Metric(
        "invariant_error_max_m",
        "largest difference of the end effector's displacement from that in the multipliers",
        shown=("posture",),
    ),
    Metric(
        "shortest_duration_s",
        "shortest duration of the path within the limits (`drake-rnn fastest`)",
    ),
    Metric(
        "joint_drift_mean_rad",
        "joint displacement from the window's first to its last step, mean over the joints; "
        "only for a path that ends where it began",
        over="window",
        shown=("return", "sweep"),
        of=returning,
        by=Change(mean),
    ),
    Metric(
        "joint_drift_max_rad",
        "joint displacement from the window's first to its last step, largest over the joints; "
        "only for a path that ends where it began",
        over="window",
        shown=("path", "return", "sweep"),
        of=returning,
        by=Change(top),
    ),
    Metric(
        "lap_drift_max_rad",
        "joint displacement over the last whole lap, whatever the window, largest over the joints; "
        "from its beginning to the last step of the run",
    ),
    Metric(
        "joint_velocity_initial_rad_s",
        "largest joint speed after the first step",
        shown=("posture",),
        of=lambda motion, against: top(motion.speed[1:2]) if motion.begins else None,
    ),
    Metric(
        "joint_acceleration_initial_rad_s2",
        "largest joint acceleration over the first step",
        shown=("posture",),
        of=lambda motion, against: top(motion.joint_acceleration[:1]) if motion.begins else None,
    ),
    Metric(
        "joint_velocity_max_rad_s",
        "largest joint speed",
        shown=("path", "posture", "return", "force"),
        of=lambda motion, against: top(motion.speed),
    ),
    Metric(
        "rest_swing_max_rad_s",
        "mean speed with which a joint goes to and fro, over at least 2 s from 2 s after its "
        "target has come to rest: its way less that from there to here, over the time",
    ),
    Metric(
        "rest_velocity_max_rad_s",
        "root mean square of a joint's speed over the last half second of that time",
    ),
    Metric(
        "joint_acceleration_max_rad_s2",
        "largest joint acceleration: velocity change over the time for which a velocity is held",
        shown=("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: top(motion.acceleration_magnitude),
    ),
    Metric("joint_jerk_max_rad_s3", "largest joint jerk" + _DIFFERENCES),
    Metric("joint_jerk_rms_rad_s3", "root mean square of the jerk of all joints" + _DIFFERENCES),
    Metric(
        "network_acceleration_max_rad_s2",
        "largest acceleration of the law's own velocity, where that differs from the arm's",
        shown=("path", "sweep"),
    ),
    Metric(
        "joint_acceleration_demand_max_rad_s2",
        "largest joint acceleration that the law demanded before it was bounded",
        shown=("return",),
        of=LargestObservable("acceleration_demand"),
    ),
    Metric(
        "joint_limit_margin_min_rad",
        "smallest distance to a position limit; negative beyond it",
        shown=("path", "posture", "force"),
        of=margin,
        by=Smallest(),
    ),
    Metric(
        "envelope_margin_min_rad_s",
        "smallest distance of a joint's velocity to its envelope, which falls towards its position "
        "limits; negative beyond it",
        shown=("path", "posture", "return", "force"),
        of=envelope_margin,
        by=Smallest(),
    ),
    Metric(
        "envelope_ratio_max",
        "largest ratio of a joint's velocity to that of its envelope, both with the envelope's "
        "offset added",
        of=envelope_ratio,
    ),
    Metric(
        "distance_min_m",
        "least distance of the arm's capsules from each other and from obstacles, between steps "
        "too; negative where they overlap",
        shown=("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: motion.distance,
        by=Smallest(),
    ),
    Metric(
        "distance_moving_min_m",
        "the same while the arm moves, where obstacles move: what stands still may be run into",
        shown=("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: motion.distance_moving,
        by=Smallest(),
    ),
    Metric(
        "arms_distance_min_m",
        "the same of links of two arms that one law moves, without links of one arm and obstacles",
        shown=("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: motion.arms_distance,
        by=Smallest(),
    ),
    Metric(
        "command_error_max_m",
        "largest distance of the end effector from where the command to the motors places it",
        shown=("path", "posture", "return", "force", "sweep"),
        of=lambda motion, against: distance(motion.p_WE, motion.p_WE_commanded),
    ),
    Metric("command_error_max_rad", "largest distance of a joint from the command to its motor"),
    Metric(
        "jacobian_error_median",
        "median of the Frobenius norm of J - J_hat",
        unit_if_unnamed="m",
        over="window",
        shown=("path", "force", "sweep"),
        of=lambda motion, against: motion.motion_seen_by_law.jacobian_error_size,
        by=Median(),
    ),
    Metric(
        "jacobian_error_max",
        "largest Frobenius norm of J - J_hat",
        unit_if_unnamed="m",
        over="window",
        shown=("sweep",),
        of=lambda motion, against: motion.motion_seen_by_law.jacobian_error_size,
    ),
    Metric(
        "jacobian_error_excited_median",
        "median norm of J - J_hat in the direction of the joint velocity",
        unit_if_unnamed="m",
        over="window",
        of=lambda motion, against: motion.motion_seen_by_law.jacobian_error_along,
        by=Median(),
    ),
    Metric(
        "singular_value_min",
        "smallest singular value of J; for a pose task, rotation rows included",
        unit_if_unnamed="m",
        shown=("path", "posture", "return", "force"),
        of=lambda motion, against: least_singular_squares(motion.J),
        by=Smallest(root_of),
    ),
    Metric(
        "saturated_fraction",
        "fraction of the steps in which a bound cut the law's demand",
        shown=("path", "posture", "return", "force", "sweep"),
        of=LargestObservable("saturated"),
        by=Share(),
    ),
    Metric(
        "torque_ratio_max",
        "largest ratio of a joint's torque to its limit, of a law that commands torques",
        shown=("path", "posture", "return", "sweep"),
        of=LargestObservable("torque_share"),
    ),
    Metric(
        "joint_work_J",
        "integral over time of the power of the joints, each without its sign, of such a law",
        shown=("path", "posture", "return", "sweep"),
        of=LargestObservable("joint_power"),
        by=Integral(),
    ),
    *(
        metric
        for name in ("velocity", "acceleration")
        for metric in (
            Metric(
                f"{name}_bound_fraction",
                f"fraction of the steps in which a joint's {name} is at its bound, within 1 %",
            ),
            Metric(
                f"{name}_bound_joint",
                f"number, from 1, of the joint whose {name} is there most often; "
                "absent if none ever is",
            ),
        )
    ),
    *(
        Metric(
            metric,
            f"largest ratio of a joint's {name} to its bound" + (_DIFFERENCES if order > 2 else ""),
            shown=("return",) if order <= 2 else (),
        )
        for order, (name, metric) in enumerate(RATIO_METRICS.items(), start=1)
    ),
    *(
        Metric(
            violation_metric(name),
            _EXCESS.get(name, f"largest excess of a joint's {name} over its bound; 0 within it")
            + (_DIFFERENCES if order > 2 and name in DERIVATIVE_UNITS else ""),
            of=_MARGINS.get(name),
            by=Smallest(shortfall) if name in _MARGINS else Largest(),
        )
        for order, name in enumerate(LIMIT_UNITS)
    ),
    Metric(
        "held_jerk_violation_max_rad_s3",
        "largest excess over its bound of a joint's jerk from one held velocity to the next; 0 "
        "within it",
    ),
)


class Metrics(Sequence[Metric]):
    """Metrics, in the order in which they are shown; features of installed packages add theirs.

    Args:
        metrics: The metrics of this package.
    """

    def __init__(self, metrics: Sequence[Metric]) -> None:
        self._known: dict[str, Metric] = {}
        self.add(*metrics)

    def add(self, *metrics: Metric) -> None:
        """Add metrics behind the others.

        Raises:
            InvalidInputError: If another one has the name.
        """
        for metric in metrics:
            if self._known.setdefault(metric.name, metric) is not metric:
                raise InvalidInputError(f"{metric.name}: there is another metric of this name")

    def remove(self, *metrics: Metric) -> None:
        """Forget metrics that were added."""
        for metric in metrics:
            self._known.pop(metric.name, None)

    @property
    def by_name(self) -> Mapping[str, Metric]:
        """The metrics by their names."""
        return self._known

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._known)

    @overload
    def __getitem__(self, number: int) -> Metric: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[Metric]: ...
    def __getitem__(self, number: int | slice) -> Metric | Sequence[Metric]:
        return list(self._known.values())[number]

    def __len__(self) -> int:
        return len(self._known)

    def __iter__(self) -> Iterator[Metric]:
        return iter(self._known.values())


#: All metrics, in the order in which they are shown.
METRICS = Metrics(_OWN_METRICS)


def place_metrics(place: ReportPart) -> tuple[str, ...]:
    """Return the names of the metrics that are shown in a place, in their order."""
    return tuple(metric.name for metric in METRICS if place in metric.shown)
