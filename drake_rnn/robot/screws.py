"""An arm as a product of exponentials: numbers that need no Drake, for one robot or for many."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays.namespace import AnyArray, in_front, robots_last
from .moved_screws import Home, Link, MovedScrews
from .triples import constant


@dataclass(frozen=True, eq=False)
class Screws:
    """An arm's joints and its task frame E where all joints are at zero, in the world frame W.

    The pose of E is a product of exponentials (R. W. Brockett, "Robotic manipulators and the
    product of exponentials formula", 1984): each joint turns or slides all that comes after it.
    `drake_rnn.robot.arm_screws.screws_of` makes it from an arm.

    Leading axes are robots: fields without them are of one arm that all robots share, fields with
    them give each robot its own; they are broadcast against those of the joint positions. Only the
    order of the joints and whether they turn or slide are the same for all. ::

        screws = screws_of(load_arm("panda"))
        moved = screws.at(q)             # q of shape (..., n), of NumPy or of JAX
        moved.p_WE, moved.J              # shapes (..., 3) and (..., 3, n)
        moved.Jdot_v(v)                  # shape (..., 3)

    Only what is asked for is computed, once for each `at`. A robot's numbers have the same bits
    alone as among any others in NumPy, since each is a sum in a fixed order; in JAX they follow
    from what its compiler makes of it. Masses play no part.

    Memory: results are views whose robots lie side by side (`robots_last`), and elementwise
    operations on them are fastest and keep that order. Positions that lie the same way, e.g.
    because they were integrated from such results, are not copied. About a thousand robots at a
    time fit the cache of a processor; many more at once cost more for each.

    In JAX, close over the screws, or make them inside of the compiled function, e.g. by
    `dataclasses.replace`, to have derivatives with respect to their fields.

    Attributes:
        axes: Unit axes of the k joints between base and E, from the base on, shape (..., k, 3).
        offsets: From W's origin to a point of the first axis, from there to one of the next, and so
            on; the last one leads to E. Shape (..., k + 1, 3) [m].
        R_WE: Orientation of E, shape (..., 3, 3).
        R_WF: Orientations of the joints' own frames, in which errors of the links are given, shape
            (..., k, 3, 3).
        slides: For each of the k joints, whether it is prismatic.
        columns: For each of them, which entry of the joint positions moves it.
        n: Number of joint positions; those that move none of the k joints do not move E.
    """

    axes: AnyArray
    offsets: AnyArray
    R_WE: AnyArray
    R_WF: AnyArray
    slides: tuple[bool, ...]
    columns: tuple[int, ...]
    n: int

    def at(self, q: AnyArray) -> MovedScrews:
        """Return pose and Jacobians of E at joint positions, computed when asked for.

        Args:
            q: Joint positions, shape (..., n) [rad, or m of a joint that slides].

        Raises:
            InvalidInputError: If ``q`` is no array of float64 of that shape.
        """
        return MovedScrews(self._home, q)

    @property
    def robots(self) -> tuple[int, ...]:
        """Shape of the leading axes; () if all robots share one arm."""
        return np.broadcast_shapes(
            self.axes.shape[:-2], self.offsets.shape[:-2], self.R_WE.shape[:-2]
        )

    @cached_property
    def _home(self) -> Home:
        axes, offsets = robots_last(self.axes, 2), robots_last(self.offsets, 2)
        x, y, z = in_front(self.R_WE.swapaxes(-1, -2), 2)
        links = zip(offsets, axes, self.slides, self.columns, strict=False)
        return Home(
            [Link(constant(d), constant(a), slides, column) for d, a, slides, column in links],
            constant(offsets[-1]),
            (constant(x), constant(y), constant(z)),
            self.n,
            self.robots,
        )
