r"""How far an arm is from itself and from obstacles, and where, at several postures at once.

Links are capsules, see `drake_rnn.robot.clearance.capsules`. A pair is two capsules of the arm,
or one and an obstacle. While the joints move by Delta q, a pair comes nearer by at most

.. math::
    \ell = \sum_i |\Delta q_i| \rho_i

over the joints between its two sides, where rho_i bounds how far from joint i's axis any point of
the capsule's segment can be: its distance from the axis to the next joint, which no posture
changes, and the lengths from there on.

Obstacles may move, without turning: p_WO is how far each has gone from where it is stated. Its rows
are those of `drake_rnn.robot.clearance.capsules.Solids.moving`: in the order of the obstacles that
were given, of which those that never move have none.

- Pairs of capsules of an arm, and of capsules and obstacles, laid out to be looked at at once.
- What an arm is to stay clear of if another one stands beside it.
- Another arm beside the one that a law moves, as far as the law knows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.algebra import clip, entries, functions_of, is_foreign
from ...errors import old_arguments
from ...inputs.fields import Array
from ...inputs.messages import fields_of
from ..limits import JointLimits
from .capsules import (
    ArmCapsules,
    Cylinders,
    Nearest,
    Solids,
    between_segments,
    cross,
    to_boxes,
    to_cylinders,
    to_half_spaces,
)

#: Numbers of capsules, obstacles and pairs, and whether something is so of each.
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Below this distance of two axes there is no direction away [m].
_CROSSING = 1e-9
# What is nearer to a distance than this differs from it by rounding [m].
_ROUNDING = 1e-14


class _Sides(NamedTuple):
    """The two sides of all pairs: capsules of the arm, and what they may meet, shape by shape.

    Those of obstacles come with their places among the obstacles that move.
    """

    round_first: Indices
    own_second: Indices
    fixed: Array
    fixed_order: Indices
    box_first: Indices
    centers: Array
    R_WO: Array
    half: Array
    box_order: Indices
    wall_first: Indices
    normals: Array
    levels: Array
    wall_order: Indices
    cylinder_first: Indices
    cylinders: Cylinders
    cylinder_order: Indices
    # Whether the second side of each round pair is the arm's own, where their order tells nothing.
    is_own: Flags | None = None


class Needs(NamedTuple):
    """What is needed of the distances of pairs in some postures.

    Attributes:
        flags: Of which pairs, and in which postures, shape (k, p); of others they are -inf.
        bounds: Distances below which slopes are, of a pair that is below in one posture with slopes
            at least, shape (s, p) [m].
    """

    flags: Flags
    bounds: Array


@dataclass(frozen=True, eq=False)
class Pairs:
    """Some pairs: the arm's own come first, then those with obstacles, in the order of `Solids`.

    Attributes:
        arm: The capsules that they have.
        sides: Their sides.
        radii: The radii of both sides of each, shape (p,) [m].
        parted: For each, 1 if a joint moves its first side alone, -1 the second, shape (p, n).
        frames: Of each of the arm's own, the link in whose frame it is looked at, shape (s,).
    """

    arm: ArmCapsules
    sides: _Sides
    radii: Array
    parted: Array
    frames: Indices

    @classmethod
    def of(
        cls,
        arm: ArmCapsules,
        own: Indices,
        outer: Indices,
        solids: Solids,
        side_signs: Array,
        frames: Indices,
    ) -> Pairs:
        """Return pairs of an arm with itself and with obstacles.

        Args:
            arm: The arm's capsules.
            own: Pairs of these, shape (s, 2).
            outer: Pairs of a capsule and an obstacle, shape (o, 2).
            solids: The obstacles.
            side_signs: See `Pairs`, shape (s + o, n).
            frames: See `Pairs`, shape (s,).
        """
        ends = np.concatenate((own[:, 0], outer[:, 0], own[:, 1]))
        used, places = np.unique(ends, return_inverse=True)
        first, second = np.split(places.reshape(-1), [len(own) + len(outer)])
        xp, flat = functions_of(solids.radii), len(solids.names) - len(solids.radii)
        beside = xp.concatenate((solids.radii, np.zeros(flat)))
        radii = xp.concatenate((arm.radii[own[:, 1]], beside[outer[:, 1]]))
        sides = _sides(first, second, outer[:, 1], solids)
        return cls(arm.some(used), sides, arm.radii[used][first] + radii, side_signs, frames)

    def some(self, pairs: Indices, lanes: Sequence[Indices]) -> Pairs:
        """Return some of them, whose numbers JAX may not know yet.

        Args:
            pairs: Their numbers, shape (r,).
            lanes: The same of the round ones, boxes, half-spaces and cylinders, from 0 on each.
        """
        sides, own = self.sides, len(self.sides.own_second)
        r, b, w, c = lanes
        xp = functions_of(r)
        obstacle, second = xp.maximum(r - own, 0), xp.minimum(r, max(own - 1, 0))
        names = {name: b for name in ("box_first", "centers", "R_WO", "half", "box_order")}
        names |= {name: w for name in ("wall_first", "normals", "levels", "wall_order")}
        names |= {"round_first": r, "cylinder_first": c, "cylinder_order": c}
        names |= {"own_second": second} if own else {}
        names |= {"fixed": obstacle, "fixed_order": obstacle} if len(sides.fixed) else {}
        fields = sides._asdict()
        parts = {name: entries(fields[name], at) for name, at in names.items() if at.size}
        if c.size:
            solid = fields_of(sides.cylinders)
            parts["cylinders"] = Cylinders(**{name: entries(v, c) for name, v in solid.items()})
        frames = entries(self.frames, second) if own and r.size else self.frames
        return replace(
            self,
            sides=sides._replace(**parts, is_own=r < own),
            radii=entries(self.radii, pairs),
            parted=entries(self.parted, pairs),
            frames=frames,
        )

    def gaps(self, X: Array, p_WO: Array | None) -> Array:
        """Return the distance of each pair, shape (..., p) [m].

        Args:
            X: Motions of the links, from ``arm.poses.at``.
            p_WO: How far obstacles have moved, shape (m, 3) or (..., m, 3) [m]; None if not at all.
        """
        return self.nearest(X, p_WO).distance - self.radii

    def distances_and_slopes(
        self,
        X: Array,
        p_WO: Array | None,
        selection: Indices | slice,
        needs: Needs | None = None,
    ) -> tuple[Array, Array]:
        """Return the distance of each pair, and its slope with respect to the joints.

        Args:
            X: Motions of the links in k postures, from ``arm.poses.at``.
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            selection: The s postures in which slopes are wanted.
            needs: What is needed; None for all. Compiled code does not compute the rest.

        Returns:
            Distances, shape (k, p) [m], and slopes, shape (s, p, n) [m/rad].
        """
        near = self.nearest(X, p_WO, None if needs is None else needs.flags)
        X, p_A = X[selection], near.p_A[selection]
        normals = _normals(Nearest(*(part[selection] for part in near)))[..., None, :]
        axes, points = self.arm.poses.axes_at(X)
        # How fast each joint moves a point along the normal: a (r x n) = n (a x r). Both points of
        # a pair lie on its normal, so that r may lead to either.
        angular = cross(p_A[..., None, :] - points[:, None], normals)
        if self.arm.poses.any_slides:
            is_slide = np.array(self.arm.poses.slides)[:, None]
            angular = functions_of(angular).where(is_slide, normals, angular)
        slopes = self.parted * (axes[:, None] * angular).sum(axis=-1)
        gaps = near.distance - self.radii
        if needs is None:
            return gaps, slopes
        where = functions_of(gaps).where
        gaps = where(needs.flags, gaps, -np.inf)
        has_slopes = (needs.flags[selection] & (gaps[selection] < needs.bounds)).any(axis=0)
        return gaps, where(has_slopes[:, None], slopes, 0.0)

    def gaps_between(
        self,
        X: Array,
        near: Nearest,
        p_WO: Array | None,
        bend: Array,
        nearer: Array,
        flags: Flags | None = None,
    ) -> Array:
        """Return what planes leave of pairs in each piece of a way, shape (k - 1, p) [m].

        Of each pair there are two planes for a piece, each with the normal of the nearest points
        at one of its ends, turned with the link that `frames` names; and one that turns from the
        first normal to the second. A plane parts the two sides by so much at both ends, and by no
        less in between than `least_on_bow` says; the best one of the three counts.

        Args:
            X: Motions of the links in k postures, from ``arm.poses.at``.
            near: The nearest points there, from `nearest`.
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            bend: Largest second derivative of the way of points along each piece, as a function of
                the share of it that is gone, shape (k - 1, p) [m].
            nearer: How far they move against the link of `frames` in it at most, likewise.
            flags: Which pairs count, shape (p,); None for all.
        """
        xp, normals = functions_of(X), _normals(near)
        sides = self.sides
        if p_WO is not None and p_WO.size:
            sides = _move(sides, p_WO)
        ends = self.arm.segments_in_world(X)
        own, is_own = len(sides.own_second), sides.is_own
        forth, back, turn = normals[:-1], normals[1:], normals[1:] - normals[:-1]
        if own:
            R = X[:, self.frames, :3, :3]
            local = _turn_back(R, normals[:, :own])
            turn_own = local[1:] - local[:-1]
            on, off = _turn(R[1:], local[:-1]), _turn(R[:-1], local[1:])
            if is_own is not None:
                on = xp.where(is_own[:, None], on, forth[:, :own])
                off = xp.where(is_own[:, None], off, back[:, :own])
                turn_own = xp.where(is_own[:, None], turn_own, turn[:, :own])
            forth = xp.concatenate((on, forth[:, own:]), axis=1)
            back = xp.concatenate((off, back[:, own:]), axis=1)
            turn = xp.concatenate((turn_own, turn[:, own:]), axis=1)
        here = _parted_by(sides, ends, normals, flags)
        # But for rounding that is the distance, which may be the least that is allowed.
        here = xp.where(here >= near.distance - _ROUNDING, near.distance, here)
        after = _parted_by(sides, ends[1:], forth, flags)
        before = _parted_by(sides, ends[:-1], back, flags)
        planes = xp.maximum(
            least_on_bow(here[:-1], after, bend), least_on_bow(before, here[1:], bend)
        )
        # A normal that goes straight from the one to the other is nowhere longer than 1.
        turn = xp.sqrt((turn * turn).sum(axis=-1))
        turned = least_on_bow(here[:-1], here[1:], bend + 2.0 * turn * nearer)
        return xp.maximum(planes, turned) - self.radii

    def nearest(self, X: Array, p_WO: Array | None, flags: Flags | None = None) -> Nearest:
        """Return the nearest points of the pairs' segments; 0 where there is no flag, (..., p)."""
        sides, ends = self.sides, self.arm.segments_in_world(X)
        xp = functions_of(X)
        if p_WO is not None and p_WO.size:
            sides = _move(sides, p_WO)
        nearest_points = []
        if sides.round_first.size:
            nearest_points.append(between_segments(*_segments(sides, ends)))
        if sides.half.size:
            R, p = sides.R_WO, sides.centers
            near = to_boxes((ends[..., sides.box_first, :, :] - p[..., None, :]) @ R, sides.half)
            back = ((R @ x[..., None])[..., 0] + p for x in near[1:])
            nearest_points.append(Nearest(near.distance, *back))
        if sides.levels.size:
            walls = ends[..., sides.wall_first, :, :]
            nearest_points.append(to_half_spaces(walls, sides.normals, sides.levels))
        if sides.cylinder_first.size:
            solid = sides.cylinders
            segments = ends[..., sides.cylinder_first, :, :] - solid.centers[..., None, :]
            near = to_cylinders(segments, solid.axes, solid.half, solid.radii)
            back = (x + solid.centers for x in near[1:])
            nearest_points.append(Nearest(near.distance, *back))
        nearest_points = _only(nearest_points, flags)
        if len(nearest_points) == 1:
            return nearest_points[0]
        if not nearest_points:
            none = xp.zeros((*ends.shape[:-3], 0, 3))
            return Nearest(none[..., 0], none, none)
        distance, p_A, p_B = zip(*nearest_points, strict=True)
        parts = (xp.concatenate(p_A, axis=-2), xp.concatenate(p_B, axis=-2))
        return Nearest(xp.concatenate(distance, axis=-1), *parts)


