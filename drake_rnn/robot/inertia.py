"""The largest inertia that each joint of an arm has to move."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from .arm import Arm

# Number of postures; more of them raise the result by less than 8 %. For a joint without a limit
# on one side or both, the part of its range that they cover [rad].
_POSTURES = 1000
_RANGE = np.pi


def largest_inertia(arm: Arm) -> Array:
    """Return the largest inertia of each joint over the postures of an arm, (n,) [kg m^2].

    It is the largest sum over j of abs(M_ij), where M is the mass matrix, tool included, over the
    home posture and 1000 others within the position limits, drawn at random but always the same.
    With R the diagonal matrix of these sums, R - M is positive semidefinite at these postures,
    because it is diagonally dominant.

    Args:
        arm: The arm; the postures lie within its position limits.
    """
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    middle = np.where(
        np.isfinite(lower), lower + _RANGE, np.where(np.isfinite(upper), upper - _RANGE, 0.0)
    )
    lower = np.where(np.isfinite(lower), lower, middle - _RANGE)
    upper = np.where(np.isfinite(upper), upper, middle + _RANGE)
    postures = np.random.default_rng(0).uniform(lower, upper, (_POSTURES, arm.n))
    if arm.home is not None:
        postures = np.vstack((arm.home, postures))
    M = arm.kinematics().M
    return np.max([np.abs(M(q)).sum(axis=1) for q in postures], axis=0)
