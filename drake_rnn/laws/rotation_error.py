"""How far one orientation is from another, as a vector that an angular velocity can follow."""

from __future__ import annotations

import numpy as np

from ..fields import Array


def rotation_error(R_WE: Array, R_WE_desired: Array) -> Array:
    """Rotation vector, in the world frame, that takes E to where it should be, shape (3,) [rad].

    Beyond a right angle it grows shorter again, but still points the right way.

    Args:
        R_WE: Orientation of E, shape (3, 3).
        R_WE_desired: What it should be, shape (3, 3).
    """
    # Half of the antisymmetric part: sin(angle) times the axis.
    E = R_WE_desired @ R_WE.T
    return 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