def _only(kinds: list[Nearest], flags: Flags | None) -> list[Nearest]:
    """Return nearest points of pairs of each kind, 0 where there is no flag, shape (..., p)."""
    if flags is None:
        return kinds
    counts, where, found = (
        np.cumsum([0, *(len(each.distance.T) for each in kinds)]),
        functions_of(flags).where,
        [],
    )
    for (distance, *points), (a, b) in zip(kinds, pairwise(counts), strict=True):
        some = flags[..., a:b]
        points = [where(some[..., None], each, 0.0) for each in points]
        found.append(Nearest(where(some, distance, 0.0), *points))
    return found


def least_on_bow(begin: Array, end: Array, bend: Array | float) -> Array:
    """Return the least that a function can be between two values, by its second derivative.

    It is nowhere below the parabola through both values that has this second derivative: below an
    end only where the values differ by less than half of that.

    Args:
        begin: Its values at 0, shape (...).
        end: Its values at 1, likewise.
        bend: Its largest second derivative between 0 and 1, at least 0, likewise.
    """
    xp = functions_of(begin, end, bend)
    rise, bend = end - begin, bend + 0.0 * begin
    is_inside = xp.abs(rise) < 0.5 * bend
    off = rise * rise / xp.where(is_inside, bend, 1.0)
    bottom = 0.5 * (begin + end) - 0.125 * bend - 0.5 * off
    return xp.where(is_inside, bottom, xp.minimum(begin, end))


