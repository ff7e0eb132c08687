r"""The damped pseudoinverse :math:`J^T (J J^T + \mu^2 I)^{-1}`, which always exists."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array


def damped_joint_velocity(J: Array, v_WE: Array, damping: float) -> Array:
    """Return the joint velocities that produce ``v_WE``, up to the damping, shape (n,) [rad/s].

    Args:
        J: Jacobian, shape (m, n) [m].
        v_WE: Desired velocity of the end effector, shape (m,) [m/s].
        damping: Damping mu [m].
    """
    gram = J @ J.T + damping**2 * np.eye(J.shape[0])
    return np.asarray(J.T @ np.linalg.solve(gram, v_WE))
