"""An arm as a product of exponentials: numbers that need no Drake, for one robot or for many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays.namespace import AnyArray, robots_last
from ..errors import InvalidInputError
from ..inputs.complaints import require_several, require_type
from .moved_screws import Home, Link, MovedScrews
from .rotation import frame_about, product, times
from .triples import Matrix, Triple, constant, constant_matrix

# How many axes of an array are the arm's; those before them are robots.
_ARRAYS = {"axes": 2, "offsets": 2, "R_WE": 2, "R_WF": 3}


@dataclass(frozen=True, eq=False)
class Screws:
    """An arm's joints and its task frame E where all joints are at zero, in the world frame W.

    The pose of E is a product of exponentials (R. W. Brockett, "Robotic manipulators and the
    product of exponentials formula", 1984): each joint turns or slides all that comes after it.
    `drake_rnn.robot.arm_screws.screws_of` makes it from an arm.

    Leading axes are robots. Fields without them are of one arm that all robots share, fields with
    them give each robot its own: `side_by_side`, `drake_rnn.robot.link_errors`. They are broadcast
    against those of the joint positions. Only the order of the joints and whether they turn or
    slide are the same for all. ::

        screws = screws_of(load_arm("panda"))
        moved = screws.at(q)             # q of shape (..., n), of NumPy or of JAX
        moved.p_WE, moved.J              # shapes (..., 3) and (..., 3, n)
        moved.Jdot_v(v)                  # shape (..., 3)

    Results are computed when they are requested, and the pass through the joints is made once for
    each `at`: p_WE takes that pass, R_WE, J and J_omega add little, Jdot_v adds half of it again.
    In NumPy a robot's numbers have the same bits alone as among any others, also beside robots with
    arms of their own. JAX's compiler chooses its own order of summation.

    In memory, robots lie side by side in results, which are views: elementwise operations on them
    are fastest and keep that order, and positions that lie so are not copied. A matrix product of
    NumPy may add up such views otherwise than those of one robot; sums of products, one term after
    the other, do not. About a thousand robots at a time fit the cache of a processor.

    In JAX, close over the screws. For derivatives with respect to their fields make them inside of
    the function, by `dataclasses.replace`. Masses play no part.

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

    Raises:
        InvalidInputError: If shapes do not fit together.
    """

    axes: AnyArray
    offsets: AnyArray
    R_WE: AnyArray
    R_WF: AnyArray
    slides: tuple[bool, ...]
    columns: tuple[int, ...]
    n: int

    def __post_init__(self) -> None:
        k = len(self.slides)
        for name, array, shape in (
            ("axes", self.axes, (k, 3)),
            ("offsets", self.offsets, (k + 1, 3)),
            ("R_WE", self.R_WE, (3, 3)),
            ("R_WF", self.R_WF, (k, 3, 3)),
        ):
            if array.shape[-len(shape) :] != shape:
                wanted = ", ".join(map(str, shape))
                raise InvalidInputError(
                    f"screws.{name}: must have shape (..., {wanted}), not {array.shape}"
                )

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
        fields = (self.axes.shape[:-2], self.offsets.shape[:-2], self.R_WE.shape[:-2])
        return np.broadcast_shapes(*fields)

    def of(self, robot: int) -> Screws:
        """Return the arm of one of the robots along the only leading axis, or the shared arm.

        Raises:
            InvalidInputError: If there is no such robot.
        """
        if self.robots and not 0 <= robot < self.robots[0]:
            raise InvalidInputError(f"robot: may be 0 to {self.robots[0] - 1}, not {robot}")
        own: dict[str, Any] = {
            name: array[robot]
            for name, axes in _ARRAYS.items()
            if (array := self.__dict__[name]).ndim > axes
        }
        return replace(self, **own)

    @cached_property
    def _home(self) -> Home:
        """The same in frames whose z axes are those of the joints: to turn about z costs least."""
        links = []
        # The frame of the joint before, seen from W, where all joints are at zero.
        Q = np.eye(3)
        for i, (slides, column) in enumerate(zip(self.slides, self.columns, strict=True)):
            offset, frame = self.offsets[..., i, :], frame_about(self.axes[..., i, :])
            links.append(Link(_seen(Q, offset), _turn(Q, frame), slides, column))
            Q = frame
        offset = _seen(Q, self.offsets[..., -1, :])
        return Home(links, offset, _turn(Q, self.R_WE), self.n, self.robots)


def _seen(Q: AnyArray, offset: AnyArray) -> Triple:
    return constant(robots_last(times(Q.swapaxes(-1, -2), offset), 1))


def _turn(Q: AnyArray, frame: AnyArray) -> Matrix:
    return constant_matrix(robots_last(product(Q.swapaxes(-1, -2), frame), 2))


def side_by_side(arms: Sequence[Screws]) -> Screws:
    """Return the screws of robots of which each has its own arm, in this order.

    Arms may differ in whatever leaves the order of their joints: tools, frames, joints that are
    held elsewhere, dimensions.

    Args:
        arms: For each robot, the screws of its arm, without leading axes.

    Raises:
        InvalidInputError: If there are none, or they differ in number, kind or order of joints.
    """
    require_several("arms", arms)
    for number, arm in enumerate(arms):
        require_type(f"arms[{number}]", arm, Screws)
        if arm.robots:
            raise InvalidInputError(f"arms[{number}]: must be of one robot, not of {arm.robots}")
        if (arm.slides, arm.columns, arm.n) != (arms[0].slides, arms[0].columns, arms[0].n):
            raise InvalidInputError(
                f"arms[{number}]: must have the joints of arms[0], {_joints(arms[0])}, not "
                f"{_joints(arm)}"
            )
    if not len(arms):
        raise InvalidInputError("arms: must be given")
    together: dict[str, Any] = {
        name: np.stack([arm.__dict__[name] for arm in arms]) for name in _ARRAYS
    }
    return replace(arms[0], **together)


def _joints(arm: Screws) -> str:
    kinds = ("slides" if slides else "turns" for slides in arm.slides)
    moved = zip(arm.columns, kinds, strict=True)
    return f"{arm.n} ({', '.join(f'{column} {kind}' for column, kind in moved)})"
