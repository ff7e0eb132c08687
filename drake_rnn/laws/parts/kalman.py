r"""Learning a Jacobian by a Kalman filter: one covariance serves all of its rows.

The rows of J are taken to wander, each entry with the variance q_n per second, and the velocity y
that joint velocities w cause to be measured with the variance R:

.. math::
    C \leftarrow C + q_n h I, \quad K = \frac{C w}{R + w^T C w}, \quad
    \hat J \leftarrow \hat J + (y - \hat J w) K^T, \quad C \leftarrow C - K w^T C.

What has not been moved for a while is uncertain, so the first motion along it teaches at once: no
noise needs to be injected.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import dot, matvec, outer, scaled
from ...inputs.fields import Array


def kalman_update(
    J_hat: Array, C: Array, w: Array, y: Array, wander: Any, variance: Any
) -> tuple[Array, Array]:
    """Return J_hat, shape (..., m, n), and its covariance, shape (..., n, n), one sample later.

    Args:
        J_hat: The learned Jacobian, shape (..., m, n).
        C: Covariance of each of its rows, shape (..., n, n), symmetric.
        w: Measured joint velocities, shape (..., n) [rad/s].
        y: Task velocity that they caused, shape (..., m).
        wander: Growth of the variances in this sample, q_n h.
        variance: Variance R of y.
    """
    C = C + scaled(wander, np.eye(w.shape[-1]))
    spread = matvec(C, w)
    K = spread / (variance + dot(w, spread))
    return J_hat + outer(y - matvec(J_hat, w), K), C - outer(K, spread)
