"""Pairs of capsules of an arm, and of capsules and obstacles, laid out to be looked at at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from .capsules import ArmCapsules
from .segments import Nearest, between_segments, cross, to_boxes, to_half_spaces
from .solids import Solids

#: Numbers of capsules, obstacles and pairs, and whether something is so of each.
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Below this distance of two axes there is no direction away [m].
_CROSSING = 1e-9


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
class Pairs:
    """Some pairs: the arm's own come first, then those with obstacles, in the order of `Solids`.

    Attributes:
        arm: The capsules that they have.
        sides: Their sides.
        radii: The radii of both sides of each, shape (p,) [m].
        parted: For each, 1 if a joint moves its first side alone, -1 the second, shape (p, n).
    """

    arm: ArmCapsules
    sides: _Sides
    radii: Array
    parted: Array

    @classmethod
    def of(
        cls, arm: ArmCapsules, own: Indices, outer: Indices, solids: Solids, parted: Array
    ) -> Pairs:
        """Return pairs of an arm with itself and with obstacles.

        Args:
            arm: The arm's capsules.
            own: Pairs of these, shape (s, 2).
            outer: Pairs of a capsule and an obstacle, shape (o, 2).
            solids: The obstacles.
            parted: See `Pairs`, shape (s + o, n).
        """
        ends = np.concatenate((own[:, 0], outer[:, 0], own[:, 1]))
        used, places = np.unique(ends, return_inverse=True)
        first, second = np.split(places.reshape(-1), [len(own) + len(outer)])
        beside = np.concatenate((solids.radii, np.zeros(len(solids.half) + len(solids.levels))))
        radii = np.concatenate((arm.radii[own[:, 1]], beside[outer[:, 1]]))
        sides = _sides(first, second, outer[:, 1], solids)
        return cls(arm.some(used), sides, arm.radii[used][first] + radii, parted)

    def gaps(self, X: Array, p_WO: Array | None) -> Array:
        """Return the distance of each pair, shape (..., p) [m].

        Args:
            X: Motions of the links, from ``arm.poses.at``.
            p_WO: How far obstacles have moved, shape (m, 3) or (..., m, 3) [m]; None if not at all.
        """
        return self._nearest(X, p_WO).distance - self.radii

    def sloped(self, X: Array, p_WO: Array | None, chosen: Indices | slice) -> tuple[Array, Array]:
        """Return the distance of each pair, and its slope with respect to the joints.

        Args:
            X: Motions of the links in k postures, from ``arm.poses.at``.
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
            chosen: The s postures in which slopes are wanted.

        Returns:
            Distances, shape (k, p) [m], and slopes, shape (s, p, n) [m/rad].
        """
        near = self._nearest(X, p_WO)
        X, (distance, p_A, p_B) = X[chosen], (part[chosen] for part in near)
        away, tiny = distance, np.abs(distance) <= _CROSSING
        if np.count_nonzero(tiny):
            away = np.where(tiny, np.inf, distance)
        normals = ((p_A - p_B) / away[..., None])[..., None, :]
        axes, points = self.arm.poses.axes_at(X)
        # How fast each joint moves a point along the normal: a (r x n) = n (a x r). Both points of
        # a pair lie on its normal, so that r may lead to either.
        turned = cross(p_A[..., None, :] - points[:, None], normals)
        if self.arm.poses.any_slides:
            turned = np.where(np.array(self.arm.poses.slides)[:, None], normals, turned)
        slopes = self.parted * (axes[:, None] * turned).sum(axis=-1)
        return near.distance - self.radii, slopes

    def _nearest(self, X: Array, p_WO: Array | None) -> Nearest:
        """Return the nearest points of the pairs' segments."""
        sides, ends = self.sides, self.arm.placed(X)
        if p_WO is not None and p_WO.size:
            sides = _moved(sides, p_WO)
        first, own = ends[..., sides.round_first, :, :], len(sides.own_second)
        second = np.empty_like(first)
        second[..., :own, :, :] = ends[..., sides.own_second, :, :]
        second[..., own:, :, :] = sides.fixed
        found = [between_segments(first, second)]
        if sides.half.size:
            R, p = sides.R_WO, sides.centers
            near = to_boxes((ends[..., sides.box_first, :, :] - p[..., None, :]) @ R, sides.half)
            back = ((R @ x[..., None])[..., 0] + p for x in near[1:])
            found.append(Nearest(near.distance, *back))
        if sides.levels.size:
            walls = ends[..., sides.wall_first, :, :]
            found.append(to_half_spaces(walls, sides.normals, sides.levels))
        if len(found) == 1:
            return found[0]
        distance, p_A, p_B = zip(*found, strict=True)
        parts = (np.concatenate(p_A, axis=-2), np.concatenate(p_B, axis=-2))
        return Nearest(np.concatenate(distance, axis=-1), *parts)


def _sides(first: Indices, second: Indices, of: Indices, solids: Solids) -> _Sides:
    """Return the sides of pairs: first capsules, second ones, and obstacles of those without."""
    own, r, b = len(second), len(solids.radii), len(solids.half)
    outer = first[own:]
    is_round, is_wall = of < r, of >= r + b
    is_box = ~(is_round | is_wall)
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
    )


def _moved(sides: _Sides, p_WO: Array) -> _Sides:
    """Return the sides of pairs where obstacles have moved, of `Clearance.gaps`."""
    # Obstacles at rest share the last place.
    p = np.concatenate((p_WO, np.zeros((*p_WO.shape[:-2], 1, 3))), axis=-2)
    rise = (sides.normals * p[..., sides.wall_order, :]).sum(axis=-1)
    return sides._replace(
        fixed=sides.fixed + p[..., sides.fixed_order, None, :],
        centers=sides.centers + p[..., sides.box_order, :],
        levels=sides.levels + rise,
    )
