r"""The damped pseudoinverse :math:`J^T (J J^T + \mu^2 I)^{-1}`, which always exists."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array


def damped_joint_velocity(J: Array, v_WE: Array, damping: float) -> Array:
    """Return the joint velocities that bring ``v_WE`` about as well as damping admits, (n,).

    Args:
        J: Jacobian, shape (m, n) [m].
        v_WE: Wanted velocity of the end effector, shape (m,) [m/s].
        damping: mu [m].
    """
    gram = J @ J.T + damping**2 * np.eye(J.shape[0])
    return np.asarray(J.T @ np.linalg.solve(gram, v_WE))
