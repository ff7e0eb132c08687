"""Rotations of one robot or of many, shape (..., 3, 3), in arrays of NumPy or of JAX.

Every sum has three terms, in a fixed order: a robot's rotation does not depend on the others'.
"""

from __future__ import annotations

from math import atan2, sin, sqrt

import numpy as np

from ..arrays.algebra import (
    AnyArray,
    dot,
    functions_of,
    join,
    matmul,
    namespace,
    root,
    transpose,
)
from ..inputs.fields import Array


def rotation_error(R_WE: Array, R_WE_desired: Array) -> Array:
    """Return the rotation vector from E to its desired orientation, in W, shape (..., 3) [rad].

    Args:
        R_WE: Orientation of E, shape (..., 3, 3).
        R_WE_desired: Desired orientation of E, shape (..., 3, 3).
    """
    E = matmul(R_WE_desired, transpose(R_WE))
    if E.ndim > 2 or type(E) is not np.ndarray:
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
    skew = 0.5 * (E - transpose(E))
    vector = join((skew[..., 2, 1, None], skew[..., 0, 2, None], skew[..., 1, 0, None]))
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


def rotation_of(rpy: Array) -> Array:
    """Return the rotation of roll, pitch and yaw, shape (3, 3), about fixed axes in turn.

    Args:
        rpy: Angles about x, then y, then z, shape (3,) [rad].
    """
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )


def rotation_by(vector: Array) -> Array:
    """Return the rotations by rotation vectors (O. Rodrigues).

    Args:
        vector: Rotation vectors, shape (..., 3) [rad].
    """
    if type(vector) is np.ndarray and vector.ndim == 1:
        return _rotation_by(*vector.tolist())
    x, y, z = np.moveaxis(vector, -1, 0)
    none = np.zeros_like(x)
    K = np.stack((none, -z, y, z, none, -x, -y, x, none), axis=-1).reshape(*x.shape, 3, 3)
    angle = np.sqrt(x * x + y * y + z * z)[..., None, None]
    # NumPy's sinc is sin(pi x) / (pi x), and 1 at 0.
    half = np.sinc(0.5 * angle / np.pi)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half * half * product(K, K))


def _rotation_by(x: float, y: float, z: float) -> Array:
    """Return the rotation by one vector, in plain floats: a tool that is led has three a sample."""
    angle, s, c = sqrt(x * x + y * y + z * z), 1.0, 0.5
    if angle:
        # As NumPy's sinc rounds.
        half, whole = np.pi * (0.5 * angle / np.pi), np.pi * (angle / np.pi)
        s, c = sin(whole) / whole, 0.5 * (sin(half) / half) * (sin(half) / half)
    xy, xz, yz = c * (x * y), c * (x * z), c * (y * z)
    return np.array(
        (
            (1.0 + c * (-z * z - y * y), -s * z + xy, s * y + xz),
            (s * z + xy, 1.0 + c * (-z * z - x * x), -s * x + yz),
            (-s * y + xz, s * x + yz, 1.0 + c * (-y * y - x * x)),
        )
    )


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