def _segments(sides: _Sides, ends: Array) -> tuple[Array, Array]:
    """Return the segments of both sides of pairs of what is round, shape (..., r, 2, 3) each."""
    first = ends[..., sides.round_first, :, :]
    if not sides.fixed.size:
        return first, ends[..., sides.own_second, :, :]
    xp, own = functions_of(ends), len(sides.own_second)
    if sides.is_own is not None and own:
        is_own = sides.is_own[:, None, None]
        return first, xp.where(is_own, ends[..., sides.own_second, :, :], sides.fixed)
    if xp is np:
        second = np.empty_like(first)
        second[..., :own, :, :] = ends[..., sides.own_second, :, :]
        second[..., own:, :, :] = sides.fixed
        return first, second
    if not own:
        return first, xp.broadcast_to(sides.fixed, (*first.shape[:-3], *sides.fixed.shape[-3:]))
    # One loop over all pairs, where parts that are joined would be loops of their own.
    places = np.arange(first.shape[-3])
    of_arm = sides.own_second[np.minimum(places, own - 1)]
    of_obstacles = sides.fixed[np.maximum(places - own, 0)]
    is_own = (places < own)[:, None, None]
    return first, xp.where(is_own, ends[..., of_arm, :, :], of_obstacles)


def _normals(near: Nearest) -> Array:
    """Return the unit normals of pairs, away from the second side, (..., 3); 0 where they cross."""
    xp = functions_of(near.distance)
    # The distance to a half-space is negative within it.
    away = xp.where(xp.abs(near.distance) <= _CROSSING, np.inf, near.distance)
    return (near.p_A - near.p_B) / away[..., None]


def _turn(R: Array, v: Array) -> Array:
    """Return vectors, shape (..., 3), turned by rotations, shape (..., 3, 3)."""
    return (R * v[..., None, :]).sum(axis=-1)


def _turn_back(R: Array, v: Array) -> Array:
    """Return vectors, shape (..., 3), turned back by rotations, shape (..., 3, 3)."""
    return (R * v[..., None]).sum(axis=-2)


def _heights(points: Array, normals: Array) -> Array:
    """Return heights of points, shape (..., 2, 3), along normals, shape (..., 3)."""
    return (points * normals[..., None, :]).sum(axis=-1)


