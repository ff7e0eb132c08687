"""Moments of inertia that a body can have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def nearest_possible(entries: Sequence[float]) -> tuple[float, ...] | None:
    """Return the physically possible rotational inertia nearest to an impossible one.

    The principal moments of a body are positive, and none exceeds the sum of the other two. Where
    one does, it becomes that sum; a negative one first becomes a thousandth of the largest.

    Args:
        entries: Moments and products of inertia xx, yy, zz, xy, xz, yz [kg m^2].

    Returns:
        Entries in the same order; None if those given are possible, or all zero.
    """
    xx, yy, zz, xy, xz, yz = entries
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    # Drake accepts the same rounding error.
    rounding = 10.0 * np.finfo(float).eps * abs(moments).max()
    if moments[0] >= -rounding and moments[2] <= moments[0] + moments[1] + rounding:
        return None
    moments = np.maximum(moments, 1e-3 * moments[2])
    if moments[2] <= 0.0:
        return None
    # A little less than the sum, so that rounding cannot exceed it.
    moments[2] = min(moments[2], (moments[0] + moments[1]) * (1.0 - 1e-9))
    possible = axes @ np.diag(moments) @ axes.T
    return tuple(float(possible[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
