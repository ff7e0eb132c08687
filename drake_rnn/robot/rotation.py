"""The rotation from one orientation to another."""

from __future__ import annotations

from math import atan2, sqrt

import numpy as np

from ..inputs.fields import Array


def rotation_error(R_WE: Array, R_WE_desired: Array) -> Array:
    """Return the rotation vector from E to its desired orientation, in W, shape (3,) [rad].

    Args:
        R_WE: Orientation of E, shape (3, 3).
        R_WE_desired: Desired orientation of E, shape (3, 3).
    """
    E = R_WE_desired @ R_WE.T
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