def _parted_by(sides: _Sides, ends: Array, normals: Array, flags: Flags | None) -> Array:
    """Return by how much directions part the two sides of pairs, shape (k, p) [m].

    That is the lowest point of the first side less the highest of the second one along a vector
    of length 1 or 0. No two points of them are nearer, whatever the direction is.

    Args:
        sides: The sides, of obstacles where they are.
        ends: Ends of the capsules in k postures, shape (k, c, 2, 3) [m].
        normals: The directions, shape (k, p, 3).
        flags: Which pairs count, shape (p,); None for all. Of others it is 0.
    """
    xp, parts = functions_of(ends, normals), []
    counts = [len(sides.round_first), len(sides.half), len(sides.levels), len(sides.cylinder_first)]
    r, b, w, _ = np.cumsum(counts)
    if r:
        first, second = _segments(sides, ends)
        n = normals[:, :r]
        low, high = _heights(first, n), _heights(second, n)
        parts.append(xp.minimum(low[..., 0], low[..., 1]) - xp.maximum(high[..., 0], high[..., 1]))
    if b > r:
        n = normals[:, r:b]
        low = _heights(ends[:, sides.box_first], n)
        local = _turn_back(sides.R_WO, n)
        high = (n * sides.centers).sum(axis=-1) + (xp.abs(local) * sides.half).sum(axis=-1)
        parts.append(xp.minimum(low[..., 0], low[..., 1]) - high)
    if w > b:
        # Of a half-space there is one plane.
        low = _heights(ends[:, sides.wall_first], sides.normals)
        parts.append(xp.minimum(low[..., 0], low[..., 1]) - sides.levels)
    if counts[3]:
        n, solid = normals[:, w:], sides.cylinders
        low, along = _heights(ends[:, sides.cylinder_first], n), (n * solid.axes).sum(axis=-1)
        across = xp.sqrt(xp.maximum((n * n).sum(axis=-1) - along * along, 0.0))
        high = (n * solid.centers).sum(axis=-1) + xp.abs(along) * solid.half
        high = high + across * solid.radii
        parts.append(xp.minimum(low[..., 0], low[..., 1]) - high)
    if flags is not None:
        begins = np.cumsum([0, *(each.shape[-1] for each in parts)])
        parts = [
            xp.where(flags[a:b], each, 0.0)
            for each, (a, b) in zip(parts, pairwise(begins), strict=True)
        ]
    return parts[0] if len(parts) == 1 else xp.concatenate(parts, axis=-1)


def _sides(first: Indices, second: Indices, of: Indices, solids: Solids) -> _Sides:
    """Return the sides of pairs: first capsules, second ones, and obstacles of those without."""
    own, r, b = len(second), len(solids.radii), len(solids.half)
    outer, s = first[own:], len(solids.levels)
    is_round, is_box, is_wall, is_cylinder = (
        np.searchsorted((r, r + b, r + b + s), of, side="right") == k for k in range(4)
    )
    balls, boxes, walls = of[is_round], of[is_box] - r, of[is_wall] - r - b
    return _Sides(
        round_first=np.concatenate((first[:own], outer[is_round])),
        own_second=second,
        fixed=solids.ends[balls],
        fixed_order=solids.order[of[is_round]],
        box_first=outer[is_box],
        centers=solids.centers[boxes],
        R_WO=solids.R_WO[boxes],
        half=solids.half[boxes],
        box_order=solids.order[of[is_box]],
        wall_first=outer[is_wall],
        normals=solids.normals[walls],
        levels=solids.levels[walls],
        wall_order=solids.order[of[is_wall]],
        cylinder_first=outer[is_cylinder],
        cylinders=solids.cylinders.some(of[is_cylinder] - r - b - s),
        cylinder_order=solids.order[of[is_cylinder]],
    )


def _move(sides: _Sides, p_WO: Array) -> _Sides:
    """Return the sides of pairs where obstacles have moved, of `Clearance.gaps`."""
    # Obstacles at rest share the last place.
    p = functions_of(p_WO).concatenate((p_WO, np.zeros((*p_WO.shape[:-2], 1, 3))), axis=-2)
    moved: dict[str, Any] = {}
    if sides.fixed.size:
        moved["fixed"] = sides.fixed + p[..., sides.fixed_order, None, :]
    if sides.half.size:
        moved["centers"] = sides.centers + p[..., sides.box_order, :]
    if sides.levels.size:
        rise = (sides.normals * p[..., sides.wall_order, :]).sum(axis=-1)
        moved["levels"] = sides.levels + rise
    if sides.cylinder_first.size:
        centers = sides.cylinders.centers + p[..., sides.cylinder_order, :]
        moved["cylinders"] = replace(sides.cylinders, centers=centers)
    return sides._replace(**moved)


# How exact the least distance between postures is [m], and how often a way is halved for it.
_ENOUGH, _HALVINGS = 1e-6, 16
# Sets of pairs that are remembered as they were laid out.
_MEMORY = 8
# Pairs of a kind that a compiled step looks at, at most, before it looks at all.
_FEW = 16
_ALL = slice(None)


class Near(NamedTuple):
    """How far pairs are apart at some postures, and how that changes with the joints.

    Attributes:
        pairs: The pairs, in order, shape (r,).
        gaps: Their distances, shape (k, r) [m].
        slopes: Derivatives of these with respect to the joints, shape (s, r, n) [m/rad], in all
            postures or in those that they were asked for in.
    """

    pairs: Indices
    gaps: Array
    slopes: Array


class CriticalPoints(NamedTuple):
    """Where each of L links of two arms is nearest the other arm, on the axes of their capsules.

    Attributes:
        gaps: How far the capsules are apart there, shape (..., L) [m].
        ways: From the link's point to the other arm's, shape (..., L, 3) [m].
        J: Jacobian of the link's point, shape (..., L, 3, n) [m].
    """

    gaps: Array
    ways: Array
    J: Array


