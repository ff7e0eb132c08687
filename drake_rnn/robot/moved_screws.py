"""Pose and Jacobians of an arm whose joints have moved, in arrays of NumPy or of JAX.

Inside, a vector is an array of shape (3, ...) and robots are last, see
`drake_rnn.arrays.namespace.robots_last`. All is written in elementwise operations: a matrix product
over robots would add up in an order that depends on their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from ..arrays.namespace import AnyArray, namespace, robots_first, robots_last
from ..errors import InvalidInputError

#: The three coordinates of a constant vector: numbers, or arrays with an entry for each robot.
Weights = tuple[Any, Any, Any]


def weights(vector: AnyArray) -> Weights:
    """Return the coordinates of a constant vector, shape (3, ...).

    What is the same for all robots becomes a number. Most coordinates of an axis or an offset are
    0 or 1, and those need no arithmetic; the sums keep their bits without it.
    """
    x, y, z = (_alike(coordinate) for coordinate in vector)
    return x, y, z


def _alike(coordinate: AnyArray) -> Any:
    if isinstance(coordinate, (float, np.ndarray)):
        first = np.ravel(coordinate)[:1]
        if np.all(coordinate == first):
            return float(first[0])
    return coordinate


class Link(NamedTuple):
    """A joint and what leads to it, where all joints are at zero, in W.

    Attributes:
        offset: From a point on the axis before, or W's origin, to one on this axis [m].
        axis: Direction of the axis.
        slides: Whether it is prismatic.
        column: Entry of the joint positions that moves it.
    """

    offset: Weights
    axis: Weights
    slides: bool
    column: int


class Home(NamedTuple):
    """An arm where all joints are at zero.

    Attributes:
        links: Its joints, from the base on.
        offset: From a point of the last axis to E's origin [m].
        R_WE: Columns of E's orientation.
        n: Number of joint positions.
        robots: Shape of the axes of robots, which arrays in the weights broadcast to.
    """

    links: Sequence[Link]
    offset: Weights
    R_WE: tuple[Weights, Weights, Weights]
    n: int
    robots: tuple[int, ...]


class _Chain(NamedTuple):
    """What follows from the positions of the joints; the moved links' columns are those of R."""

    axes: list[AnyArray]
    points: list[AnyArray]
    columns: list[AnyArray]
    end: AnyArray


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

    def _of_joints(self, name: str, values: AnyArray) -> AnyArray:
        """Return values of all joints with robots last, shape (n, ...)."""
        n, robots = self._home.n, self._home.robots
        if values.ndim == 0 or values.shape[-1] != n:
            raise InvalidInputError(
                f"{name}: must have shape (..., {n}), not {tuple(values.shape)}"
            )
        if robots:
            lead = np.broadcast_shapes(values.shape[:-1], robots)
            if lead != values.shape[:-1]:
                values = self._xp.broadcast_to(values, (*lead, n))
        return robots_last(values, 1)

    @cached_property
    def p_WE(self) -> AnyArray:
        """Position of E's origin, shape (..., 3) [m]."""
        return robots_first(self._chain.end, 1)

    @cached_property
    def R_WE(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        columns = [_mix(self._chain.columns, column) for column in self._home.R_WE]
        return robots_first(self._xp.stack(columns, axis=1), 2)

    @cached_property
    def J(self) -> AnyArray:
        """Jacobian of E's origin, shape (..., 3, n) [m, or 1 of a joint that slides]."""
        return self._matrix(self._J_columns)

    @cached_property
    def J_omega(self) -> AnyArray:
        """Jacobian of E's angular velocity, shape (..., 3, n)."""
        links, axes = self._home.links, self._chain.axes
        turning = [
            None if link.slides else axis for link, axis in zip(links, axes, strict=True)
        ]
        return self._matrix(turning)

    def Jdot_v(self, v: AnyArray) -> AnyArray:
        """Return the part of E's acceleration not due to joint accelerations, (..., 3) [m/s^2].

        The derivative of column i of J with respect to joint k is the k-th column of J_omega times
        the i-th of J (cross product), for k up to i; it is symmetric in i and k.

        Args:
            v: Joint velocities, shape (..., n) [rad/s, or m/s].
        """
        namespace("velocity", v)
        rates = self._of_joints("velocity", v)
        twice_before: AnyArray = None
        terms = []
        for link, axis, column in zip(
            self._home.links, self._chain.axes, self._J_columns, strict=True
        ):
            rate = rates[link.column]
            moved = rate * column
            omega = twice_before
            if not link.slides:
                turned = rate * axis
                omega = turned if omega is None else omega + turned
                twice_before = turned * 2.0 if twice_before is None else twice_before + turned * 2.0
            if omega is not None:
                terms.append(self._cross(omega, moved))
        return robots_first(_total(terms) if terms else self._zeros((3,)), 1)

    @cached_property
    def _chain(self) -> _Chain:
        xp = self._xp
        sines, cosines = xp.sin(self._q), xp.cos(self._q)
        columns = self._identity()
        end = self._zeros((3,))
        axes, points = [], []
        for link in self._home.links:
            end = _plus(end, _mix(columns, link.offset))
            axis = _mix(columns, link.axis)
            axes.append(axis)
            points.append(end)
            if link.slides:
                end = end + self._q[link.column] * axis
            else:
                R = _rotation(link.axis, sines[link.column], cosines[link.column])
                columns = [_mix(columns, column) for column in R]
        return _Chain(axes, points, columns, _plus(end, _mix(columns, self._home.offset)))

    @cached_property
    def _J_columns(self) -> list[AnyArray]:
        """Columns of J for the joints between base and E."""
        chain = self._chain
        return [
            axis if link.slides else self._cross(axis, chain.end - point)
            for link, axis, point in zip(self._home.links, chain.axes, chain.points, strict=True)
        ]

    def _matrix(self, columns: Sequence[AnyArray]) -> AnyArray:
        """Return a matrix for all joint positions from the columns of those that move E."""
        every: list[AnyArray] = [None] * self._home.n
        for link, column in zip(self._home.links, columns, strict=True):
            every[link.column] = column
        still = self._zeros((3,)) if any(column is None for column in every) else None
        filled = [still if column is None else column for column in every]
        return robots_first(self._xp.stack(filled, axis=1), 2)

    def _zeros(self, shape: tuple[int, ...]) -> AnyArray:
        return self._xp.zeros((*shape, *self._robots))

    def _identity(self) -> list[AnyArray]:
        identity = np.eye(3).reshape(3, 3, *(1 for _ in self._robots))
        return [self._xp.broadcast_to(column, (3, *self._robots)) for column in identity]

    def _cross(self, a: AnyArray, b: AnyArray) -> AnyArray:
        return self._xp.stack(
            (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
        )


def _rotation(axis: Weights, sine: AnyArray, cosine: AnyArray) -> list[Weights]:
    """Return the columns of the rotation about a unit axis (O. Rodrigues)."""
    versine = 1.0 - cosine
    x, y, z = axis
    diagonal = [_plus(1.0, _times(-(b * b + c * c), versine)) for b, c in ((y, z), (x, z), (x, y))]

    def beside(a: Any, b: Any, c: Any) -> AnyArray:
        return _plus(_times(a * b, versine), _times(c, sine))

    return [
        (diagonal[0], beside(x, y, z), beside(x, z, -y)),
        (beside(x, y, -z), diagonal[1], beside(y, z, x)),
        (beside(x, z, y), beside(y, z, -x), diagonal[2]),
    ]


def _mix(columns: Sequence[AnyArray], coordinates: Weights) -> AnyArray:
    """Return the sum of columns, each times its coordinate, or 0.0."""
    products = [_times(weight, c) for weight, c in zip(coordinates, columns, strict=True)]
    return reduce(_plus, products)


def _times(weight: Any, array: AnyArray) -> AnyArray:
    if isinstance(weight, float):
        if weight == 0.0:
            return 0.0
        if weight == 1.0:
            return array
        if weight == -1.0:
            return -array
    return weight * array


def _plus(a: AnyArray, b: AnyArray) -> AnyArray:
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def _total(terms: Sequence[AnyArray]) -> AnyArray:
    return reduce(add, terms)
