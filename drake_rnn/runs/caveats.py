"""Warnings after a run: what its motion says of the contact and of the motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..experiment import Experiment, Forecast
from ..measures import FollowingMetrics, GapMetrics, violation_metric
from ..measures.groups.rest import LOOKING
from ..robot.limits import LIMIT_UNITS
from ..systems import Body

# Distance from the command beyond which an arm is said not to follow it: of the end effector [m]
# and of a joint [rad].
_FAR, _FAR_JOINT = 5e-3, 0.02
# Speed of joints to and fro, and in the end, from which on they do not rest [rad/s].
_RESTLESS = 0.01
# Excess of a limit that is no rounding error [rad, rad/s and so on].
_BEYOND = 1e-6


def standing(found: Sequence[Forecast], metrics: Mapping[str, float]) -> list[str]:
    """Return the forecasts that a run with these metrics has not disproved.

    That a path asks for more than a limit is estimated from the least joint velocities. A law with
    others may follow the path within the limit, without having cut what it demanded.

    Args:
        found: Warnings from before the run.
        metrics: Metrics of the run.
    """
    cut = metrics.get("saturated_fraction", 0.0) > 0.0
    excess = {name: metrics.get(violation_metric(name), np.inf) for name in LIMIT_UNITS if not cut}
    return [each.text for each in found if excess.get(each.limit or "", np.inf) > 0.0]


def limit_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return warnings about limits that the arm exceeded.

    Those that are kept by construction have a verdict of their own. Limits of position and velocity
    no arm can exceed; higher ones count if the law keeps them of its command. Of what the path
    itself asks for too much there was a warning before the run.
    """
    caveats, guarantees = [], experiment.guarantees
    counted = {"position", "velocity", *guarantees.command_only}
    for name, unit in LIMIT_UNITS.items():
        excess = metrics.get(violation_metric(name), 0.0)
        if name in counted and excess > _BEYOND and name not in guarantees.arm.limits:
            caveats.append(
                f"limits: the arm exceeds a limit of {name} by {excess:.3g} {unit}; "
                f"{_why(name, experiment)}"
            )
    return caveats


def _why(name: str, experiment: Experiment) -> str:
    """Return why a limit is not kept."""
    if name not in experiment.guarantees.command.limits:
        remedy = experiment.law.limits_remedy
        return f"this law does not keep it{remedy and '; ' + remedy}"
    if experiment.level.has_motors:
        return "the law keeps it of the command, and motors follow that with errors"
    return "noise, a filter or errors of measurement lie between this law and the arm"


def distance_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return a warning if the arm collided, or came nearer than the law lets its command come."""
    distance = metrics.get("distance_min_m", np.inf)
    floor = experiment.guarantees.command.distance or 0.0
    moving = metrics.get("distance_moving_min_m", distance)
    if distance < floor <= moving:
        return [
            f"obstacles: one comes as near as {distance:.3g} m to the arm while that stands still"
        ]
    if distance < 0.0:
        return [f"obstacles: the arm collides, by up to {-distance:.3g} m"]
    if distance < floor - _BEYOND:
        return [
            f"obstacles: the arm comes as near as {distance:.3g} m; of its command the law keeps "
            f"{floor:g} m"
        ]
    return []


def rest_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return a warning if joints keep going to and fro although their target rests.

    Joints that move in one direction may be on their way to a posture, without moving the end
    effector; they are not counted, nor are those that make way for obstacles that move.
    """
    swing = metrics.get("rest_swing_max_rad_s", 0.0)
    last = metrics.get("rest_velocity_max_rad_s", 0.0)
    makes_way = "distance_moving_min_m" in metrics
    if min(swing, last) <= _RESTLESS or makes_way or _turns_on(experiment):
        return []
    slower = "; or raise limits.jerk" if experiment.limits.jerk is not None else ""
    return [
        f"rest: a joint keeps going to and fro by {swing:.3g} rad/s, in the end with {last:.3g} "
        "rad/s rms, while the target rests; if the target is out of reach, bring it into reach; if "
        f"not, lower the gain of the feedback{slower}"
    ]


def _turns_on(experiment: Experiment) -> bool:
    """Return whether the desired orientation still moves when the run ends."""
    if not experiment.holds_orientation:
        return False
    end = experiment.document.duration
    rates = [experiment.desired.orientation(t)[1] for t in (end - LOOKING, end)]
    return bool(np.abs(rates).max() > _BEYOND)


def image_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return a warning if a point left the image, where no camera would see it."""
    margin = metrics.get("image_margin_min_px", 0.0)
    if margin >= 0.0:
        return []
    return [
        f"camera: a point leaves the image, by up to {-margin:.3g} px; it was seen as if the image "
        "were larger"
    ]


def contact_caveats(gap: GapMetrics, metrics: Mapping[str, float]) -> list[str]:
    """Return warnings about a contact that was never made, or lost."""
    caveats = []
    if gap.force_seen is False:
        caveats.append("contact: the tool never touched the surface")
    if "contact_lost_time_s" in metrics:
        caveats.append(f"contact: lost at t = {metrics['contact_lost_time_s']:.4g} s")
    return caveats


def motor_caveats(
    arm: Body, following: FollowingMetrics, metrics: Mapping[str, float]
) -> list[str]:
    """Return a warning if the arm is far from what its motors are told: 5 mm, or 0.02 rad.

    The measure is the distance from the command, not from the path: where motors are too weak for
    the feedback of a law that measures the arm, the command itself leaves the path. It is absolute
    because motors with the default gains lag by tenths of a millimetre, whatever the law's error.

    Args:
        arm: Body that was moved.
        following: Where it is farthest from its command.
        metrics: Metrics of the run.
    """
    away = metrics.get("command_error_max_m")
    if following.worst is None or away is None:
        return []
    off, joint, time = following.worst
    if not (away > _FAR or off > _FAR_JOINT):
        return []
    return [
        f"plant: the arm is far from its command: {arm.arm.joints[joint]} by up to "
        f"{off:.3g} rad, at t = {time:.4g} s, and the end effector by up to "
        f"{away:.3g} m; {arm.remedy(joint, off)}"
    ]
