r"""How far an arm is from itself and from obstacles, and where, at several postures at once.

Links are capsules, see `drake_rnn.robot.clearance.capsules`. A pair is two capsules of the arm,
or one and an obstacle. While the joints move by Delta q, a pair comes nearer by at most

.. math::
    \ell = \sum_i |\Delta q_i| \rho_i

over the joints between its two sides, where rho_i bounds how far from joint i's axis any point of
the capsule's segment can be: its distance from the axis to the next joint, which no posture
changes, and the lengths from there on.

Obstacles may move, without turning: p_WO is how far each has gone from where it is stated, in the
order of `drake_rnn.robot.clearance.solids.Solids.moving`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from .capsules import ArmCapsules
from .segments import Nearest, between_segments, cross, to_boxes, to_half_spaces
from .solids import Solids

#: Numbers of capsules, obstacles, pairs and postures.
Indices = NDArray[np.intp]

# Below this distance of two axes there is no direction away [m].
_CROSSING = 1e-9
# How exact the least distance between postures is [m], and how often a way is halved for it.
_ENOUGH, _HALVINGS = 1e-6, 16


class Near(NamedTuple):
    """What is near at some postures.

    Attributes:
        gaps: Distances of all pairs, shape (k, p) [m].
        postures: Posture of each of the r near ones, shape (r,).
        pairs: Pair of each, shape (r,).
        slopes: Derivatives of their distances with respect to the joints, shape (r, n) [m/rad].
    """

    gaps: Array
    postures: Indices
    pairs: Indices
    slopes: Array


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
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of the two sides of each pair."""
        bodies, solids = self.arm.bodies, self.solids.names
        own = [(bodies[a], bodies[b]) for a, b in self.own]
        return (*own, *((bodies[a], solids[k]) for a, k in self._outer))

    @cached_property
    def reaches(self) -> Array:
        """How much nearer a pair comes at most for each unit that a joint moves, shape (p, n)."""
        first, second = self._carried[self._first], self._second_carried
        spans = self._spans()
        # What moves both sides leaves their distance as it is.
        own = np.zeros_like(second, dtype=float)
        own[: len(self.own)] = spans[self.own[:, 1]]
        return np.asarray(
            np.where(first & ~second, spans[self._first], 0.0) + np.where(second & ~first, own, 0.0)
        )

    @cached_property
    def speeds(self) -> Array:
        """How fast a pair may come nearer by the obstacle's own motion, shape (p,) [m/s]."""
        return self._of_pairs(self.solids.speeds)

    @cached_property
    def errors(self) -> Array:
        """How much nearer the obstacle of a pair may be than measured, shape (p,) [m]."""
        return self._of_pairs(self.solids.errors)

    def gaps(self, q: Array, p_WO: Array | None = None) -> Array:
        """Return the distance of each pair, shape (..., p) [m]; negative where they overlap.

        Capsules whose segments cross, and segments in a box, count as overlapping by their radii.

        Args:
            q: Joint positions, shape (..., n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) or (..., m, 3) [m]; None if not at all.
        """
        return self._nearest(self.arm.placed(self.arm.poses.at(q)), p_WO)[0]

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
        left, reached = p_WO[:-1], p_WO[1:]
        owners = np.arange(1, len(q))
        for _ in range(_HALVINGS):
            way = np.abs(end - begin) @ self.reaches.T + self._drift(reached - left)
            nearer = 0.5 * (d_begin + d_end - way)
            unsure = nearer.min(axis=1, initial=np.inf) < least.min() - _ENOUGH
            if not unsure.any():
                break
            begin, end, owners = begin[unsure], end[unsure], owners[unsure]
            left, reached = left[unsure], reached[unsure]
            middle, passed = 0.5 * (begin + end), 0.5 * (left + reached)
            d_middle = self.gaps(middle, passed)
            np.minimum.at(least, owners, d_middle.min(axis=1))
            begin, end = np.concatenate((begin, middle)), np.concatenate((middle, end))
            left, reached = np.concatenate((left, passed)), np.concatenate((passed, reached))
            d_begin = np.concatenate((d_begin[unsure], d_middle))
            d_end = np.concatenate((d_middle, d_end[unsure]))
            owners = np.concatenate((owners, owners))
        return np.asarray(least)

    def near(self, q: Array, within: float | Array, p_WO: Array | None = None) -> Near:
        """Return all distances, and how those below a bound change with the joints.

        Args:
            q: Joint positions, shape (k, n) [rad].
            within: The bound, a number or one for each posture and pair, shape (k, p) [m].
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
        """
        X = self.arm.poses.at(q)
        gaps, found = self._nearest(self.arm.placed(X), p_WO)
        postures, pairs = np.nonzero(gaps < within)
        p_A, p_B = found.p_A[postures, pairs], found.p_B[postures, pairs]
        distance = found.distance[postures, pairs]
        normals = (p_A - p_B) / np.where(np.abs(distance) > _CROSSING, distance, np.inf)[:, None]
        axes, points = self.arm.poses.axes_at(X)
        # How fast each joint moves a point along the normal: a (r x n) = n (a x r). Both points of
        # a pair lie on its normal, so that r may lead to either.
        turned = cross(p_A[:, None, :] - points[postures], normals[:, None, :])
        if any(self.arm.poses.slides):
            slides = np.array(self.arm.poses.slides)[:, None]
            turned = np.where(slides, normals[:, None, :], turned)
        slopes = self._parted[pairs] * (axes[postures] * turned).sum(axis=-1)
        return Near(gaps, postures, pairs, slopes)

    def _nearest(self, ends: Array, p_WO: Array | None) -> tuple[Array, Nearest]:
        """Return the pairs' distances, and the nearest points of their segments."""
        sides = self._sides
        if p_WO is not None and self.solids.moving.size:
            sides = _moved(sides, p_WO)
        first, second = ends[..., sides.round_first, :, :], ends[..., sides.own_second, :, :]
        if sides.fixed.size:
            fixed = np.broadcast_to(sides.fixed, (*ends.shape[:-3], *sides.fixed.shape[-3:]))
            second = np.concatenate((second, fixed), axis=-3)
        found = [between_segments(first, second)]
        if sides.half.size:
            R, p = sides.R_WO, sides.centers
            near = to_boxes((ends[..., sides.box_first, :, :] - p[..., None, :]) @ R, sides.half)
            back = ((R @ x[..., None])[..., 0] + p for x in near[1:])
            found.append(Nearest(near.distance, *back))
        if sides.levels.size:
            walls = ends[..., sides.wall_first, :, :]
            found.append(to_half_spaces(walls, sides.normals, sides.levels))
        if len(found) > 1:
            distance, p_A, p_B = zip(*found, strict=True)
            parts = (np.concatenate(p_A, axis=-2), np.concatenate(p_B, axis=-2))
            found = [Nearest(np.concatenate(distance, axis=-1), *parts)]
        return found[0].distance - self._radii, found[0]

    @cached_property
    def _sides(self) -> _Sides:
        own, solids = len(self.own), self.solids
        first, second = self._outer.T
        r, b = len(solids.radii), len(solids.half)
        is_round, is_wall = second < r, second >= r + b
        is_box = ~(is_round | is_wall)
        balls, boxes, walls = second[is_round], second[is_box] - r, second[is_wall] - r - b
        return _Sides(
            round_first=np.concatenate((self._first[:own], first[is_round])),
            own_second=self.own[:, 1],
            fixed=solids.ends[balls],
            fixed_order=solids.order[second[is_round]],
            box_first=first[is_box],
            centers=solids.centers[boxes],
            R_WO=solids.R_WO[boxes],
            half=solids.half[boxes],
            box_order=solids.order[second[is_box]],
            wall_first=first[is_wall],
            normals=solids.normals[walls],
            levels=solids.levels[walls],
            wall_order=solids.order[second[is_wall]],
        )

    @cached_property
    def _outer(self) -> Indices:
        """Capsule and obstacle of each pair of the two, shape (o, 2).

        Obstacles count for the capsules of one arm that some joint moves.
        """
        movable = np.nonzero(self._carried[: self.alone].any(axis=1))[0]
        pairs = ((a, k) for k in range(len(self.solids.names)) for a in movable)
        kept = [(a, k) for a, k in pairs if (int(a), k) not in self.touching]
        return np.array(kept, dtype=np.intp).reshape(-1, 2)

    @cached_property
    def _first(self) -> Indices:
        """Capsule of the arm of each pair, shape (p,)."""
        return np.concatenate((self.own[:, 0], self._outer[:, 0])).astype(np.intp)

    @cached_property
    def _carried(self) -> NDArray[np.bool_]:
        """For each capsule, whether a joint carries it, shape (c, n)."""
        return self.arm.carried

    @cached_property
    def _second_carried(self) -> NDArray[np.bool_]:
        """For the other side of each pair, whether a joint carries it, shape (p, n)."""
        outer = np.zeros((len(self._outer), self.size), dtype=bool)
        return np.concatenate((self._carried[self.own[:, 1]], outer))

    @cached_property
    def _parted(self) -> Array:
        """For each pair, 1 if a joint moves its first side alone, -1 the second, shape (p, n)."""
        first, second = self._carried[self._first], self._second_carried
        return first.astype(float) - second.astype(float)

    @cached_property
    def _radii(self) -> Array:
        """The radii of both sides of each pair, shape (p,) [m]."""
        solids = self.solids
        second = np.concatenate((solids.radii, np.zeros(len(solids.half) + len(solids.levels))))
        second = np.concatenate((self.arm.radii[self.own[:, 1]], second[self._outer[:, 1]]))
        return np.asarray(self.arm.radii[self._first] + second)

    def _drift(self, moved: Array) -> Array:
        """Return how much nearer obstacles that move so, shape (k, m, 3), come, shape (k, p)."""
        far = np.zeros((len(moved), len(self.solids.names)))
        far[:, self.solids.moving] = np.linalg.norm(moved, axis=-1)
        return self._of_pairs(far)

    def _of_pairs(self, values: Array) -> Array:
        """Return what obstacles have, shape (..., k), of each pair, shape (..., p)."""
        own = np.zeros((*values.shape[:-1], len(self.own)))
        return np.concatenate((own, values[..., self._outer[:, 1]]), axis=-1)

    def _spans(self) -> Array:
        """Return how far a capsule's segment can be from each joint's axis, shape (c, n) [m]."""
        poses, arm = self.arm.poses, self.arm
        spans = np.zeros((len(arm.links), self.size))
        for c, (carried, ends) in enumerate(zip(self._carried, arm.ends, strict=True)):
            joints = np.nonzero(carried)[0]
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


def _moved(sides: _Sides, p_WO: Array) -> _Sides:
    """Return the sides of all pairs where obstacles have moved, of `Clearance.gaps`."""
    # Obstacles at rest share the last place.
    p = np.concatenate((p_WO, np.zeros((*p_WO.shape[:-2], 1, 3))), axis=-2)
    rise = (sides.normals * p[..., sides.wall_order, :]).sum(axis=-1)
    return sides._replace(
        fixed=sides.fixed + p[..., sides.fixed_order, None, :],
        centers=sides.centers + p[..., sides.box_order, :],
        levels=sides.levels + rise,
    )


def _off_axis(points: Array, axis: Array) -> float:
    """Return the largest distance of points, relative to one of an axis, from that axis [m]."""
    return float(np.linalg.norm(cross(points, axis), axis=1).max())
