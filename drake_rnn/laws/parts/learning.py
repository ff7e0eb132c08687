r"""Learning a Jacobian from the joint velocities v and the end effector's velocity v_WE.

.. math:: \rho \dot{\hat J} = (v_{WE} - \hat J v) v^T

is gradient descent on :math:`\tfrac12 |v_{WE} - \hat J v|^2`. It learns only along v, at the rate
|v|^2 / rho, and nothing about directions in which the arm does not move: over time, the joint
velocities must cover all directions.
"""

from __future__ import annotations

from math import expm1

import numpy as np

from ...inputs.fields import Array


def gradient(J_hat: Array, v: Array, v_WE: Array, rho: float) -> Array:
    """Return the time derivative of ``J_hat``, shape (m, n) [m/s]; ``rho`` is in rad^2/s."""
    return ((v_WE - J_hat @ v) / rho)[:, np.newaxis] * v


def rank_one_update(J_hat: Array, v: Array, v_WE: Array, rho: float, period: float) -> Array:
    """Return ``J_hat`` one period later, shape (m, n), with ``v`` and ``v_WE`` held.

    The result is exact: the residual along v decays as exp(-|v|^2 t / rho), so the differential
    equation, which is stiff for a small rho, never has to be integrated.
    """
    square = float(v @ v)
    if square * period < 1e-16 * rho:
        return J_hat
    share = -expm1(-square * period / rho) / square
    return J_hat + ((v_WE - J_hat @ v) * share)[:, np.newaxis] * v
