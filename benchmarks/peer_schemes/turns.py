"""Rotations by small angles, in plain floats: NumPy's overhead would be a part of a peer's cost."""

from __future__ import annotations

from math import sin, sqrt

import numpy as np

from drake_rnn import Array


def twice_turned(R: Array, R_next: Array) -> Array:
    """Return twice the rotation vector between orientations that are next to each other.

    Right to the third order of the angle.

    Args:
        R: The first orientation, shape (3, 3).
        R_next: The second.
    """
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = (R_next @ R.T).tolist()
    return np.array((zy - yz, xz - zx, yx - xy))


def rotated_by(turn: Array, R: Array) -> Array:
    """Return an orientation that is turned by a rotation vector, shape (3, 3)."""
    x, y, z = turn.tolist()
    square = x * x + y * y + z * z
    angle = sqrt(square)
    # sin a / a and (1 - cos a) / a^2.
    s = sin(angle) / angle if angle > 0.0 else 1.0
    half = sin(0.5 * angle)
    c = 2.0 * half * half / square if square > 0.0 else 0.5
    K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    KR = K @ R
    return R + s * KR + c * (K @ KR)


def swept(way: Array, turn: Array) -> Array:
    """Return where a twist leads whose parts are a way and a turn, to the third order of the turn.

    A twist that is constant in the frame that it moves turns its way as it goes.
    """
    (x, y, z), (a, b, c) = way.tolist(), turn.tolist()
    s, t, u = b * z - c * y, c * x - a * z, a * y - b * x
    return np.array(
        (
            x + 0.5 * s + (b * u - c * t) / 6.0,
            y + 0.5 * t + (c * s - a * u) / 6.0,
            z + 0.5 * u + (a * t - b * s) / 6.0,
        )
    )
