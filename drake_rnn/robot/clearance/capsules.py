"""Capsules round links, and obstacles, as arrays; distances of segments, many at once.

Segments are a + s (b - a) with s in [0, 1]; one without length is a point. What is round, a ball or
a capsule, is a segment with a radius, which whoever calls subtracts. Distances from segments to
boxes, half-spaces and cylinders are here, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.algebra import Parts, clip, functions_of, is_foreign, repeat
from ...errors import InvalidInputError
from ...inputs.fields import Array, Length, Point, real_array, validated
from ...inputs.messages import fields_of, nearest, short
from .obstacles import (
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    CylinderObstacle,
    HalfSpaceObstacle,
    Obstacle,
    single_shapes,
)


@dataclass(frozen=True, eq=False)
class Cylinders:
    """Cylinders.

    Attributes:
        centers: Their centres, shape (c, 3) [m].
        axes: Unit vectors along their axes, shape (c, 3).
        half: Half of their lengths, shape (c,) [m].
        radii: Their radii, shape (c,) [m].
    """

    centers: Array
    axes: Array
    half: Array
    radii: Array

    @classmethod
    def of(cls, cylinders: Sequence[CylinderObstacle]) -> Cylinders:
        """Return obstacles as arrays."""
        return cls(
            np.array([o.center for o in cylinders]).reshape(-1, 3),
            np.array([o.axis_W for o in cylinders]).reshape(-1, 3),
            np.array([0.5 * o.length for o in cylinders]),
            np.array([o.radius for o in cylinders]),
        )

    def some(self, numbers: NDArray[np.intp]) -> Cylinders:
        """Return some of them, by their numbers."""
        return Cylinders(*(values[numbers] for values in fields_of(self).values()))


@dataclass(frozen=True, eq=False)
class Solids:
    """Obstacles by shape, in the order: round ones, boxes, half-spaces, cylinders.

    Attributes:
        names: Names of the k obstacles, in that order.
        ends: Ends of the segments of balls and capsules, shape (r, 2, 3) [m].
        radii: Their radii, shape (r,) [m].
        centers: Centres of the boxes, shape (b, 3) [m].
        R_WO: Their orientations, shape (b, 3, 3).
        half: Half of their edges, shape (b, 3) [m].
        normals: Unit normals of the half-spaces, shape (s, 3).
        levels: Heights of their planes along these, shape (s,) [m].
        cylinders: The cylinders.
        moving: The obstacles that may move, by their number, in the order in which they were
            given, which is that of the rows of p_WO, shape (m,).
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
    cylinders: Cylinders
    moving: NDArray[np.intp]
    speeds: Array
    errors: Array

    @classmethod
    def of(cls, obstacles: Sequence[Obstacle]) -> Solids:
        """Return obstacles as arrays.

        Raises:
            InvalidInputError: If it is not known how far something is from the shape of one.
        """
        parts = single_shapes(obstacles)
        kinds = [next((k for k, c in enumerate(_SHAPES) if isinstance(o, c)), -1) for o in parts]
        if -1 in kinds:
            raise InvalidInputError(
                f"obstacles: {parts[kinds.index(-1)].name!r} must be a ball, capsule, box, "
                "half_space or cylinder"
            )
        # By shape; those of one shape in the order in which they were given.
        order = np.argsort(kinds, kind="stable")
        shapes: list[Any] = [parts[k] for k in order]
        balls, boxes, walls, cylinders = (
            [o for o in shapes if isinstance(o, classes)] for classes in _SHAPES
        )
        ends = [(o.center, o.center) if isinstance(o, BallObstacle) else o.ends for o in balls]
        # The other way round: of each one that was given, its place among the shapes.
        places = np.argsort(order)
        may_move = [k for k, o in enumerate(parts) if o.speed is not None]
        return cls(
            names=tuple(o.name for o in shapes),
            ends=np.array(ends).reshape(-1, 2, 3),
            radii=np.array([o.radius for o in balls]),
            centers=np.array([o.center for o in boxes]).reshape(-1, 3),
            R_WO=np.array([o.R_WO for o in boxes]).reshape(-1, 3, 3),
            half=np.array([0.5 * o.size for o in boxes]).reshape(-1, 3),
            normals=np.array([o.normal_W for o in walls]).reshape(-1, 3),
            levels=np.array([o.normal_W.dot(o.point) for o in walls]),
            cylinders=Cylinders.of(cylinders),
            moving=places[may_move].astype(np.intp).reshape(-1),
            speeds=np.array([o.speed or 0.0 for o in shapes]),
            errors=np.array([o.error for o in shapes]),
        )

    @property
    def moving_names(self) -> tuple[str, ...]:
        """Names of the obstacles that may move, in the order of the rows of p_WO."""
        return tuple(self.names[k] for k in self.moving)

    def places(self, p_WO: Displacements | None) -> Array:
        """Return how far obstacles that may move have gone, as measured, shape (m, 3) [m].

        NaN in a row stands for an obstacle that was not measured.

        Args:
            p_WO: A row for each of `moving_names`; or a mapping from names to such rows, in which
                those that were not measured may be missing. Of an obstacle that consists of
                several, as of a file, its own name stands for all of them. None if there are none.

        Raises:
            InvalidInputError: If it has another shape, is no number, or a name is none of them.
        """
        names = self.moving_names
        if isinstance(p_WO, Mapping):
            rows = np.full((len(names), 3), np.nan)
            for name, place in p_WO.items():
                row = real_array(f"p_WO[{short(name)}]", place)
                if row.shape != (3,):
                    raise InvalidInputError(
                        f"p_WO[{short(name)}]: must be three numbers [m], how far it has gone in "
                        f"W, not {short(place)}"
                    )
                rows[self._rows_of(name)] = row
        else:
            rows = np.zeros((0, 3)) if p_WO is None else np.array(real_array("p_WO", p_WO))
        if rows.shape != (len(names), 3):
            order = f": {', '.join(names)}" if names else ""
            raise InvalidInputError(
                f"p_WO: must be of shape ({len(names)}, 3), one row for each obstacle that may "
                f"move, not {rows.shape}{order}"
            )
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
        return rows

    def _rows_of(self, name: object) -> list[int]:
        """Return the rows of p_WO of an obstacle that may move, or of all that it consists of."""
        names = self.moving_names
        for own in (lambda one: one == name, lambda one: one.startswith(f"{name}/")):
            if rows := [k for k, one in enumerate(names) if own(one)]:
                return rows
        if name in self.names:
            raise InvalidInputError(
                f"p_WO: {short(name)} may not move; give it its largest speed [m/s]"
            )
        others = nearest(str(name), list(names)) if names else "there is none"
        raise InvalidInputError(
            f"p_WO: {short(name)} is the name of no obstacle that may move; {others}"
        )

    @property
    def numbers(self) -> dict[str, Array]:
        """All that may differ between scenes of as many obstacles of each shape, by its place."""
        fields = fields_of(self)
        fields |= {f"cylinders.{name}": v for name, v in fields_of(self.cylinders).items()}
        return {name: fields[name] for name in NUMBER_AXES}

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """For each obstacle, its place among those that move; the place behind them if it rests."""
        places = np.full(len(self.names), len(self.moving), dtype=np.intp)
        places[self.moving] = np.arange(len(self.moving))
        return places


