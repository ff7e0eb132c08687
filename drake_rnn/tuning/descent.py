"""Descent in a few unknowns within bounds: quasi-Newton steps, several lengths tried at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array

#: Lengths of a step that are tried side by side, as shares of the step.
SHARES = np.array([1.0, 0.3, 0.1, 0.01])
# Largest change of an unknown in a step; unknowns are logarithms, and this is a factor of 3.
_LONGEST = 1.1
# How much shorter steps are after none was good, and how often that may happen in a row.
_SHORTER, _TRIES = 1e-2, 2
# Share of a value below which its decrease over a few steps counts as none.
_LITTLE, _STEPS = 3e-2, 3

#: Values, shape (rows,), and slopes, shape (rows, k), of points, shape (rows, k).
Function = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Point:
    """A point of a descent.

    Attributes:
        x: The unknowns, shape (k,).
        value: The value there.
        slope: Its slope, shape (k,).
    """

    x: Array
    value: float
    slope: Array


def descend(
    function: Function,
    start: Array,
    bounds: tuple[Array, Array],
    steps: int,
    told: Callable[[Point], None],
) -> list[Point]:
    """Return the points of a descent from a start, each lower than the one before.

    Each step goes along the direction of Broyden, Fletcher, Goldfarb and Shanno, 1970, cut at the
    bounds, by the best of some lengths. If none is lower, steps get shorter along the slope itself.
    It ends when that does not help, when three steps gain less than 3 % of the value, or after a
    number of steps. Nothing is random.

    Args:
        function: The function to minimise. It is given as many points at once as there are
            `SHARES`; a point whose value is not finite is never taken.
        start: The first point, shape (k,), within the bounds.
        bounds: Lowest and highest unknowns, each of shape (k,).
        steps: Largest number of times that the function is asked.
        told: Called with each new point.
    """
    here = _best(function, np.tile(start, (SHARES.size, 1)))
    points = [here]
    told(here)
    inverse: Array | None = None
    scale, tries = 1.0, 0
    for _ in range(steps - 1):
        if (direction := _direction(here, inverse, bounds, scale)) is None:
            break
        candidates = np.clip(here.x + SHARES[:, np.newaxis] * direction, *bounds)
        there = _best(function, candidates)
        if not there.value < here.value:
            tries += 1
            if tries > _TRIES:
                break
            inverse, scale = None, scale * _SHORTER
            continue
        inverse = _updated(inverse, there.x - here.x, there.slope - here.slope)
        here, scale, tries = there, 1.0, 0
        points.append(here)
        told(here)
        before = points[max(0, len(points) - 1 - _STEPS)]
        if len(points) > _STEPS and before.value - here.value < _LITTLE * abs(before.value):
            break
    return points


def _best(function: Function, x: Array) -> Point:
    values, slopes = function(x)
    sound = np.isfinite(values) & np.isfinite(slopes).all(axis=1)
    best = int(np.argmin(np.where(sound, values, np.inf)))
    value = float(values[best]) if sound[best] else np.inf
    return Point(x[best], value, slopes[best])


def _direction(
    here: Point, inverse: Array | None, bounds: tuple[Array, Array], scale: float
) -> Array | None:
    """Return the longest step to try; None where no slope leads on within the bounds.

    Args:
        here: Where it begins.
        inverse: Inverse of the curvature, shape (k, k); None if it is unknown.
        bounds: Lowest and highest unknowns.
        scale: Share of the step.
    """
    low, high = bounds
    stuck = ((here.x <= low) & (here.slope > 0.0)) | ((here.x >= high) & (here.slope < 0.0))
    slope = np.where(stuck, 0.0, here.slope)
    if not slope.any():
        return None
    # As far as a step may go, unless the curvature says better.
    direction = -slope / np.abs(slope).max() * _LONGEST
    if inverse is not None:
        curved = -(inverse * np.outer(~stuck, ~stuck)) @ slope
        direction = curved if curved @ slope < 0.0 else direction
    longest = np.abs(direction).max()
    return np.asarray(direction * min(1.0, _LONGEST / longest) * scale)


def _updated(inverse: Array | None, moved: Array, turned: Array) -> Array | None:
    """Return the inverse of the curvature, updated by the change of the slope over a step."""
    along = float(moved @ turned)
    if along <= 1e-12 * float(np.linalg.norm(moved) * np.linalg.norm(turned)):
        return inverse
    if inverse is None:
        inverse = along / float(turned @ turned) * np.eye(moved.size)
    left = np.eye(moved.size) - np.outer(moved, turned) / along
    return np.asarray(left @ inverse @ left.T + np.outer(moved, moved) / along)
