"""Rotations of many robots, shape (..., 3, 3), in arrays of NumPy or of JAX.

Every sum has three terms, in a fixed order: a robot's rotation does not depend on the others'.
"""

from __future__ import annotations

import numpy as np

from ..arrays.algebra import functions_of, root
from ..arrays.namespace import AnyArray, namespace
from ..inputs.fields import Array


def times(R: AnyArray, a: AnyArray) -> AnyArray:
    """Return rotated vectors, shape (..., 3)."""
    return R[..., 0] * a[..., :1] + R[..., 1] * a[..., 1:2] + R[..., 2] * a[..., 2:]


def product(A: AnyArray, B: AnyArray) -> AnyArray:
    """Return the products of rotations."""
    first, second, third = (A[..., :, k, None] * B[..., None, k, :] for k in range(3))
    return first + second + third


def frame_about(axis: AnyArray) -> AnyArray:
    """Return frames whose z axes are given, shape (..., 3, 3).

    If the axis is one of W's, so are the others. From T. Duff and others, "Building an orthonormal
    basis, revisited", 2017.

    Args:
        axis: Unit axes, shape (..., 3).
    """
    xp = namespace("axis", axis)
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    sign = xp.where(z < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return xp.stack(
        (
            xp.stack((1.0 + sign * x * x * a, b, x), axis=-1),
            xp.stack((sign * b, sign + y * y * a, y), axis=-1),
            xp.stack((-sign * x, -y, z), axis=-1),
        ),
        axis=-2,
    )


def rotation_by(vector: Array) -> Array:
    """Return the rotations by rotation vectors (O. Rodrigues).

    Args:
        vector: Rotation vectors, shape (..., 3) [rad].
    """
    x, y, z = np.moveaxis(vector, -1, 0)
    none = np.zeros_like(x)
    K = np.stack((none, -z, y, z, none, -x, -y, x, none), axis=-1).reshape(*x.shape, 3, 3)
    angle = np.sqrt(x * x + y * y + z * z)[..., None, None]
    # NumPy's sinc is sin(pi x) / (pi x), and 1 at 0.
    half = np.sinc(0.5 * angle / np.pi)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half * half * product(K, K))


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