#: How far obstacles that may move have gone, as a caller gives it; see `Solids.places`.
Displacements = Array | Mapping[str, Array]

#: Classes of obstacles by their shape, in the order of `Solids`.
_SHAPES: tuple[tuple[type[Obstacle], ...], ...] = (
    (BallObstacle, CapsuleObstacle),
    (BoxObstacle,),
    (HalfSpaceObstacle,),
    (CylinderObstacle,),
)

#: How many axes each of `Solids.numbers` has of one scene.
NUMBER_AXES = {
    **{"ends": 3, "radii": 1, "centers": 2, "R_WO": 3, "half": 2, "normals": 2, "levels": 1},
    **{"cylinders.centers": 2, "cylinders.axes": 2, "cylinders.half": 1, "cylinders.radii": 1},
    **{"speeds": 1, "errors": 1},
}

_TINY = 1e-300
# Places of the entries that follow each one of a vector, and of those before it.
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


class Nearest(NamedTuple):
    """The nearest points of two shapes.

    Attributes:
        distance: Distance, shape (...) [m]; 0 where a segment is in a box or a cylinder.
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
    det, xp = a * f - b * b, functions_of(A, B)
    # Of parallel segments, any s does; a point has a = 0 and keeps s = 0.
    s = _share((b * g - c * f) / xp.where(det > 1e-14 * a * f, det, np.inf))
    t = _share((b * s + g) / xp.maximum(f, _TINY))
    s = _share((b * t - c) / xp.maximum(a, _TINY))
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
    xp = functions_of(A)
    moves = xp.abs(d) > _TINY
    along = xp.where(moves, d, 1.0)
    enters = xp.where(moves, (-half - p) / along, 0.0)
    leaves = xp.where(moves, (half - p) / along, 0.0)
    none = 0.0 * p[..., :1]
    places = xp.concatenate((enters, leaves, none, none + 1.0), axis=-1)
    s = xp.sort(_share(places), axis=-1)
    # The slope of half of the squared distance at these places is linear between them.
    x = p[..., None, :] + s[..., None] * d[..., None, :]
    out = x - clip(x, -half[..., None, :], half[..., None, :])
    slope = _dot(out, d[..., None, :])
    s0, s1, g0, g1 = _about_zero(s, slope)
    rise = g1 - g0
    share = _share(-g0 / xp.where(rise > 0.0, rise, np.inf))
    best = xp.where(slope[..., 0] > 0.0, 0.0, s0 + share * (s1 - s0))
    p_A = p + best[..., None] * d
    return _nearest(p_A, clip(p_A, -half, half))


def _about_zero(s: Array, slope: Array) -> tuple[Array, Array, Array, Array]:
    """Return the places, and slopes at them, that a rising slope passes zero between, (...) each.

    Args:
        s: Places, in order, shape (..., k).
        slope: Slopes there, likewise.
    """
    low = clip((slope <= 0.0).sum(axis=-1) - 1, 0, s.shape[-1] - 2)[..., None]
    if isinstance(s, np.ndarray):
        s0, s1 = (np.take_along_axis(s, low + k, axis=-1)[..., 0] for k in (0, 1))
        g0, g1 = (np.take_along_axis(slope, low + k, axis=-1)[..., 0] for k in (0, 1))
        return s0, s1, g0, g1
    s0, s1, g0, g1 = s[..., 0], s[..., 1], slope[..., 0], slope[..., 1]
    xp = functions_of(s)
    for k in range(1, s.shape[-1] - 1):
        later = low[..., 0] >= k
        s0, s1 = xp.where(later, s[..., k], s0), xp.where(later, s[..., k + 1], s1)
        g0, g1 = xp.where(later, slope[..., k], g0), xp.where(later, slope[..., k + 1], g1)
    return s0, s1, g0, g1


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
    is_first = heights[..., 0] <= heights[..., 1]
    xp = functions_of(A)
    height = xp.where(is_first, heights[..., 0], heights[..., 1])
    p_A = xp.where(is_first[..., None], A[..., 0, :], A[..., 1, :])
    return Nearest(height, p_A, p_A - height[..., None] * normals)


# Steps of Newton's method, which has converged after about five, and the last one's size.
_STEPS, _LAST_STEP = 60, 1e-10


def to_cylinders(A: Array, axes: Array, half: Array, radii: Array) -> Nearest:
    """Return the nearest points of segments and cylinders, from the centres of the cylinders.

    The squared distance of a point from a cylinder is convex along a segment. Between the up to
    five places where the point passes the planes of the ends, the cylinder's side or the foot of
    the axis, its slope is linear, or that of the distance from a circular edge, whose zero
    Newton's method finds.

    Args:
        A: Ends of segments, shape (..., 2, 3) [m].
        axes: Unit vectors along the axes, shape (..., 3).
        half: Half of the lengths, shape (...) [m].
        radii: Radii, shape (...) [m].
    """
    p, d = A[..., 0, :], A[..., 1, :] - A[..., 0, :]
    z, dz = _dot(p, axes), _dot(d, axes)
    r, dr = p - z[..., None] * axes, d - dz[..., None] * axes
    way = _AlongCylinder(z, dz, _dot(dr, dr), _dot(r, dr), _dot(r, r), half, radii)
    xp = functions_of(A)
    s = xp.sort(_share(way.places()), axis=-1)
    slope = _AlongCylinder(*(part[..., None] for part in way)).slope(s)[0]
    s0, s1, g0, g1 = _about_zero(s, slope)
    rise = g1 - g0
    best = s0 + _share(-g0 / xp.where(rise > 0.0, rise, np.inf)) * (s1 - s0)
    best = xp.where(slope[..., 0] > 0.0, 0.0, best)
    is_inside = (slope[..., 0] <= 0.0) & (g0 < 0.0) & (g1 > 0.0)
    if xp is not np:
        best = xp.where(is_inside, way.zero(best, s0, s1, ~is_inside), best)
    elif is_inside.any():
        none = np.zeros(np.count_nonzero(is_inside), dtype=bool)
        ends = best[is_inside], s0[is_inside], s1[is_inside]
        best[is_inside] = way.at(is_inside).zero(*ends, none)
    p_A = p + best[..., None] * d
    height = _dot(p_A, axes)
    across = p_A - height[..., None] * axes
    share = xp.minimum(1.0, radii / xp.maximum(xp.sqrt(_dot(across, across)), _TINY))
    p_B = clip(height, -half, half)[..., None] * axes + share[..., None] * across
    return _nearest(p_A, p_B)


class _AlongCylinder(NamedTuple):
    """Points along segments: heights z + s dz, squared distances from axes a s^2 + 2 b s + c."""

    z: Array
    dz: Array
    a: Array
    b: Array
    c: Array
    half: Array
    radii: Array

    def at(self, flags: NDArray[np.bool_]) -> _AlongCylinder:
        """Return some of them."""
        shape = self.z.shape
        return _AlongCylinder(*(np.broadcast_to(part, shape)[flags] for part in self))

    def places(self) -> Array:
        """Return where the slope has another form, and both ends, shape (..., 7)."""
        xp = functions_of(self.z)
        moves = xp.abs(self.dz) > _TINY
        along = xp.where(moves, self.dz, 1.0)
        leaves = [xp.where(moves, (k * self.half - self.z) / along, 0.0) for k in (-1.0, 1.0)]
        a = xp.maximum(self.a, _TINY)
        foot = clip(-self.b / a, -1e3, 1e3)
        reach = xp.sqrt(xp.maximum(self.b**2 - self.a * (self.c - self.radii**2), 0.0)) / a
        sides = [clip(foot + k * reach, -1e3, 1e3) for k in (-1.0, 1.0)]
        ends = [xp.zeros_like(foot), xp.ones_like(foot)]
        return xp.stack([*leaves, foot, *sides, *ends], axis=-1)

    def slope(self, s: Array) -> tuple[Array, Array]:
        """Return the slope of half of the squared distance, and its own slope."""
        xp, height = functions_of(s), self.z + s * self.dz
        above = height - clip(height, -self.half, self.half)
        along = self.a * s + self.b
        squares = xp.maximum((self.a * s + 2.0 * self.b) * s + self.c, self.radii**2)
        from_axis = xp.sqrt(squares)
        outside, rate = from_axis - self.radii, along / from_axis
        slope = above * self.dz + outside * rate
        bend = rate**2 + outside * (self.a - rate**2) / from_axis
        return slope, xp.where(above != 0.0, self.dz**2, 0.0) + xp.where(outside > 0.0, bend, 0.0)

    def zero(self, s: Array, low: Array, high: Array, is_done: NDArray[np.bool_]) -> Array:
        """Return where the slope is zero, from s on, between places where it is below and above.

        Where it is known already, it stays.
        """
        xp = functions_of(s)

        def step(parts: Parts) -> Parts:
            s, low, high, is_done = parts
            slope, bend = self.slope(s)
            low, high = xp.where(slope < 0.0, s, low), xp.where(slope > 0.0, s, high)
            after = s - slope / xp.maximum(bend, _TINY)
            after = xp.where((after >= low) & (after <= high), after, 0.5 * (low + high))
            after = xp.where(is_done, s, after)
            return after, low, high, is_done | (xp.abs(after - s) < _LAST_STEP)

        return repeat(step, (s, low, high, is_done), _STEPS)[0]


def cross(a: Array, b: Array) -> Array:
    """Return cross products, shape (..., 3); NumPy's own function takes three times as long."""
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        (ax, ay, az), (bx, by, bz) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (a, b))
        entries = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        return functions_of(a, b).stack(entries, axis=-1)
    forth = a.take(_NEXT, axis=-1) * b.take(_LAST, axis=-1)
    return np.asarray(forth - a.take(_LAST, axis=-1) * b.take(_NEXT, axis=-1))


