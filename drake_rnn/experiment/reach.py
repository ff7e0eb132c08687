"""Check of whether a path is within an arm's reach, and how close it comes to its limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import require_type
from ..robot.postures import LEVER, PoseAim, damped_inverse
from .experiment import Experiment

_SAMPLES, _MOST_SAMPLES = 400, 10_000
# Largest distance between two points on a long path [m].
_SPACING = 0.01
#: Distance from its path that a posture may miss it by [m].
MISS = 1e-3
# Miss that only a slip of the unit explains [m].
_FAR = 10.0


@dataclass(frozen=True)
class Reach:
    """A path followed by damped least squares from the start posture, at k points.

    Attributes:
        time: Time of each point, shape (k,) [s].
        position: Joint positions, shape (k, n) [rad].
        miss: Distance from the path, shape (k,) [m]; if the orientation matters, including its
            error [rad] times a lever of 0.2 m.
        singular_value: Smallest singular value of J, whose rotations are weighted, shape (k,) [m].
        velocity: Joint velocities J^+ v_WE_desired, shape (k, n) [rad/s].
        acceleration: Time derivative of ``velocity``, shape (k, n) [rad/s^2].
        desired: Points of the path, shape (k, m) [m].
    """

    time: Array
    position: Array
    miss: Array
    singular_value: Array
    velocity: Array
    acceleration: Array
    desired: Array


def follow(experiment: Experiment, samples: int = _SAMPLES) -> Reach:
    """Follow the experiment's path by inverse kinematics while it runs, passing the path once.

    Args:
        experiment: The experiment.
        samples: Number of points; a long path gets more.
    """
    rows, desired_motion = list(experiment.task.axes), experiment.desired
    kinematics = experiment.arm.kinematics()
    aim = PoseAim(kinematics, rows, None)
    # In contact the path lies on the surface.
    shift = np.zeros(3)
    if experiment.contact is not None:
        shift = experiment.contact.surface.gap * experiment.contact.surface.normal_W
    times = reach_times(experiment, samples)
    # Once the path is lost, a few points suffice to find the largest miss.
    stride = math.ceil(times.size / samples)
    q = experiment.start.copy()
    time: list[float] = []
    miss: list[float] = []
    position, jacobian, velocity, points = [], [], [], []
    is_lost = False
    for number, t in enumerate(times.tolist()):
        if is_lost and number % stride:
            continue
        time.append(t)
        p, v, _ = desired_motion.position(t)
        target, w = (p - shift)[rows], np.zeros(0)
        if experiment.holds_orientation:
            R, w, _ = desired_motion.orientation(t)
            aim = PoseAim(kinematics, rows, R)
        # Once the path is lost, only the distance matters, so fewer iterations suffice.
        q, distance = aim.descend(q, target, 20) if is_lost else aim.reach(q, target)
        J = aim.J(q)
        position.append(q)
        points.append(target)
        miss.append(distance)
        is_lost = is_lost or distance > MISS
        jacobian.append(J)
        demand = np.concatenate((LEVER * w, v[rows]))
        velocity.append(damped_inverse(J) @ demand)
    return Reach(
        time=np.array(time),
        position=np.array(position),
        miss=np.array(miss),
        singular_value=np.linalg.svd(np.array(jacobian), compute_uv=False)[:, -1],
        velocity=np.array(velocity),
        acceleration=np.gradient(np.array(velocity), np.array(time), axis=0),
        desired=np.array(points),
    )


def reach_times(experiment: Experiment, samples: int = _SAMPLES) -> Array:
    """Return the times at which a path is followed, shape (k,) [s].

    Args:
        experiment: The experiment.
        samples: Number of times; a long path gets more.
    """
    end = min(experiment.desired.traversal, experiment.document.duration)
    position = experiment.desired.position
    points = np.array([position(t)[0] for t in np.linspace(0.0, end, samples).tolist()])
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if not math.isfinite(length):
        raise InvalidInputError(f"path: must have a finite length, not {length} m")
    return np.linspace(0.0, end, min(max(samples, math.ceil(length / _SPACING)), _MOST_SAMPLES))


class Forecast(NamedTuple):
    """A warning about a path that a run may prove wrong.

    Attributes:
        text: The warning.
        limit: Limit that the path asks the arm to exceed; None for any other warning.
    """

    text: str
    limit: str | None = None


def check_reach(experiment: Experiment) -> list[str]:
    """Return the experiment's warnings, then those about its path.

    Raises:
        InvalidInputError: As `forecasts` does.
    """
    require_type("experiment", experiment, Experiment)
    return [*experiment.warnings, *(forecast.text for forecast in forecasts(experiment))]


def forecasts(experiment: Experiment) -> list[Forecast]:
    """Return warnings about the experiment's path.

    The posture of a redundant arm is not unique: limits that the least-squares posture meets may
    be avoidable, so they cause a warning, not an error.

    Raises:
        InvalidInputError: If inverse kinematics misses the path by more than 1 mm, or the motors
            are too weak for the pressing force.
    """
    # Joints that are told where to go need no inverse kinematics.
    if experiment.target is not None or experiment.targets is not None:
        return []
    _require_within_task(experiment)
    reach = follow(experiment)
    worst = int(np.argmax(reach.miss))
    if reach.miss[worst] > MISS:
        first = int(np.argmax(reach.miss > MISS))
        place = ", ".join(f"{value:.4g}" for value in reach.desired[first])
        text = (
            f"path: out of reach: {experiment.arm.name} misses the point ({place}) m, at "
            f"t = {reach.time[first]:.4g} s, by {reach.miss[first] * 1e3:.3g} mm; "
            f"the largest miss is {reach.miss[worst]:.3g} m at t = {reach.time[worst]:.4g} s"
        )
        if reach.miss[worst] > _FAR:
            text += "; lengths are in metres: are these millimetres?"
        if experiment.document.on_unreachable == "follow":
            return [Forecast(text)]
        raise InvalidInputError(text)
    _require_torque(experiment, reach)
    places = [*_near_limits(experiment, reach), *_near_singular(experiment, reach)]
    return [*map(Forecast, places), *_beyond_bounds(experiment, reach)]


def _near_limits(experiment: Experiment, reach: Reach) -> list[str]:
    limits = experiment.limits
    margin = np.minimum(
        reach.position - limits.position_lower, limits.position_upper - reach.position
    )
    k, joint = np.unravel_index(np.argmin(margin), margin.shape)
    left = float(margin[k, joint])
    if left >= 0.05:
        return []
    name, unit = experiment.arm.joints[joint], experiment.arm.units[joint]
    place = f"comes within {left:.3g} {unit} of" if left >= 0 else f"goes {-left:.3g} {unit} beyond"
    return [f"path: {name} {place} its limit near t = {reach.time[k]:.3g} s"]


def _near_singular(experiment: Experiment, reach: Reach) -> list[str]:
    k = np.argmin(reach.singular_value)
    if reach.singular_value[k] >= 0.05:
        return []
    # The metric singular_value_min does not weigh rotations.
    weighting = f" with rotations weighted by {LEVER:g} m" if experiment.holds_orientation else ""
    return [
        f"path: near-singular posture near t = {reach.time[k]:.3g} s: smallest singular value of J"
        f"{weighting} {reach.singular_value[k]:.3g}"
    ]


def _beyond_bounds(experiment: Experiment, reach: Reach) -> list[Forecast]:
    warnings = []
    for article, name, per, demand in (
        ("a", "velocity", "/s", reach.velocity),
        ("an", "acceleration", "/s^2", reach.acceleration),
    ):
        bound = experiment.limits.bounds[name]
        if bound is None:
            continue
        ratio = np.abs(demand) / bound
        k, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
        if ratio[k, joint] > 1.0:
            text = (
                f"path: asks {experiment.arm.joints[joint]} for {article} {name} of "
                f"{ratio[k, joint] * bound[joint]:.3g} {experiment.arm.units[joint]}{per} "
                f"near t = {reach.time[k]:.3g} s; "
                f"its limit is {bound[joint]:.3g}"
            )
            warnings.append(Forecast(text, name))
    return warnings


def _require_torque(experiment: Experiment, reach: Reach) -> None:
    """Raise an InvalidInputError if the motors cannot hold gravity and the pressing force."""
    if experiment.contact is None or not experiment.level.has_motors:
        return
    kinematics, effort = experiment.arm.kinematics(), experiment.arm.effort
    most = max(experiment.contact.force.value, experiment.contact.force.initial)
    force = most * experiment.contact.surface.normal_W
    for t, q in zip(reach.time, reach.position, strict=True):
        torque = np.abs(kinematics.gravity(q) + kinematics.J(q).T @ force)
        weakest = int(np.argmax(torque - effort))
        if torque[weakest] > effort[weakest]:
            unit = "N" if experiment.arm.units[weakest] == "m" else "Nm"
            raise InvalidInputError(
                f"force.value: {most:g} N asks {experiment.arm.joints[weakest]} "
                f"for {torque[weakest]:.4g} {unit} near t = {t:.3g} s; its motor has "
                f"{effort[weakest]:g} {unit}"
            )


def _require_within_task(experiment: Experiment) -> None:
    """Raise an InvalidInputError if a planar task would silently ignore part of its path."""
    # What a list of objectives leaves free is left free on purpose.
    if experiment.law_task.objectives:
        return
    axes = [axis for axis in range(3) if axis not in experiment.task.axes]
    extent = np.ptp(experiment.desired.sample(50)[:, axes], axis=0).max(initial=0.0)
    if extent > 1e-9:
        raise InvalidInputError(
            f"path: leaves the plane of task {experiment.document.task} by {extent:.3g} m; "
            "give a path in that plane"
        )
