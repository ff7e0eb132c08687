"""A softer task near a singular posture, where an arm would otherwise not come to rest.

Stretched out towards what is out of its reach, an arm gains its last millimetres by large joint
velocities to and fro. Where the smallest singular value of J falls below an edge, the softness
grows as the square of the way below it. Rows of the rotation count as with a lever of 1 m.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import functions_of, joined, matmul, root, transposed
from ...inputs.fields import Array

# Smallest singular value from which on a posture counts as near a singular one, and what is added
# to the softness in a singular one: with 1e-4 arms still cycle, with 1e-3 they rest.
_EDGE, _MOST = 0.05, 1e-3


def row_softness(softness: Any, lever: Any, task_size: int) -> Array:
    """Return the softness of a task's rows, a diagonal matrix, shape (..., m, m).

    Args:
        softness: Price of an error of the position [m^2].
        lever: Length that makes an error of the orientation count like one of the position [m].
        task_size: Number m of rows; of 6 the first three are rotation.
    """
    each = np.ones(min(task_size, 3))
    # A lever of each robot's own gives both parts its leading axis.
    rows = joined((each * lever**-2, each + 0.0 * lever)) if task_size == 6 else each
    rows = softness * rows
    return rows[..., None] * np.eye(task_size)


def softened(J: Array, softness: Array) -> Array:
    """Return the softness with what is added near a singular posture, shape (..., m, m).

    Args:
        J: Jacobian, shape (..., m, n).
        softness: Softness of the rows elsewhere, shape (..., m, m).
    """
    gram = matmul(J, transposed(J))
    if type(gram) is np.ndarray and gram.shape == (3, 3) and _is_far(gram):
        return softness
    xp = functions_of(gram)
    least = xp.maximum(xp.linalg.eigvalsh(gram)[..., :1], 0.0)
    share = xp.maximum(1.0 - root(least) / _EDGE, 0.0)
    return softness + (_MOST * share * share)[..., None] * np.eye(J.shape[-2])


def _is_far(gram: Array) -> bool:
    """Return whether a matrix of three rows surely has no eigenvalue below the edge's square."""
    (a, b, c), (_, d, e), (_, _, f) = gram.tolist()
    determinant = a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)
    # The product of the other two is at most the square of half the trace.
    half = 0.5 * (a + d + f)
    return bool(determinant > _EDGE**2 * half * half)
