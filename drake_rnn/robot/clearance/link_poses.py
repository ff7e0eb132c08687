"""Poses of all links of an arm, at one posture or several at once, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """The joints of an arm where all of them are at zero, in the world frame W.

    Link k is what joints 1 to k move, link 0 the base. A point that is at p_W where all joints are
    at zero is at ``R p_W + p`` in a posture, with the rotation and translation of its link: a
    product of exponentials, as of `drake_rnn.robot.screws.Screws`, which follows the end effector
    of many robots; this follows all links of one.

    Arms beside each other have their joints and links one after the other, a base for each.

    Attributes:
        axes: Unit axes of the n joints, base to tip, shape (n, 3).
        points: A point on each axis, shape (n, 3) [m].
        slides: For each joint, whether it is prismatic.
        travels: How far each prismatic joint can be from zero, 0 for the others, shape (n,) [m].
        begins: The first joint of each arm.
    """

    axes: Array
    points: Array
    slides: tuple[bool, ...]
    travels: Array
    begins: tuple[int, ...] = (0,)

    @classmethod
    def beside(cls, one: LinkPoses, other: LinkPoses) -> LinkPoses:
        """Return the joints of two arms in the same world frame."""
        return cls(
            np.concatenate((one.axes, other.axes)),
            np.concatenate((one.points, other.points)),
            (*one.slides, *other.slides),
            np.concatenate((one.travels, other.travels)),
            (*one.begins, *(len(one.slides) + begin for begin in other.begins)),
        )

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
        turns, turned, slid, fixed = self._parts
        # Link by link in memory, as products are fastest.
        p = q.reshape(-1, len(self.slides)).T[:, :, None, None]
        each = fixed + np.sin(p) * turns + (1.0 - np.cos(p)) * turned
        if self.any_slides:
            each += p * slid
        motions = np.empty((self.count, each.shape[1], 4, 4))
        for a, begin in enumerate(self.begins):
            motions[begin + a] = fixed[0]
            motions[begin + a + 1] = each[begin]
        for k, link in self._after_another:
            np.matmul(motions[link - 1], each[k], out=motions[link])
        return motions.transpose(1, 0, 2, 3).reshape(*q.shape[:-1], self.count, 4, 4)

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
        turns, turned, slid = (np.zeros((n, 1, 4, 4)) for _ in range(3))
        for k, (axis, point) in enumerate(zip(self.axes, self.points, strict=True)):
            if self.slides[k]:
                slid[k, 0, :3, 3] = axis
                continue
            K = np.cross(np.eye(3), axis)
            for part, matrix in ((turns, K), (turned, K @ K)):
                part[k, 0, :3, :3] = matrix
                # A rotation about an axis through the point: it stays where it is.
                part[k, 0, :3, 3] = -matrix @ point
        return turns, turned, slid, np.broadcast_to(np.eye(4), (n, 1, 4, 4))