def _nearest(p_A: Array, p_B: Array) -> Nearest:
    apart = p_A - p_B
    return Nearest(functions_of(apart).sqrt(_dot(apart, apart)), p_A, p_B)


def _share(x: Array) -> Array:
    return clip(x, 0.0, 1.0)


def _dot(a: Array, b: Array) -> Array:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        # Faster than the sum of products.
        return np.asarray(np.einsum("...i,...i->...", a, b))
    return (a * b).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """The joints of an arm where all of them are at zero, in the world frame W.

    Link k is what joints 1 to k move, link 0 the base. A point that is at p_W where all joints are
    at zero is at ``R p_W + p`` in a posture, with the rotation and translation of its link: a
    product of exponentials, as of `drake_rnn.robot.screws.Screws`, which follows the end effector
    of many robots; this follows all links of one.

    Arms beside each other have their joints and links one after the other, a base for each. These
    may stand anywhere: each arm's points are stated in the frame of its base.

    Attributes:
        axes: Unit axes of the n joints, base to tip, shape (n, 3).
        points: A point on each axis, shape (n, 3) [m].
        slides: For each joint, whether it is prismatic.
        travels: How far each prismatic joint can be from zero, 0 for the others, shape (n,) [m].
        begins: The first joint of each arm.
        bases: Pose of each arm's base in the world frame, shape (arms, 4, 4); None if all are at
            its origin.
    """

    axes: Array
    points: Array
    slides: tuple[bool, ...]
    travels: Array
    begins: tuple[int, ...] = (0,)
    bases: Array | None = None

    @classmethod
    def beside(cls, one: LinkPoses, other: LinkPoses) -> LinkPoses:
        """Return the joints of two arms in the same world frame."""
        return cls(
            np.concatenate((one.axes, other.axes)),
            np.concatenate((one.points, other.points)),
            (*one.slides, *other.slides),
            np.concatenate((one.travels, other.travels)),
            (*one.begins, *(len(one.slides) + begin for begin in other.begins)),
            np.concatenate((one._base_poses, other._base_poses)),
        )

    def move(self, R: Array, p: Array) -> LinkPoses:
        """Return them where all bases are turned by R, shape (3, 3), and moved by p [m]."""
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = R, p
        return replace(self, bases=X @ self._base_poses)

    @property
    def _base_poses(self) -> Array:
        return np.tile(np.eye(4), (len(self.begins), 1, 1)) if self.bases is None else self.bases

    @cached_property
    def moved_by(self) -> NDArray[np.intp]:
        """The link that each joint moves first, shape (n,)."""
        joints = np.arange(len(self.slides))
        return joints + np.searchsorted(self.begins, joints, side="right")

    @cached_property
    def any_slides(self) -> bool:
        """Whether any joint is prismatic."""
        return any(self.slides)

    @property
    def count(self) -> int:
        """Number of links, bases included."""
        return len(self.slides) + len(self.begins)

    def at(self, q: Array) -> Array:
        """Return the motions of all links from zero, shape (..., count, 4, 4).

        Args:
            q: Joint positions, shape (..., n) [rad, or m of a joint that slides].
        """
        turns, rotations, slid, constants = self._parts
        bases = self.bases
        if not isinstance(q, np.ndarray) or is_foreign(bases):
            return self._traced_at(q)
        # Link by link in memory, as products are fastest.
        p = q.reshape(-1, len(self.slides)).T[:, :, None, None]
        each = constants + np.sin(p) * turns + (1.0 - np.cos(p)) * rotations
        if self.any_slides:
            each += p * slid
        motions = np.empty((self.count, each.shape[1], 4, 4))
        for a, begin in enumerate(self.begins):
            motions[begin + a] = constants[0] if bases is None else bases[a]
            motions[begin + a + 1] = each[begin] if bases is None else bases[a] @ each[begin]
        for k, link in self._after_another:
            np.matmul(motions[link - 1], each[k], out=motions[link])
        return motions.transpose(1, 0, 2, 3).reshape(*q.shape[:-1], self.count, 4, 4)

    def _traced_at(self, q: Array) -> Array:
        """Return what `at` does of an array of JAX."""
        xp, bases = functions_of(q, self.bases), self.bases
        turns, rotations, slid, constants = (part[:, 0] for part in self._parts)
        p = q[..., None, None]
        each = constants + xp.sin(p) * turns + (1.0 - xp.cos(p)) * rotations
        if self.any_slides:
            each = each + p * slid
        motions = []
        for k in range(len(self.slides)):
            if k in self.begins:
                base = constants[0] if bases is None else bases[self.begins.index(k)]
                first = each[..., k, :, :]
                motions += [
                    xp.broadcast_to(base, (*each.shape[:-3], 4, 4)),
                    first if bases is None else base @ first,
                ]
            else:
                motions.append(motions[-1] @ each[..., k, :, :])
        return xp.stack(motions, axis=-3)

    def axes_at(self, X: Array) -> tuple[Array, Array]:
        """Return unit axes and a point on each in a posture, both of shape (..., n, 3).

        Args:
            X: Motions of the links, from `at`.
        """
        X = X[..., self.moved_by, :, :]
        R, p = X[..., :3, :3], X[..., :3, 3]
        points = (R @ self.points[..., None])[..., 0] + p
        return (R @ self.axes[..., None])[..., 0], points

    @cached_property
    def _after_another(self) -> list[tuple[int, int]]:
        """Joints that are not the first of an arm, each with the link that it moves first."""
        links = enumerate(self.moved_by.tolist())
        return [(k, link) for k, link in links if k not in self.begins]

    @cached_property
    def _parts(self) -> tuple[Array, Array, Array, Array]:
        """What sine, one less cosine, position and 1 count in each motion, shape (n, 1, 4, 4)."""
        n = len(self.slides)
        turns, rotations, slid = (np.zeros((n, 1, 4, 4)) for _ in range(3))
        for k, (axis, point) in enumerate(zip(self.axes, self.points, strict=True)):
            if self.slides[k]:
                slid[k, 0, :3, 3] = axis
                continue
            K = np.cross(np.eye(3), axis)
            for part, matrix in ((turns, K), (rotations, K @ K)):
                part[k, 0, :3, :3] = matrix
                # A rotation about an axis through the point: it stays where it is.
                part[k, 0, :3, 3] = -matrix @ point
        return turns, rotations, slid, np.broadcast_to(np.eye(4), (n, 1, 4, 4))


