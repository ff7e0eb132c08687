"""Capsules round the links of an arm, as arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

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
        ends: Ends of their segments in the world frame, shape (c, 2, 3) [m].
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

    def moved(self, R: Array, p: Array) -> ArmCapsules:
        """Return them where the arm's base is turned by R, shape (3, 3), and moved by p [m]."""
        poses = replace(self.poses, axes=self.poses.axes @ R.T, points=self.poses.points @ R.T + p)
        return replace(self, poses=poses, ends=self.ends @ R.T + p)

    def some(self, numbers: NDArray[np.intp]) -> ArmCapsules:
        """Return some of them, by their numbers."""
        bodies = tuple(self.bodies[k] for k in numbers)
        chosen = self.links[numbers], self.ends[numbers], self.radii[numbers]
        return ArmCapsules(self.poses, bodies, *chosen)

    @property
    def carried(self) -> NDArray[np.bool_]:
        """For each capsule, whether a joint carries it, shape (c, n)."""
        poses = self.poses
        bases = np.array([begin + a for a, begin in enumerate(poses.begins)])
        of_capsule, of_joint = (
            np.searchsorted(bases, links, side="right") for links in (self.links, poses.moved_by)
        )
        reaches = poses.moved_by <= self.links[:, None]
        return np.asarray((of_joint == of_capsule[:, None]) & reaches)

    def placed(self, X: Array) -> Array:
        """Return the ends of all segments in the world frame, shape (..., c, 2, 3) [m].

        Args:
            X: Motions of the links, from ``poses.at``.
        """
        return np.swapaxes((X[..., self.links, :, :] @ self._columns)[..., :3, :], -1, -2)

    @cached_property
    def _columns(self) -> Array:
        """The ends as columns with a 1 below, shape (c, 4, 2)."""
        found = np.ones((len(self.links), 4, 2))
        found[:, :3] = np.swapaxes(self.ends, -1, -2)
        return found


def numbered(bodies: Sequence[str]) -> list[str]:
    """Return the names of capsules: a body's name, with a number from 1 if the body has several."""
    count, place, found = Counter(bodies), Counter[str](), []
    for body in bodies:
        place[body] += 1
        found.append(f"{body} {place[body]}" if count[body] > 1 else body)
    return found
