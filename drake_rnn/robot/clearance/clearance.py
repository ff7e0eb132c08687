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
from .pairs import Indices, Pairs
from .segments import cross
from .solids import Solids

# How exact the least distance between postures is [m], and how often a way is halved for it.
_ENOUGH, _HALVINGS = 1e-6, 16
# Sets of pairs that are remembered as they were laid out.
_REMEMBERED = 8
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

    def of_moving(self, values: Array) -> Array:
        """Return what obstacles that may move have, shape (m,), of each pair; 0 of all others."""
        of_all = np.zeros(len(self.solids.names))
        of_all[self.solids.moving] = values
        return self._of_pairs(of_all)

    def gaps(self, q: Array, p_WO: Array | None = None, pairs: Indices | None = None) -> Array:
        """Return the distance of each pair, shape (..., p) [m]; negative where they overlap.

        Capsules whose segments cross, and segments in a box, count as overlapping by their radii.

        Args:
            q: Joint positions, shape (..., n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) or (..., m, 3) [m]; None if not at all.
            pairs: The pairs that are looked at, in order, shape (p,); None for all.
        """
        known = self._every if pairs is None else self._among(pairs)
        return known.gaps(self.arm.poses.at(q), p_WO)

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

    def near(
        self,
        q: Array,
        p_WO: Array | None = None,
        pairs: Indices | None = None,
        sloped: Indices | slice = _ALL,
    ) -> Near:
        """Return distances, and how they change with the joints.

        Args:
            q: Joint positions, shape (k, n) [rad].
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            pairs: The pairs that are looked at, in order, shape (r,); None for all.
            sloped: The postures in which slopes are wanted.
        """
        known = self._every if pairs is None else self._among(pairs)
        number = np.arange(self.count) if pairs is None else pairs
        return Near(number, *known.sloped(self.arm.poses.at(q), p_WO, sloped))

    @cached_property
    def _every(self) -> Pairs:
        return Pairs.of(self.arm, self.own, self._outer, self.solids, self._parted)

    def _among(self, pairs: Indices) -> Pairs:
        """Return some pairs; the last few are remembered, as they are often the same."""
        key = pairs.tobytes()
        if (found := self._asked.get(key)) is None:
            own, outer = np.split(pairs, [np.searchsorted(pairs, len(self.own))])
            sides = self.own[own], self._outer[outer - len(self.own)]
            found = Pairs.of(self.arm, *sides, self.solids, self._parted[pairs])
            if len(self._asked) >= _REMEMBERED:
                self._asked.clear()
            self._asked[key] = found
        return found

    @cached_property
    def _asked(self) -> dict[bytes, Pairs]:
        return {}

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


def _off_axis(points: Array, axis: Array) -> float:
    """Return the largest distance of points, relative to one of an axis, from that axis [m]."""
    return float(np.linalg.norm(cross(points, axis), axis=1).max())