class _MutualPairs(NamedTuple):
    """Pairs of capsules of two arms: their numbers, shape (r,), and the L links that they have.

    Of each link, `sides` says of which first sides, and then of which second ones, it has the
    capsule, shape (L, 2 r), and `carries` which joints move it, shape (L, n).
    """

    pairs: Indices
    sides: Flags
    carries: Flags


@dataclass(frozen=True, eq=False)
class Clearance:
    """The pairs of an arm with itself and with obstacles.

    Attributes:
        arm: The arm's capsules.
        own: Pairs of capsules that are to stay apart, shape (s, 2).
        solids: The obstacles.
        alone: Number of capsules that obstacles count for, the first ones: those of one arm, where
            there is another one beside it; None for all of them.
        touching: Capsules and obstacles that may touch, by their numbers: pairs that are not
            looked at, such as a tool and what it presses on.
    """

    arm: ArmCapsules
    own: Indices
    solids: Solids
    alone: int | None = None
    touching: frozenset[tuple[int, int]] = frozenset()

    @property
    def count(self) -> int:
        """Number of pairs; the arm's own come first, then those with obstacles."""
        return len(self._first)

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.arm.poses.slides)

    @cached_property
    def begins(self) -> tuple[int, ...]:
        """Numbers of the first pairs with what is round, boxes, half-spaces and cylinders."""
        return tuple(int(at) for at in np.cumsum([0, *self._kinds[:-1]]))

    @cached_property
    def lanes(self) -> tuple[int, ...]:
        """How many pairs of each kind are few, see `few`."""
        return tuple(min(size, _FEW) for size in self._kinds)

    @cached_property
    def _kinds(self) -> tuple[int, ...]:
        """Number of pairs of each kind."""
        s = self._every.sides
        firsts = (s.round_first, s.box_first, s.wall_first, s.cylinder_first)
        return tuple(map(len, firsts))

    def few(self, flags: Flags) -> tuple[Indices, Flags, Indices, Any]:
        """Return the pairs with a flag, if they are few, in arrays whose shape a compiler knows.

        Args:
            flags: Which of all pairs they are, shape (p,).

        Returns:
            Numbers of pairs, shape (r,), which of these count, the place of each pair among them,
            shape (p,), and whether all pairs with a flag are among them.
        """
        xp, pairs, counts, places, are_all, lane = functions_of(flags), [], [], [], True, 0
        for begin, kind, size in zip(self.begins, self._kinds, self.lanes, strict=True):
            if not size:
                continue
            ranks, lanes = xp.cumsum(1.0 * flags[begin : begin + kind]), np.arange(size)
            place = (ranks <= 1.0 * lanes[:, None]).sum(axis=1)
            pairs.append(begin + xp.minimum(place, kind - 1))
            counts.append(lanes < ranks[-1])
            places.append(lane + clip(ranks - 1.0, 0.0, size - 1.0).astype(int))
            are_all, lane = are_all & (ranks[-1] <= size), lane + size
        return *map(xp.concatenate, (pairs, counts, places)), are_all

    @cached_property
    def contents(self) -> object:
        """The same of two if, and only if, all of their numbers are."""
        return _contents(self)

    @cached_property
    def structure(self) -> object:
        """The same of two that differ at most in numbers and names of obstacles, and in bases."""
        solids, shapes = self.solids, {name: np.shape(v) for name, v in self.solids.numbers.items()}
        arm = replace(self.arm, poses=replace(self.arm.poses, bases=None))
        parts = fields_of(self) | {"solids": (solids.moving, tuple(shapes.items())), "arm": arm}
        return tuple((name, _contents(part)) for name, part in parts.items())

    def lay_out(self) -> None:
        """Compute now what is kept of all pairs."""
        _ = self._every, self.speeds, self.errors

    @cached_property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of the two sides of each pair."""
        bodies, solids = self.arm.bodies, self.solids.names
        own = [(bodies[a], bodies[b]) for a, b in self.own]
        return (*own, *((bodies[a], solids[k]) for a, k in self._outer))

    @cached_property
    def reaches(self) -> Array:
        """How much nearer a pair comes at most for each unit that a joint moves, shape (p, n)."""
        first, second = self._carried_by_joint[self._first], self._second_carried
        spans = self._spans()
        # What moves both sides leaves their distance as it is.
        own = np.zeros_like(second, dtype=float)
        own[: len(self.own)] = spans[self.own[:, 1]]
        return np.asarray(
            np.where(first & ~second, spans[self._first], 0.0) + np.where(second & ~first, own, 0.0)
        )

    @cached_property
    def common(self) -> Array:
        """1 for each joint that turns both sides of a pair, 0 for all others, shape (p, n)."""
        both = self._carried_by_joint[self._first] & self._second_carried
        return np.where(np.array(self.arm.poses.slides), 0.0, both.astype(float))

    def way_and_bend(self, way: Array, pairs: Indices | slice = _ALL) -> tuple[Array, Array]:
        """Return how much nearer pairs come at most, and how far from a chord of their way.

        See `drake_rnn.laws.parts.world`.

        Args:
            way: How far each joint goes, there and back, shape (..., n) [rad].
            pairs: The pairs, in order, shape (r,).

        Returns:
            How much nearer the pairs come, shape (..., r) [m], and the largest second derivative of
            the way of points of them, as a function of the share of it that is gone, while joints
            go straight, likewise.
        """
        xp, poses = functions_of(way), self.arm.poses
        reaches, turns = entries(self.reaches, pairs).T, 1.0 - np.array(poses.slides, dtype=float)
        turned = way * turns
        # Of each arm, the joints before each one.
        before = turned @ self._before
        bent = way * (turned + 2.0 * before)
        nearer = way @ reaches
        bend = bent @ reaches - 2.0 * nearer * (way @ entries(self.common, pairs).T)
        return nearer, xp.maximum(bend, 0.0)

    @cached_property
    def _before(self) -> Array:
        """1 where the first joint comes before the second one in the same arm, shape (n, n)."""
        arms = np.searchsorted(self.arm.poses.begins, np.arange(self.size), side="right")
        return np.triu(arms[:, None] == arms, k=1).astype(float)

    @cached_property
    def speeds(self) -> Array:
        """How fast a pair may come nearer by the obstacle's own motion, shape (p,) [m/s]."""
        return self._of_pairs(self.solids.speeds)

    @cached_property
    def errors(self) -> Array:
        """How much nearer the obstacle of a pair may be than measured, shape (p,) [m]."""
        return self._of_pairs(self.solids.errors)

    def of_moving(self, values: Array) -> Array:
        """Return what obstacles that may move have, shape (m,), of each pair; 0 of all others."""
        # Obstacles at rest share the last place.
        all_values = functions_of(values).concatenate((values, np.zeros(1)))
        return self._of_pairs(all_values[self.solids.order])

    def gaps(self, q: Array, p_WO: Array | None = None, pairs: Indices | None = None) -> Array:
        """Return the distance of each pair, shape (..., p) [m]; negative where they overlap.

        Capsules whose segments cross, and segments in a box, count as overlapping by their radii.

        Args:
            q: Joint positions, shape (..., n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) or (..., m, 3) [m]; None if not at all.
            pairs: The pairs that are looked at, in order, shape (p,); None for all.
        """
        selection = self._every if pairs is None else self._among(pairs)
        return selection.gaps(self.arm.poses.at(q), p_WO)

    def least_along(self, q: Array, p_WO: Array | None = None) -> Array:
        """Return the least distance of any pair at postures on a way, shape (k,) [m].

        Joints and obstacles move straight from one to the next. Where a pair may have come nearer
        between two of them than anywhere at them, by more than a micrometre, postures in between
        are looked at, and the later of the two has what is found.

        Args:
            q: Joint positions, shape (k, n) [rad].
            p_WO: How far obstacles have moved, shape (k, m, 3) [m]; None if not at all.
        """
        p_WO = np.zeros((len(q), len(self.solids.moving), 3)) if p_WO is None else p_WO
        gaps = self.gaps(q, p_WO)
        least = gaps.min(axis=1)
        begin, end, d_begin, d_end = q[:-1], q[1:], gaps[:-1], gaps[1:]
        left, right = p_WO[:-1], p_WO[1:]
        owners = np.arange(1, len(q))
        for _ in range(_HALVINGS):
            way = np.abs(end - begin) @ self.reaches.T + self._drift(right - left)
            nearer = 0.5 * (d_begin + d_end - way)
            unsure = nearer.min(axis=1, initial=np.inf) < least.min() - _ENOUGH
            if not unsure.any():
                break
            begin, end, owners = begin[unsure], end[unsure], owners[unsure]
            left, right = left[unsure], right[unsure]
            middle, midpoint = 0.5 * (begin + end), 0.5 * (left + right)
            d_middle = self.gaps(middle, midpoint)
            np.minimum.at(least, owners, d_middle.min(axis=1))
            begin, end = np.concatenate((begin, middle)), np.concatenate((middle, end))
            left, right = np.concatenate((left, midpoint)), np.concatenate((midpoint, right))
            d_begin = np.concatenate((d_begin[unsure], d_middle))
            d_end = np.concatenate((d_middle, d_end[unsure]))
            owners = np.concatenate((owners, owners))
        return np.asarray(least)

    @old_arguments(sloped="with_slopes")
    def near(
        self,
        q: Array,
        p_WO: Array | None = None,
        pairs: Indices | None = None,
        with_slopes: Indices | slice = _ALL,
        needs: Needs | None = None,
    ) -> Near:
        """Return distances, and how they change with the joints.

        Args:
            q: Joint positions, shape (k, n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            pairs: The pairs that are looked at, in order, shape (r,); None for all.
            with_slopes: The postures in which slopes are wanted.
            needs: What is needed of these pairs, see `Pairs.distances_and_slopes`.
        """
        selection = self._every if pairs is None else self._among(pairs)
        number, X = np.arange(self.count) if pairs is None else pairs, self.arm.poses.at(q)
        return Near(number, *selection.distances_and_slopes(X, p_WO, with_slopes, needs))

    def view(
        self,
        q: Array,
        p_WO: Array | None = None,
        pairs: Indices | None = None,
        flags: Flags | None = None,
    ) -> tuple[Array, Callable[[Array, Array], Array]]:
        """Return distances on a way, and a function for what planes leave between postures.

        That is computed only if it is called.

        Args:
            q: Joint positions, shape (k, n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            pairs: The pairs that are looked at, in order, shape (r,); None for all.
            flags: Which of these count, shape (r,); None for all. What is returned of others means
                nothing.

        Returns:
            Distances, shape (k, r) [m], and a function that returns what `Pairs.gaps_between` does,
            given ``bend`` and ``nearer``.
        """
        selection = self._every if pairs is None else self._among(pairs)
        X = self.arm.poses.at(q)
        near = selection.nearest(X, p_WO, flags)
        gaps = near.distance - selection.radii
        if flags is not None:
            gaps = functions_of(gaps).where(flags, gaps, 0.0)

        def planes(bend: Array, nearer: Array) -> Array:
            return selection.gaps_between(X, near, p_WO, bend, nearer, flags)

        return gaps, planes

    @cached_property
    def between_arms(self) -> Clearance | None:
        """The pairs of links of two arms that the same law moves alone; None for one arm."""
        # Arms whose laws count with each other are told apart by `alone`.
        if self.alone is not None or not self._mutual.pairs.size:
            return None
        own = self.own[self._mutual.pairs]
        return replace(self, own=own, solids=Solids.of([]), touching=frozenset())

    def nearest_surfaces(self, q: Array) -> tuple[float, Array]:
        """Return the distance of the nearest pair of capsules and where they are so, (2, 3) [m].

        Args:
            q: Joint positions, shape (n,) [rad].
        """
        near = self._every.nearest(self.arm.poses.at(q), None)
        gaps = near.distance - self._every.radii
        k = int(gaps.argmin())
        radii, normal = self.arm.radii[self.own[k]], _normals(near)[k]
        ends = near.p_A[k] - radii[0] * normal, near.p_B[k] + radii[1] * normal
        return float(gaps[k]), np.array(ends)

    @property
    def mutual_links(self) -> int:
        """Number L of links that may come near those of another arm that the same law moves."""
        return len(self._mutual.carries)

    def critical_points(self, q: Array) -> CriticalPoints:
        """Return where links of two arms that the same law moves are nearest the other arm.

        Links that no joint moves are left out.

        Args:
            q: Joint positions, shape (..., n) [rad].
        """
        pairs, sides, carries = self._mutual
        poses, selection = self.arm.poses, self._among(pairs)
        X = poses.at(q)
        near = selection.nearest(X, None)
        xp, gap = functions_of(X), near.distance - selection.radii
        gaps = xp.where(sides, xp.concatenate((gap, gap), axis=-1)[..., None, :], np.inf)
        # The one that counts for each link; a product picks it, of many robots as of one.
        pick = 1.0 * (np.arange(sides.shape[-1]) == gaps.argmin(axis=-1)[..., None])
        own = pick @ xp.concatenate((near.p_A, near.p_B), axis=-2)
        other = pick @ xp.concatenate((near.p_B, near.p_A), axis=-2)
        axes, points = (part[..., None, :, :] for part in poses.axes_at(X))
        J = cross(axes, own[..., None, :] - points)
        if poses.any_slides:
            J = xp.where(np.array(poses.slides)[:, None], axes, J)
        J = xp.swapaxes(xp.where(carries[..., None], J, 0.0), -1, -2)
        return CriticalPoints(gaps.min(axis=-1), other - own, J)

    @cached_property
    def _mutual(self) -> _MutualPairs:
        links, arm = self.arm.links[self.own], self.arm
        moves = ~np.isin(links, arm.bases).any(axis=1)
        chains = arm.chains[self.own]
        pairs = np.flatnonzero(moves & (chains[:, 0] != chains[:, 1]))
        every = np.unique(links[pairs])
        sides = np.concatenate([side == every[:, None] for side in links[pairs].T], axis=1)
        first = [int(np.flatnonzero(arm.links == link)[0]) for link in every]
        return _MutualPairs(pairs, sides, arm.carried_by_joint[first])

    @cached_property
    def _every(self) -> Pairs:
        signs, frames = self._side_signs, self._frames
        return Pairs.of(self.arm, self.own, self._outer, self.solids, signs, frames)

    def _among(self, pairs: Indices) -> Pairs:
        """Return some pairs; the last few are remembered, as they are often the same."""
        if is_foreign(pairs):
            return self.among_few(pairs)
        key = pairs.tobytes()
        if (selection := self._selections.get(key)) is None:
            own, outer = np.split(pairs, [np.searchsorted(pairs, len(self.own))])
            sides = self.own[own], self._outer[outer - len(self.own)]
            signs, frames = self._side_signs[pairs], self._frames[own]
            selection = Pairs.of(self.arm, *sides, self.solids, signs, frames)
            if len(self._selections) >= _MEMORY:
                self._selections.clear()
            self._selections[key] = selection
        return selection

    def among_few(self, pairs: Indices) -> Pairs:
        """Return few pairs, by the numbers that `few` returns."""
        lanes, first = [], 0
        for begin, size in zip(self.begins, self.lanes, strict=True):
            lanes.append(pairs[first : first + size] - begin)
            first += size
        return self._every.some(pairs, lanes)

    @cached_property
    def _selections(self) -> dict[bytes, Pairs]:
        return {}

    @cached_property
    def _outer(self) -> Indices:
        """Capsule and obstacle of each pair of the two, shape (o, 2).

        Obstacles count for the capsules of one arm that some joint moves.
        """
        movable = np.nonzero(self._carried_by_joint[: self.alone].any(axis=1))[0]
        pairs = ((a, k) for k in range(len(self.solids.names)) for a in movable)
        outer = [(a, k) for a, k in pairs if (int(a), k) not in self.touching]
        return np.array(outer, dtype=np.intp).reshape(-1, 2)

    @cached_property
    def _first(self) -> Indices:
        """Capsule of the arm of each pair, shape (p,)."""
        return np.concatenate((self.own[:, 0], self._outer[:, 0])).astype(np.intp)

    @cached_property
    def _carried_by_joint(self) -> NDArray[np.bool_]:
        """For each capsule, whether a joint carries it, shape (c, n)."""
        return self.arm.carried_by_joint

    @cached_property
    def _second_carried(self) -> NDArray[np.bool_]:
        """For the other side of each pair, whether a joint carries it, shape (p, n)."""
        outer = np.zeros((len(self._outer), self.size), dtype=bool)
        return np.concatenate((self._carried_by_joint[self.own[:, 1]], outer))

    @cached_property
    def _frames(self) -> Indices:
        """The link in whose frame each of the arm's own pairs is looked at, shape (s,).

        That of the side that fewer joints move, where these move the other one as well; else, of
        two arms, the first link, which is at rest.
        """
        first, second = (self._carried_by_joint[side] for side in self.own.T)
        links = np.where(
            (first.sum(axis=1) <= second.sum(axis=1)),
            self.arm.links[self.own[:, 0]],
            self.arm.links[self.own[:, 1]],
        )
        nested = (first <= second).all(axis=1) | (second <= first).all(axis=1)
        return np.where(nested, links, 0).astype(np.intp)

    @cached_property
    def _side_signs(self) -> Array:
        """For each pair, 1 if a joint moves its first side alone, -1 the second, shape (p, n)."""
        first, second = self._carried_by_joint[self._first], self._second_carried
        return first.astype(float) - second.astype(float)

    def _drift(self, displacement: Array) -> Array:
        """Return how much nearer obstacles that move so, shape (k, m, 3), come, shape (k, p)."""
        far = np.zeros((len(displacement), len(self.solids.names)))
        far[:, self.solids.moving] = np.linalg.norm(displacement, axis=-1)
        return self._of_pairs(far)

    def _of_pairs(self, values: Array) -> Array:
        """Return what obstacles have, shape (..., k), of each pair, shape (..., p)."""
        own = np.zeros((*values.shape[:-1], len(self.own)))
        outer = values[..., self._outer[:, 1]]
        return functions_of(values).concatenate((own, outer), axis=-1)

    def _spans(self) -> Array:
        """Return how far a capsule's segment can be from each joint's axis, shape (c, n) [m]."""
        poses, arm = self.arm.poses, self.arm
        spans = np.zeros((len(arm.links), self.size))
        for c, (carriers, ends) in enumerate(zip(self._carried_by_joint, arm.ends, strict=True)):
            joints = np.nonzero(carriers)[0]
            for j in joints:
                # To the next joint or, from the last, to the farther end.
                after = joints[joints > j]
                following = poses.points[after]
                way = _off_axis(
                    (following[:1] if len(following) else ends) - poses.points[j], poses.axes[j]
                )
                if len(following):
                    way += float(np.linalg.norm(np.diff(following, axis=0), axis=1).sum())
                    way += float(np.linalg.norm(ends - following[-1], axis=1).max())
                    way += float(poses.travels[after].sum())
                spans[c, j] = 1.0 if poses.slides[j] else way
        return spans


