"""Angles between the orientations of many robots."""

from __future__ import annotations

from ..arrays.algebra import functions_of, root
from ..arrays.namespace import AnyArray


def angle_between(R: AnyArray, R_desired: AnyArray) -> AnyArray:
    """Return the angles of the rotations from one orientation to another, shape (robots,) [rad].

    Args:
        R: Orientations, shape (robots, 3, 3).
        R_desired: Those that they are compared with, likewise.
    """

    def entry(i: int, k: int) -> AnyArray:
        # Of R_desired R^T.
        a, b = R_desired[:, i], R[:, k]
        return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]

    # The antisymmetric part gives the axis times the sine, the trace gives the cosine.
    x, y, z = (entry(2, 1) - entry(1, 2), entry(0, 2) - entry(2, 0), entry(1, 0) - entry(0, 1))
    sine = 0.5 * root(x * x + y * y + z * z)
    cosine = 0.5 * (entry(0, 0) + entry(1, 1) + entry(2, 2) - 1.0)
    return functions_of(sine).arctan2(sine, cosine)
