"""Obstacles as arrays: the distances of many segments from all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

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
