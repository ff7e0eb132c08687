"""A softer task near a singular posture, where an arm would otherwise not come to rest.

Stretched out towards what is out of its reach, an arm gains its last millimetres by large joint
velocities to and fro. Where the smallest singular value of J falls below an edge, the softness
grows as the square of the way below it. Rows of the rotation count as with a lever of 1 m. Of
points on a tool that turn about one another little is seen, in every posture: for pixels the edge
is lower.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import functions_of, joined, matmul, root, transposed
from ...inputs.fields import Array

# Smallest singular value from which on a posture counts as near a singular one, and what is added
# to the softness in a singular one: with 1e-4 arms still cycle, with 1e-3 they rest.
_EDGE, _MOST = 0.05, 1e-3
#: Share of the edge, and root of that of the softness added, for pixels: with all of it half of the
#: runs with three points, of random cameras, do not settle within 3 s.
OF_PIXELS = 0.2


def row_softness(softness: Any, lever: Any, task_size: int, turns: bool) -> Array:
    """Return the softness of a task's rows, a diagonal matrix, shape (..., m, m).

    Args:
        softness: Price of an error of the position [m^2].
        lever: Length that makes an error of the orientation count like one of the position [m].
        task_size: Number m of rows.
        turns: Whether the first three of 6 rows are rotation.
    """
    each = np.ones(task_size - 3 * turns)
    # A lever of each robot's own gives both parts its leading axis.
    rows = joined((each * lever**-2, each + 0.0 * lever)) if turns else each
    rows = softness * rows
    return rows[..., None] * np.eye(task_size)


def softened(J: Array, softness: Array, share: float = 1.0) -> Array:
    """Return the softness with what is added near a singular posture, shape (..., m, m).

    Args:
        J: Jacobian, shape (..., m, n).
        softness: Softness of the rows elsewhere, shape (..., m, m).
        share: Share of the edge at which it begins, and root of that of what is added.
    """
    gram = matmul(J, transposed(J))
    if type(gram) is np.ndarray and gram.shape == (3, 3) and least_square(gram) > _EDGE**2:
        return softness
    xp = functions_of(gram)
    least = xp.maximum(xp.linalg.eigvalsh(gram)[..., :1], 0.0)
    below = xp.maximum(1.0 - root(least) / (share * _EDGE), 0.0)
    return softness + (share**2 * _MOST * below * below)[..., None] * np.eye(J.shape[-2])


def least_square(gram: Array) -> float:
    """Return a number that no eigenvalue of a symmetric matrix is below, shape (m, m).

    Args:
        gram: The matrix, J J^T; of three rows the number is the least eigenvalue or less.
    """
    if gram.shape != (3, 3):
        return float(np.linalg.eigvalsh(gram)[0])
    (a, b, c), (_, d, e), (_, _, f) = gram.tolist()
    determinant = a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)
    # The product of the other two is at most the square of half the trace.
    half = 0.5 * (a + d + f)
    return float(determinant / max(half * half, 1e-300))
