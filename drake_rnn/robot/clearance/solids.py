"""Obstacles as arrays: the distances of many segments from all of them at once.

Distances between segments, and from segments to boxes and half-spaces, many at once.

Segments are a + s (b - a) with s in [0, 1]; one without length is a point. What is round, a ball or
a capsule, is a segment with a radius, which whoever calls subtracts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from .obstacles import BallObstacle, BoxObstacle, CapsuleObstacle, HalfSpaceObstacle, Obstacle


@dataclass(frozen=True, eq=False)
class Solids:
    """Obstacles by shape, in the order: round ones, boxes, half-spaces.

    Attributes:
        names: Names of the k obstacles, in that order.
        ends: Ends of the segments of balls and capsules, shape (r, 2, 3) [m].
        radii: Their radii, shape (r,) [m].
        centers: Centres of the boxes, shape (b, 3) [m].
        R_WO: Their orientations, shape (b, 3, 3).
        half: Half of their edges, shape (b, 3) [m].
        normals: Unit normals of the half-spaces, shape (s, 3).
        levels: Heights of their planes along these, shape (s,) [m].
        moving: The obstacles that may move, by their number, shape (m,).
        speeds: Largest speed of each obstacle, shape (k,) [m/s]; 0 of those at rest.
        errors: Largest error of each one's measured position, shape (k,) [m].
    """

    names: tuple[str, ...]
    ends: Array
    radii: Array
    centers: Array
    R_WO: Array
    half: Array
    normals: Array
    levels: Array
    moving: NDArray[np.intp]
    speeds: Array
    errors: Array

    @classmethod
    def of(cls, obstacles: Sequence[Obstacle]) -> Solids:
        """Return obstacles as arrays."""
        balls = [o for o in obstacles if isinstance(o, (BallObstacle, CapsuleObstacle))]
        boxes = [o for o in obstacles if isinstance(o, BoxObstacle)]
        walls = [o for o in obstacles if isinstance(o, HalfSpaceObstacle)]
        ordered = (*balls, *boxes, *walls)
        ends = [(o.center, o.center) if isinstance(o, BallObstacle) else o.ends for o in balls]
        return cls(
            names=tuple(o.name for o in ordered),
            ends=np.array(ends).reshape(-1, 2, 3),
            radii=np.array([o.radius for o in balls]),
            centers=np.array([o.center for o in boxes]).reshape(-1, 3),
            R_WO=np.array([o.R_WO for o in boxes]).reshape(-1, 3, 3),
            half=np.array([0.5 * o.size for o in boxes]).reshape(-1, 3),
            normals=np.array([o.normal_W for o in walls]).reshape(-1, 3),
            levels=np.array([o.normal_W.dot(o.point) for o in walls]),
            moving=np.array([k for k, o in enumerate(ordered) if o.speed is not None], np.intp),
            speeds=np.array([o.speed or 0.0 for o in ordered]),
            errors=np.array([o.error for o in ordered]),
        )

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """For each obstacle, its place among those that move; the place behind them if it rests."""
        found = np.full(len(self.names), len(self.moving), dtype=np.intp)
        found[self.moving] = np.arange(len(self.moving))
        return found


_TINY = 1e-300
# Places of the entries that follow each one of a vector, and of those before it.
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


class Nearest(NamedTuple):
    """The nearest points of two shapes.

    Attributes:
        distance: Distance, shape (...) [m]; 0 where a segment is in a box.
        p_A: Point of the first, shape (..., 3) [m].
        p_B: Point of the second, likewise.
    """

    distance: Array
    p_A: Array
    p_B: Array


def between_segments(A: Array, B: Array) -> Nearest:
    """Return the nearest points of segments.

    In closed form (C. Ericson, "Real-Time Collision Detection", 2005, 5.1.9): the foot of one line
    on the other is clamped to the segment, then the foot of that point.

    Args:
        A: Ends of segments, shape (..., 2, 3) [m].
        B: Likewise; leading axes are broadcast.
    """
    p, q = A[..., 0, :], B[..., 0, :]
    d, e, r = A[..., 1, :] - p, B[..., 1, :] - q, p - q
    a, f, b = _dot(d, d), _dot(e, e), _dot(d, e)
    c, g = _dot(d, r), _dot(e, r)
    det = a * f - b * b
    # Of parallel segments, any s does; a point has a = 0 and keeps s = 0.
    s = _share((b * g - c * f) / np.where(det > 1e-14 * a * f, det, np.inf))
    t = _share((b * s + g) / np.maximum(f, _TINY))
    s = _share((b * t - c) / np.maximum(a, _TINY))
    return _nearest(p + s[..., None] * d, q + t[..., None] * e)


def to_boxes(A: Array, half: Array) -> Nearest:
    """Return the nearest points of segments and boxes, in the frames of the boxes.

    The squared distance of a point from a box is convex and, along a segment, a parabola between
    the up to six places where a coordinate enters or leaves its range.

    Args:
        A: Ends of segments, shape (..., 2, 3) [m].
        half: Half of the boxes' sizes, shape (..., 3) [m].
    """
    p, d = A[..., 0, :], A[..., 1, :] - A[..., 0, :]
    moves = np.abs(d) > _TINY
    along = np.where(moves, d, 1.0)
    enters = np.where(moves, (-half - p) / along, 0.0)
    leaves = np.where(moves, (half - p) / along, 0.0)
    ends = np.zeros((*p.shape[:-1], 2))
    ends[..., 1] = 1.0
    s = np.sort(np.clip(np.concatenate((enters, leaves, ends), axis=-1), 0.0, 1.0), axis=-1)
    # The slope of half of the squared distance at these places is linear between them.
    x = p[..., None, :] + s[..., None] * d[..., None, :]
    out = x - np.clip(x, -half[..., None, :], half[..., None, :])
    slope = _dot(out, d[..., None, :])
    low = np.clip((slope <= 0.0).sum(axis=-1) - 1, 0, s.shape[-1] - 2)[..., None]
    s0, s1 = (np.take_along_axis(s, low + k, axis=-1)[..., 0] for k in (0, 1))
    g0, g1 = (np.take_along_axis(slope, low + k, axis=-1)[..., 0] for k in (0, 1))
    rise = g1 - g0
    share = np.clip(-g0 / np.where(rise > 0.0, rise, np.inf), 0.0, 1.0)
    best = np.where(slope[..., 0] > 0.0, 0.0, s0 + share * (s1 - s0))
    p_A = p + best[..., None] * d
    return _nearest(p_A, np.clip(p_A, -half, half))


def to_half_spaces(A: Array, normals: Array, levels: Array) -> Nearest:
    """Return the lowest points of segments above half-spaces, and their feet.

    Args:
        A: Ends of segments, shape (..., 2, 3) [m].
        normals: Unit normals, out of what is solid, shape (..., 3).
        levels: Height of the surfaces along them, shape (...) [m].

    Returns:
        With distances that are negative within what is solid.
    """
    heights = _dot(A, normals[..., None, :]) - levels[..., None]
    lowest = heights.argmin(axis=-1)[..., None]
    height = np.take_along_axis(heights, lowest, axis=-1)[..., 0]
    p_A = np.take_along_axis(A, lowest[..., None], axis=-2)[..., 0, :]
    return Nearest(height, p_A, p_A - height[..., None] * normals)


def cross(a: Array, b: Array) -> Array:
    """Return cross products, shape (..., 3); NumPy's own function takes three times as long."""
    forth = a.take(_NEXT, axis=-1) * b.take(_LAST, axis=-1)
    return np.asarray(forth - a.take(_LAST, axis=-1) * b.take(_NEXT, axis=-1))


def _nearest(p_A: Array, p_B: Array) -> Nearest:
    apart = p_A - p_B
    return Nearest(np.sqrt(_dot(apart, apart)), p_A, p_B)


def _share(x: Array) -> Array:
    # Faster than clip.
    return np.asarray(np.minimum(np.maximum(x, 0.0), 1.0))


def _dot(a: Array, b: Array) -> Array:
    # Faster than the sum of products.
    return np.asarray(np.einsum("...i,...i->...", a, b))
