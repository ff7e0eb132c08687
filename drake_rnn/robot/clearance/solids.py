"""Obstacles as arrays: the distances of many segments from all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    """

    names: tuple[str, ...]
    ends: Array
    radii: Array
    centers: Array
    R_WO: Array
    half: Array
    normals: Array
    levels: Array

    @classmethod
    def of(cls, obstacles: Sequence[Obstacle]) -> Solids:
        """Return obstacles as arrays."""
        balls = [o for o in obstacles if isinstance(o, (BallObstacle, CapsuleObstacle))]
        boxes = [o for o in obstacles if isinstance(o, BoxObstacle)]
        walls = [o for o in obstacles if isinstance(o, HalfSpaceObstacle)]
        ends = [(o.center, o.center) if isinstance(o, BallObstacle) else o.ends for o in balls]
        return cls(
            names=tuple(o.name for o in (*balls, *boxes, *walls)),
            ends=np.array(ends).reshape(-1, 2, 3),
            radii=np.array([o.radius for o in balls]),
            centers=np.array([o.center for o in boxes]).reshape(-1, 3),
            R_WO=np.array([o.R_WO for o in boxes]).reshape(-1, 3, 3),
            half=np.array([0.5 * o.size for o in boxes]).reshape(-1, 3),
            normals=np.array([o.normal_W for o in walls]).reshape(-1, 3),
            levels=np.array([o.normal_W.dot(o.point) for o in walls]),
        )
