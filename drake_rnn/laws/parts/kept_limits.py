"""Names of the limits that a law declares to keep, by what chooses its velocity.

A velocity that is chosen within all bounds, with the stop behind it, keeps all that are known. A
velocity that lags behind targets within a box keeps what its time constant lets it keep.

The box is that of `JointLimits.velocity_box`, with stiffness k. As a mean of targets, the velocity
never exceeds its largest speed. If it follows its target with the time constant tau, the distance s
to a position limit obeys tau s'' + s' + k s >= 0, so that from rest it reaches zero only if that
equation oscillates, for 4 k tau > 1.
"""

from __future__ import annotations

from ...robot.limits import JointLimits


def limits_within_bounds(limits: JointLimits) -> tuple[str, ...]:
    """Return the names of the limits that a velocity within all bounds keeps, up to the jerk.

    Args:
        limits: Limits that are known.
    """
    higher = (name for name in ("acceleration", "jerk") if limits.bounds[name] is not None)
    return ("position", "velocity", *higher, *(("envelope",) if limits.envelope else ()))


def kept_with_lag(limit_stiffness: float, time_constant: float) -> tuple[str, ...]:
    """Return the names of the limits that a velocity keeps which lags behind targets in a box.

    Args:
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
        time_constant: Time constant of the velocity [s].
    """
    if 4.0 * limit_stiffness * time_constant <= 1.0:
        return ("position", "velocity")
    return ("velocity",)