@validated
class Capsule:
    """All points within a radius of a segment that moves with a body; a ball if the ends are one.

    Args:
        body: Name of the body.
        ends: Ends of the segment in the body's frame, two points [m].
        radius: Radius [m].
    """

    body: str
    ends: tuple[Point, Point]
    radius: Length

    def holds(self, points: Array) -> bool:
        """Return whether all points, shape (k, 3) [m], lie within the capsule, up to rounding."""
        return bool((self.outside(points) <= 1e-9).all())

    def outside(self, points: Array) -> Array:
        """Return how far points, shape (k, 3) [m], are outside; negative within, shape (k,) [m]."""
        return off_segment(points, np.array(self.ends)) - self.radius


def off_segment(points: Array, ends: Array) -> Array:
    """Return how far points, shape (k, 3), are from a segment, shape (2, 3), as shape (k,) [m]."""
    along = ends[1] - ends[0]
    s = np.clip((points - ends[0]) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - ends[0] - s[:, None] * along, axis=1))


@dataclass(frozen=True, eq=False)
class ArmCapsules:
    """The capsules of an arm where all of its joints are at zero, and what moves them.

    Attributes:
        poses: The joints of the arm.
        bodies: Name of the body of each of the c capsules.
        links: Link of each, see `LinkPoses`, shape (c,).
        ends: Ends of their segments, where points are stated, see `LinkPoses`, shape (c, 2, 3) [m].
        radii: Their radii, shape (c,) [m].
    """

    poses: LinkPoses
    bodies: tuple[str, ...]
    links: NDArray[np.intp]
    ends: Array
    radii: Array

    @classmethod
    def beside(cls, one: ArmCapsules, other: ArmCapsules) -> ArmCapsules:
        """Return the capsules of two arms in the same world frame; the other's have a prime."""
        return cls(
            LinkPoses.beside(one.poses, other.poses),
            (*one.bodies, *(f"{body}'" for body in other.bodies)),
            np.concatenate((one.links, one.poses.count + other.links)),
            np.concatenate((one.ends, other.ends)),
            np.concatenate((one.radii, other.radii)),
        )

    def move(self, R: Array, p: Array) -> ArmCapsules:
        """Return them where the arm's base is turned by R, shape (3, 3), and moved by p [m]."""
        return replace(self, poses=self.poses.move(R, p))

    def some(self, numbers: NDArray[np.intp]) -> ArmCapsules:
        """Return some of them, by their numbers."""
        bodies = tuple(self.bodies[k] for k in numbers)
        selection = self.links[numbers], self.ends[numbers], self.radii[numbers]
        return ArmCapsules(self.poses, bodies, *selection)

    @property
    def bases(self) -> NDArray[np.intp]:
        """The links that are bases."""
        return np.array([begin + a for a, begin in enumerate(self.poses.begins)])

    @property
    def chains(self) -> NDArray[np.intp]:
        """For each capsule, the chain that moves it; 0 for one at rest, shape (c,)."""
        return np.searchsorted(self.bases, self.links, side="right") - 1

    def joints_between(self, pairs: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return how many joints are between the capsules of pairs, shape (s, 2), as (s,)."""
        chains, depths = self.chains[pairs], (self.links - self.bases[self.chains])[pairs]
        apart = (depths > 0).all(axis=1) & (chains[:, 0] != chains[:, 1])
        return np.where(apart, depths.sum(axis=1), np.abs(depths[:, 0] - depths[:, 1]))

    @property
    def carried_by_joint(self) -> NDArray[np.bool_]:
        """For each capsule, whether a joint carries it, shape (c, n)."""
        poses, bases = self.poses, self.bases
        of_capsule, of_joint = (
            np.searchsorted(bases, links, side="right") for links in (self.links, poses.moved_by)
        )
        reaches = poses.moved_by <= self.links[:, None]
        return np.asarray((of_joint == of_capsule[:, None]) & reaches)

    def segments_in_world(self, X: Array) -> Array:
        """Return the ends of all segments in the world frame, shape (..., c, 2, 3) [m].

        Args:
            X: Motions of the links, from ``poses.at``.
        """
        return np.swapaxes((X[..., self.links, :, :] @ self._columns)[..., :3, :], -1, -2)

    @cached_property
    def _columns(self) -> Array:
        """The ends as columns with a 1 below, shape (c, 4, 2)."""
        columns = np.ones((len(self.links), 4, 2))
        columns[:, :3] = np.swapaxes(self.ends, -1, -2)
        return columns


def number_names(bodies: Sequence[str]) -> list[str]:
    """Return the names of capsules: a body's name, with a number from 1 if the body has several."""
    count, place, names = Counter(bodies), Counter[str](), []
    for body in bodies:
        place[body] += 1
        names.append(f"{body} {place[body]}" if count[body] > 1 else body)
    return names
