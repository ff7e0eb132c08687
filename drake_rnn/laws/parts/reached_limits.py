"""Limits as a law with a period meets them: a trace inside, and those alone that it can reach."""

from __future__ import annotations

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.dataclass_fields import unchecked
from ...robot.limits import JointLimits

# A joint stops this far before its limit [rad].
_SLACK = 1e-12


def inner_limits(limits: JointLimits) -> JointLimits:
    """Return limits whose position limits are a trace inside of those given.

    Args:
        limits: Limits of the joints, of one robot or of many.
    """
    lower, upper = limits.position_lower, limits.position_upper
    slack = functions_of(lower, upper).minimum(_SLACK, (upper - lower) / 4.0)
    return unchecked(limits, position_lower=lower + slack, position_upper=upper - slack)


# Stands for the infinite acceleration of a joint without limits [rad/s^2].
_UNBOUNDED = 1e9


def reached_limits(limits: JointLimits, period: float) -> JointLimits:
    """Return the limits that a box of velocities or accelerations is made of.

    Their acceleration is infinite if none is known, they have no jerk that no change of the
    acceleration in a period can reach, and their position limits are a trace inside of the true
    ones. An envelope of the velocity needs the box with a jerk: it has the largest that can be
    reached then, which bounds nothing.

    Args:
        limits: Limits of the joints.
        period: Time for which a velocity is held [s].
    """
    acceleration = np.inf if limits.acceleration is None else limits.acceleration
    known = inner_limits(limits).replace(acceleration=acceleration)
    if limits.jerk is None and limits.envelope is None:
        return known
    # How far a stop goes needs a finite acceleration: what the other limits leave of it.
    speed = np.minimum(limits.velocity, (limits.position_upper - limits.position_lower) / period)
    most = np.minimum(np.minimum(acceleration, 2.0 * speed / period), _UNBOUNDED)
    change = 2.0 * most / period
    jerk = change if limits.jerk is None else np.minimum(limits.jerk, change)
    if (jerk >= change).all() and limits.envelope is None:
        return known.replace(jerk=None)
    return known.replace(acceleration=most, jerk=jerk)
