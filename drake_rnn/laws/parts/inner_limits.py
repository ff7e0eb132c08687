"""Limits with a trace of room before each position limit, so that rounding leads beyond none."""

from __future__ import annotations

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
