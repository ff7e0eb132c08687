"""Pose and Jacobians of an arm whose joints have moved, in arrays of NumPy or of JAX.

Inside, robots are last, see `drake_rnn.arrays.namespace.robots_last`, and vectors are in
coordinates, see `drake_rnn.robot.triples`. All is written in elementwise operations: a matrix
product over robots would add up in an order that depends on their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays.namespace import AnyArray, namespace, robots_first, robots_last
from ..errors import InvalidInputError
from .triples import (
    IDENTITY,
    ZERO,
    Matrix,
    Triple,
    added,
    cross,
    dot,
    is_full,
    matrix,
    product,
    scaled,
    subtracted,
)


class Link(NamedTuple):
    """A joint and what leads to it: constants in the frame of the joint before, or in W.

    A joint's frame moves with it; its z axis is that of the joint.

    Attributes:
        offset: To the origin of the joint's frame [m].
        turn: Orientation of the joint's frame where the joint is at zero.
        slides: Whether it is prismatic.
        column: Entry of the joint positions that moves it.
    """

    offset: Triple
    turn: Matrix
    slides: bool
    column: int


class Home(NamedTuple):
    """An arm: its joints and its task frame E.

    Attributes:
        links: The joints, from the base on.
        offset: From the origin of the last joint's frame to that of E, in that frame [m].
        turn: Orientation of E in that frame.
        n: Number of joint positions.
        robots: Shape of the axes of robots.
    """

    links: Sequence[Link]
    offset: Triple
    turn: Matrix
    n: int
    robots: tuple[int, ...]


class _Chain(NamedTuple):
    """The moved axes, a point on each, the last joint's orientation, and the origin of E."""

    axes: list[Triple]
    points: list[Triple]
    R: Matrix
    end: Triple


