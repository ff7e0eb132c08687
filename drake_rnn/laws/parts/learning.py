r"""Learning a Jacobian from what it does: v_WE measured beside the joint velocities v.

.. math:: \rho \dot{\hat J} = (v_{WE} - \hat J v) v^T

is gradient descent on :math:`\tfrac12 |v_{WE} - \hat J v|^2`. It learns along v alone, at the
rate |v|^2 / rho, and tells nothing about directions in which the arm does not move: over time
it needs joint velocities of all directions.
"""

from __future__ import annotations

from math import expm1

import numpy as np

from ...inputs.fields import Array


def gradient(J_hat: Array, v: Array, v_WE: Array, rho: float) -> Array:
    """Time derivative of ``J_hat``, shape (m, n); ``rho`` in [rad^2/s]."""
    return ((v_WE - J_hat @ v) / rho)[:, np.newaxis] * v


def rank_one_update(J_hat: Array, v: Array, v_WE: Array, rho: float, period: float) -> Array:
    """``J_hat`` one period later, shape (m, n), with ``v`` and ``v_WE`` held: exact for any rho.

    The residual along v decays as exp(-|v|^2 t / rho), so the differential equation, stiff
    for a small rho, never has to be integrated.
    """
    square = float(v @ v)
    if square * period < 1e-16 * rho:
        return J_hat
    share = -expm1(-square * period / rho) / square
    return J_hat + ((v_WE - J_hat @ v) * share)[:, np.newaxis] * v