def _contents(value: Any) -> object:
    """Return what can be compared of arrays, and of objects and sequences that hold them."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, tuple):
        return tuple(map(_contents, value))
    fields = fields_of(value)
    return tuple((name, _contents(part)) for name, part in fields.items()) if fields else value


def _off_axis(points: Array, axis: Array) -> float:
    """Return the largest distance of points, relative to one of an axis, from that axis [m]."""
    return float(np.linalg.norm(cross(points, axis), axis=1).max())


def beside(one: Clearance, other: ArmCapsules) -> Clearance:
    """Return what an arm is to stay clear of: itself, obstacles and another arm.

    Postures of the result are those of the arm and, behind them, of the other one. What the other
    arm is to stay clear of besides, itself and obstacles, is none of this arm's pairs.

    Args:
        one: What the arm is to stay clear of alone.
        other: The capsules of the other arm, where it stands in the same world frame.
    """
    arm = ArmCapsules.beside(one.arm, other)
    moving_capsules = np.nonzero(one.arm.carried_by_joint.any(axis=1))[0]
    count = len(one.arm.links)
    others = np.arange(count, count + len(other.links))
    pairs = np.stack(np.meshgrid(moving_capsules, others, indexing="ij"), axis=-1).reshape(-1, 2)
    own = np.concatenate((one.own, pairs)).astype(np.intp)
    return Clearance(arm, own, one.solids, alone=count, touching=one.touching)


def stood(clearance: Clearance, R: Array, p: Array) -> Clearance:
    """Return the pairs of an arm with itself where its base is turned by R and moved by p.

    Args:
        clearance: Its pairs where it stands at the origin.
        R: Orientation of its base, shape (3, 3).
        p: Position of its base, shape (3,) [m].
    """
    return replace(clearance, arm=clearance.arm.move(R, p))


#: What the names of the signals begin with by which a law sees another arm.
OTHER = "other_"


@dataclass(frozen=True, eq=False)
class Neighbour:
    """Another arm beside the one that a law moves, which keeps a stop of its own.

    Attributes:
        limits: Limits of its joints; what it may brake with.
        has_chosen: Whether it has chosen for the next sample already: what is seen of it is then
            where it is, and how fast, at the end of that sample.
    """

    limits: JointLimits
    has_chosen: bool

    @property
    def parts(self) -> dict[str, str]:
        """What is seen of it, by signal: the part of its own law's state that this is.

        Its commanded positions, velocities and, if the jerk is bounded, accelerations.
        """
        names = ("commanded", "v") if self.limits.jerk is None else ("commanded", "v", "a")
        return {OTHER + name: name for name in names}
