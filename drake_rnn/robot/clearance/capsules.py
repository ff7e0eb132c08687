"""Capsules round the links of an arm, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array, Length, Point, validated
from .link_poses import LinkPoses


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
        p, d = self.ends[0], self.ends[1] - self.ends[0]
        along = np.clip((points - p) @ d / max(float(d @ d), 1e-300), 0.0, 1.0)
        away = np.linalg.norm(points - p - along[:, None] * d, axis=1)
        return bool((away <= self.radius + 1e-9).all())


@dataclass(frozen=True, eq=False)
class ArmCapsules:
    """The capsules of an arm where all of its joints are at zero, and what moves them.

    Attributes:
        poses: The joints of the arm.
        bodies: Name of the body of each of the c capsules.
        links: Link of each, see `LinkPoses`, shape (c,).
        ends: Ends of their segments in the world frame, shape (c, 2, 3) [m].
        radii: Their radii, shape (c,) [m].
    """

    poses: LinkPoses
    bodies: tuple[str, ...]
    links: NDArray[np.intp]
    ends: Array
    radii: Array

    def placed(self, X: Array) -> Array:
        """Return the ends of all segments in the world frame, shape (..., c, 2, 3) [m].

        Args:
            X: Motions of the links, from ``poses.at``.
        """
        X = X[..., self.links, :, :]
        turned = self.ends @ np.swapaxes(X[..., :3, :3], -1, -2)
        return np.asarray(turned + X[..., None, :3, 3])
