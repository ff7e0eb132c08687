"""A small box round points, along their principal axes or those of their frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array

# Beyond rounding errors of a projection [m].
_SAFE = 1e-9


class EnclosingBox(NamedTuple):
    """A box.

    Attributes:
        center: Its centre, shape (3,) [m].
        R: Orientation of its frame in that of the points, shape (3, 3).
        size: Its edges, shape (3,) [m].
    """

    center: Array
    R: Array
    size: Array

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(self.size.prod())


def enclosing_box(points: Array) -> EnclosingBox:
    """Return a box that holds all points, the smaller of two.

    One is oriented as the points' frame, in which most parts are modelled, the other by their
    principal axes.

    Args:
        points: At least one point, shape (k, 3) [m].
    """
    _, _, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)
    principal = rows.T
    if np.linalg.det(principal) < 0.0:
        principal = -principal
    return min((_along(points, R) for R in (np.eye(3), principal)), key=lambda box: box.volume)


def _along(points: Array, R: Array) -> EnclosingBox:
    """Return the smallest box of an orientation."""
    turned = points @ R
    low, high = turned.min(axis=0) - _SAFE, turned.max(axis=0) + _SAFE
    return EnclosingBox(R @ (0.5 * (low + high)), R, high - low)
