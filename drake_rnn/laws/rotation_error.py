"""How far one orientation is from another."""

from __future__ import annotations

import numpy as np

from ..fields import Array


def rotation_error(R_WE: Array, R_WE_desired: Array) -> Array:
    """Rotation vector, in the world frame, that takes E to where it should be, shape (3,) [rad].

    Args:
        R_WE: Orientation of E, shape (3, 3).
        R_WE_desired: What it should be, shape (3, 3).
    """
    E = R_WE_desired @ R_WE.T
    # The antisymmetric part has the axis times the sine, the trace the cosine.
    sine = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
    length, cosine = float(np.linalg.norm(sine)), 0.5 * (float(np.trace(E)) - 1.0)
    if length > 1e-6:
        return sine * (np.arctan2(length, cosine) / length)
    if cosine > 0.0:
        return sine
    # Half a turn: the axis is that of the symmetric part.
    axis = (E + np.eye(3))[:, int(np.argmax(np.diag(E)))]
    return np.asarray(np.pi * axis / np.linalg.norm(axis))
