r"""The damped pseudoinverse :math:`J^T (J J^T + \mu^2 I)^{-1}`, which always exists."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import matmul, matvec, scaled, solved_for, transposed
from ...inputs.fields import Array


def damped_joint_velocity(J: Array, v_WE: Array, damping: Any) -> Array:
    """Return the joint velocities that produce ``v_WE``, up to the damping, shape (..., n) [rad/s].

    Args:
        J: Jacobian, shape (..., m, n) [m].
        v_WE: Desired velocity of the end effector, shape (..., m) [m/s].
        damping: Damping mu [m].
    """
    J_T = transposed(J)
    gram = matmul(J, J_T) + scaled(damping**2, np.eye(J.shape[-2]))
    return matvec(J_T, solved_for(gram, v_WE))
