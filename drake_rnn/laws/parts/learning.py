r"""Learning a Jacobian from the joint velocities v and the end effector's velocity v_WE.

.. math:: \rho \dot{\hat J} = (v_{WE} - \hat J v) v^T

is gradient descent on :math:`\tfrac12 |v_{WE} - \hat J v|^2`. It learns only along v, at the rate
|v|^2 / rho, and nothing about directions in which the arm does not move: over time, the joint
velocities must cover all directions.
"""

from __future__ import annotations

from math import expm1
from typing import Any

import numpy as np

from ...arrays.algebra import dot, functions_of, is_one, matvec, outer
from ...errors import InvalidInputError
from ...inputs.fields import Array
from ..layout import Signals


def first_J_hat(
    initial: str, shape: tuple[int, ...], rng: np.random.Generator, u: Signals
) -> Array:
    """Return the first J_hat: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own J.

    Raises:
        InvalidInputError: If ``initial`` is ``exact`` and there is no J among the signals.
    """
    if initial == "uniform":
        return rng.uniform(size=shape)
    if initial == "zero":
        return np.zeros(shape)
    if "J" not in u:
        raise InvalidInputError(
            "law.J_hat_initial: exact needs the arm's J, which this law does not see; "
            "set the initial state yourself"
        )
    return np.asarray(u["J"])


def gradient(J_hat: Array, v: Array, v_WE: Array, rho: Any) -> Array:
    """Return the time derivative of ``J_hat``, shape (..., m, n) [m/s]; ``rho`` is in rad^2/s."""
    return outer((v_WE - matvec(J_hat, v)) / rho, v)


def rank_one_update(J_hat: Array, v: Array, v_WE: Array, rho: Any, period: float) -> Array:
    """Return ``J_hat`` one period later, shape (..., m, n), with ``v`` and ``v_WE`` held.

    The result is exact: the residual along v decays as exp(-|v|^2 t / rho), so the differential
    equation, which is stiff for a small rho, never has to be integrated.
    """
    square = dot(v, v)
    still = square * period < 1e-16 * rho
    if is_one(v):
        if still:
            return J_hat
        share = -expm1(-square * period / rho) / square
        return J_hat + ((v_WE - J_hat.dot(v)) * share)[:, np.newaxis] * v
    xp = functions_of(v)
    moving = xp.where(still, 1.0, square)
    share = xp.where(still, 0.0, -xp.expm1(-moving * period / rho) / moving)
    return J_hat + outer((v_WE - matvec(J_hat, v)) * share, v)
