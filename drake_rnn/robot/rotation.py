"""The rotation from one orientation to another."""

from __future__ import annotations

from math import atan2, sqrt

import numpy as np

from ..arrays.algebra import dot, functions_of, joined, matmul, transposed
from ..inputs.fields import Array


def rotation_error(R_WE: Array, R_WE_desired: Array) -> Array:
    """Return the rotation vector from E to its desired orientation, in W, shape (..., 3) [rad].

    Args:
        R_WE: Orientation of E, shape (..., 3, 3).
        R_WE_desired: Desired orientation of E, shape (..., 3, 3).
    """
    E = matmul(R_WE_desired, transposed(R_WE))
    if E.ndim > 2 or not isinstance(E, np.ndarray):
        return _rotation_vectors(E)
    # Plain floats: this runs at every sample, and NumPy's overhead would take most of its time.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = E.tolist()
    # The antisymmetric part gives the axis times the sine, the trace gives the cosine.
    x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
    length, cosine = sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    if length > 1e-6:
        angle = atan2(length, cosine) / length
        return np.array((angle * x, angle * y, angle * z))
    if cosine > 0.0:
        return np.array((x, y, z))
    # Half a turn: the axis follows from the symmetric part.
    axis = (E + np.eye(3))[:, int(np.argmax(np.diag(E)))]
    return np.asarray(np.pi * axis / np.linalg.norm(axis))


def _rotation_vectors(E: Array) -> Array:
    """Return the rotation vectors of matrices, shape (..., 3, 3), as for one."""
    xp = functions_of(E)
    swapped = 0.5 * (E - transposed(E))
    vector = joined((swapped[..., 2, 1, None], swapped[..., 0, 2, None], swapped[..., 1, 0, None]))
    square = dot(vector, vector)
    trace = E[..., 0, 0, None] + E[..., 1, 1, None] + E[..., 2, 2, None]
    cosine = 0.5 * (trace - 1.0)
    turns = square > 1e-12
    length = xp.sqrt(xp.where(turns, square, 1.0))
    angle = xp.where(turns, xp.arctan2(length, cosine) / length, 1.0)
    # The longest column of E + I is the axis of half a turn.
    columns = [(E + np.eye(3))[..., :, k] for k in range(3)]
    x, y, z = (column[..., k, None] for k, column in enumerate(columns))
    axis = xp.where((x >= y) & (x >= z), columns[0], xp.where(y >= z, columns[1], columns[2]))
    half = ~turns & (cosine <= 0.0)
    norm = xp.sqrt(xp.where(half, dot(axis, axis), 1.0))
    return xp.where(half, np.pi * axis / norm, angle * vector)