class MovedScrews:
    """Pose and Jacobians of an arm's task frame E at joint positions, computed when asked for.

    W is the world frame. Made by `drake_rnn.robot.screws.Screws.at`, which says how arrays lie.

    Args:
        home: The arm.
        q: Joint positions, shape (..., n) [rad, or m of a joint that slides].

    Raises:
        InvalidInputError: If ``q`` is no array of float64 of that shape.
    """

    def __init__(self, home: Home, q: AnyArray) -> None:
        self._home = home
        self._xp = namespace("position", q)
        self._q = self._of_joints("position", q)
        self._robots: tuple[int, ...] = self._q.shape[1:]

    @cached_property
    def p_WE(self) -> AnyArray:
        """Position of E's origin, shape (..., 3) [m]."""
        return self._array((self._chain.end,))[..., 0]

    @cached_property
    def R_WE(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        R = self._chain.R
        return self._array([product(R, column) for column in self._home.turn])

    @cached_property
    def J(self) -> AnyArray:
        """Jacobian of E's origin, shape (..., 3, n) [m, or 1 of a joint that slides]."""
        return self._array(self._of_every_joint(self._J_columns))

    @cached_property
    def J_omega(self) -> AnyArray:
        """Jacobian of E's angular velocity, shape (..., 3, n)."""
        return self._array(self._of_every_joint(self._J_omega_columns))

    def Jdot_v(self, v: AnyArray) -> AnyArray:
        """Return the part of E's acceleration not due to joint accelerations, (..., 3) [m/s^2].

        Args:
            v: Joint velocities, shape (..., n) [rad/s, or m/s], for each of the robots.

        Raises:
            InvalidInputError: If ``v`` is no array of float64 of that shape.
        """
        namespace("velocity", v)
        rates = self._of_joints("velocity", v)
        if rates.shape[1:] != self._robots:
            raise InvalidInputError(
                f"velocity: must be given for each posture, {(*self._robots, self._home.n)}, not "
                f"{tuple(v.shape)}"
            )
        # Column i of J changes with joint k by the cross product of column k of J_omega with it,
        # for k up to i, and as much as column k with joint i.
        bias, twice_before = ZERO, ZERO
        for link, turning, column in zip(
            self._home.links, self._J_omega_columns, self._J_columns, strict=True
        ):
            rate = rates[link.column]
            spin = scaled(rate, turning)
            bias = added(bias, cross(added(twice_before, spin), scaled(rate, column)))
            twice_before = added(twice_before, scaled(2.0, spin))
        return self._array((bias,))[..., 0]

    @cached_property
    def _chain(self) -> _Chain:
        sines, cosines = self._xp.sin(self._q), self._xp.cos(self._q)
        R, end = IDENTITY, ZERO
        axes, points = [], []
        for link in self._home.links:
            step, R = self._next(R, link, sines[link.column], cosines[link.column])
            end = added(end, step)
            points.append(end)
            axes.append(R[2])
            if link.slides:
                end = added(end, scaled(self._q[link.column], R[2]))
        return _Chain(axes, points, R, added(end, product(R, self._home.offset)))

    def _next(
        self, R: Matrix, link: Link, sine: AnyArray, cosine: AnyArray
    ) -> tuple[Triple, Matrix]:
        """Return the way from a joint to the next one, and that one's frame, as seen from W."""
        if self._xp is not np and R is not IDENTITY and is_full(link.turn):
            # As one product of matrices, so that it is computed once.
            turn = link.turn if link.slides else _spun(link.turn, sine, cosine)
            step, x, y, z = dot(self._xp, R, (link.offset, *turn), self._robots)
            return step, (x, y, z)
        x, y, z = link.turn
        frame = product(R, x), product(R, y), product(R, z)
        return product(R, link.offset), frame if link.slides else _spun(frame, sine, cosine)

    @cached_property
    def _J_columns(self) -> list[Triple]:
        """Columns of J for the joints between base and E."""
        chain = self._chain
        return [
            axis if link.slides else cross(axis, subtracted(chain.end, point))
            for link, axis, point in zip(self._home.links, chain.axes, chain.points, strict=True)
        ]

    @property
    def _J_omega_columns(self) -> list[Triple]:
        """Columns of J_omega for the joints between base and E."""
        links, axes = self._home.links, self._chain.axes
        return [ZERO if link.slides else axis for link, axis in zip(links, axes, strict=True)]

    def _of_every_joint(self, columns: Sequence[Triple]) -> Sequence[Triple]:
        """Return columns for all joint positions from those of the joints between base and E."""
        every = [ZERO] * self._home.n
        for link, column in zip(self._home.links, columns, strict=True):
            every[link.column] = column
        return every

    def _of_joints(self, name: str, values: AnyArray) -> AnyArray:
        """Return values of all joints with robots last, shape (n, ...)."""
        n, robots = self._home.n, self._home.robots
        if values.ndim == 0 or values.shape[-1] != n:
            raise InvalidInputError(
                f"{name}: must have shape (..., {n}), not {tuple(values.shape)}"
            )
        if robots:
            values = self._xp.broadcast_to(values, (*self._all_robots(name, values), n))
        return robots_last(values, 1)

    def _all_robots(self, name: str, values: AnyArray) -> tuple[int, ...]:
        lead, robots = values.shape[:-1], self._home.robots
        try:
            return np.broadcast_shapes(lead, robots)
        except ValueError:
            raise InvalidInputError(
                f"{name}: is for robots of shape {tuple(lead)}, but the arms are of {robots}"
            ) from None

    def _array(self, columns: Sequence[Triple]) -> AnyArray:
        """Return a matrix of these columns, shape (..., 3, k)."""
        rows = list(zip(*columns, strict=True))
        return robots_first(matrix(self._xp, rows, self._robots), 2)


def _spun(turn: Matrix, sine: AnyArray, cosine: AnyArray) -> Matrix:
    """Return an orientation after a turn about its own z axis."""
    x, y, z = turn
    return (
        added(scaled(cosine, x), scaled(sine, y)),
        subtracted(scaled(cosine, y), scaled(sine, x)),
        z,
    )
