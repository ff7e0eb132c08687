"""The largest inertia that each joint of an arm has to move."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from .arm import Arm
from .postures import random_postures

# Number of postures; a larger number raises the result by less than 8 %.
_POSTURES = 1000


def largest_inertia(arm: Arm) -> Array:
    """Return the largest inertia of each joint over the postures of an arm, (n,) [kg m^2].

    For joint i it is the largest sum over j of abs(M_ij), where M is the mass matrix with the tool,
    over the home posture and 1000 `random_postures`, which are always the same. With R the diagonal
    matrix of these sums, R - M is positive semidefinite at these postures, because it is diagonally
    dominant.

    Args:
        arm: The arm.
    """
    postures = random_postures(arm, _POSTURES)
    if arm.home is not None:
        postures = np.vstack((arm.home, postures))
    M = arm.kinematics().M
    return np.max([np.abs(M(q)).sum(axis=1) for q in postures], axis=0)
