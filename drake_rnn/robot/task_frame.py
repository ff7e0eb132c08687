"""The task frame E: its pose and how it moves, as objectives ask for it.

An arm with two tools has four frames: the first and the second tool, the second one as seen from
the first, and their centre. One of them is E.

Vectors are triples of components, and a Jacobian is a triple of its rows. All is written in
elementwise functions of NumPy or JAX; arrays have the leading axes of robots, if any.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from ..arrays.algebra import AnyArray, functions_of, root
from ..errors import InvalidInputError
from ..inputs.fields import Array
from .rotation import product

#: Three components, each of shape (...) or, of a Jacobian's columns, (..., n).
Three = tuple[Any, Any, Any]
# Least 1 + cosine of the angle of a chart, which is not defined at half a turn.
OPPOSITE = 1e-9
#: The frames of an arm with two tools: the tools, the second as seen from the first, their centre.
ToolFrame = Literal["first", "second", "relative", "centre"]


def components(vector: AnyArray) -> Three:
    """Return the components of vectors, shape (..., 3)."""
    return vector[..., 0], vector[..., 1], vector[..., 2]


def rows_of(J: AnyArray) -> Three:
    """Return the rows of Jacobians, shape (..., 3, n)."""
    return J[..., 0, :], J[..., 1, :], J[..., 2, :]


def numbers(vector: Array) -> Three:
    """Return a constant vector, shape (3,)."""
    x, y, z = vector.tolist()
    return x, y, z


def rotate(R: AnyArray, a: Three) -> Three:
    """Return R a."""
    first, second, third = (
        R[..., i, 0] * a[0] + R[..., i, 1] * a[1] + R[..., i, 2] * a[2] for i in range(3)
    )
    return first, second, third


def rotate_back(R: AnyArray, a: Three) -> Three:
    """Return R^T a; with rows of a Jacobian, those in E."""
    wide = np.ndim(a[0]) > np.ndim(R[..., 0, 0])

    def entry(i: int, k: int) -> Any:
        return R[..., i, k, None] if wide else R[..., i, k]

    first, second, third = (
        entry(0, k) * a[0] + entry(1, k) * a[1] + entry(2, k) * a[2] for k in range(3)
    )
    return first, second, third


def _times(J: Three, v: AnyArray) -> Three:
    first, second, third = ((row * v).sum(axis=-1) for row in J)
    return first, second, third


def widen(a: Three) -> Three:
    """Return a vector such that it acts on the rows of a Jacobian."""
    first, second, third = (each[..., None] for each in a)
    return first, second, third


def cross(a: Three, b: Three) -> Three:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def dot(a: Three, b: Three) -> Any:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def add(*parts: Three) -> Three:
    """Return the sum of vectors."""
    first, second, third = (sum(each[1:], each[0]) for each in zip(*parts, strict=True))
    return first, second, third


def subtract(a: Three, *parts: Three) -> Three:
    """Return a vector less the sum of others."""
    total = parts[0] if len(parts) == 1 else add(*parts)
    return a[0] - total[0], a[1] - total[1], a[2] - total[2]


def scale(gain: Any, a: Three) -> Three:
    """Return a multiple of a vector."""
    return gain * a[0], gain * a[1], gain * a[2]


def stack(values: Sequence[Any]) -> Array:
    """Return numbers as an array, along its last axis."""
    stacked: Array = functions_of(*values).stack(values, axis=-1)
    return stacked


def rodrigues(R: AnyArray, start: Array) -> Three:
    """Return tan(theta / 4) along the axis of the rotation from the start's orientation."""
    is_one = isinstance(start, np.ndarray) and start.ndim == 2
    each = [[start[..., i, k] for k in range(3)] for i in range(3)] if not is_one else []
    S = start.tolist() if is_one else each

    def entry(i: int, k: int) -> Any:
        return R[..., i, 0] * S[k][0] + R[..., i, 1] * S[k][1] + R[..., i, 2] * S[k][2]

    sine = (entry(2, 1) - entry(1, 2), entry(0, 2) - entry(2, 0), entry(1, 0) - entry(0, 1))
    trace = entry(0, 0) + entry(1, 1) + entry(2, 2)
    xp = functions_of(trace)
    half = 0.5 * root(xp.maximum(1.0 + trace, OPPOSITE))
    return scale(0.25 / (half * (1.0 + half)), sine)


def rodrigues_rate(sigma: Three, omega: Three) -> Three:
    """Return 4 times the derivative of the above, of angular velocities in W."""
    return add(
        scale(1.0 - dot(sigma, sigma), omega),
        scale(2.0, cross(omega, sigma)),
        scale(2.0 * dot(sigma, omega), sigma),
    )


def rodrigues_bend(sigma: Three, omega: Three, alpha: Three) -> Three:
    """Return 4 times the second derivative, of angular velocities and their derivatives."""
    rate = scale(0.25, rodrigues_rate(sigma, omega))
    return add(
        rodrigues_rate(sigma, alpha),
        scale(-2.0 * dot(sigma, rate), omega),
        scale(2.0, cross(omega, rate)),
        scale(2.0 * dot(rate, omega), sigma),
        scale(2.0 * dot(sigma, omega), rate),
    )


class Tools(NamedTuple):
    """The two tools of an arm, as kinematics have them.

    Attributes:
        first, second: Kinematics of both.
        task_frame: Which of the frames is E.
        R_21: Constant orientation of the first tool as seen from the second one, about which the
            centre is half way between both, shape (..., 3, 3).
    """

    first: Any
    second: Any
    task_frame: ToolFrame
    R_21: Array


class Rates(NamedTuple):
    """How E moves.

    Attributes:
        v, a: Its velocity and acceleration [m/s, m/s^2].
        omega, alpha: Its angular velocity and the derivative of that [rad/s, rad/s^2].
    """

    v: Three
    a: Three
    omega: Three
    alpha: Three


class Pose:
    """The pose of E in a posture, with what moves it, as objectives ask for it.

    Args:
        kinematics: Kinematics of one arm, or those of robots side by side at a posture.
        q: Joint positions, shape (..., n) [rad].
    """

    def __init__(self, kinematics: Any, q: Array) -> None:
        self._kinematics, self._q = kinematics, q

    @cached_property
    def p(self) -> Three:
        """Position of E [m]."""
        return components(self._kinematics.p_WE(self._q))

    @cached_property
    def R(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        return self._kinematics.R_WE(self._q)

    @property
    def p_WE(self) -> AnyArray:
        """Position of E as an array, shape (..., 3) [m]."""
        return stack(self.p)

    @cached_property
    def J(self) -> Three:
        """Rows of the Jacobian of the position, each of shape (..., n) [m]."""
        return rows_of(self._kinematics.J(self._q))

    @cached_property
    def J_omega(self) -> Three:
        """Rows of the Jacobian of the angular velocity, likewise."""
        return rows_of(self._kinematics.J_omega(self._q))

    def axis(self, axis: Array) -> Three:
        """Return an axis of E in W.

        Args:
            axis: The axis in E, shape (3,).
        """
        return rotate(self.R, numbers(axis))

    def rates(self, v: AnyArray) -> Rates:
        """Return how E moves at constant joint velocities, shape (..., n) [rad/s]."""
        omega = _times(self.J_omega, v)
        # Joints that turn carry the axes of those after them.
        xp = functions_of(v)
        x, y, z = (row * v for row in self.J_omega)
        before = tuple(xp.cumsum(each, axis=-1) - each for each in (x, y, z))
        first, second, third = (each.sum(axis=-1) for each in cross(before, (x, y, z)))
        alpha = first, second, third
        return Rates(
            _times(self.J, v),
            components(self._kinematics.Jdot_v(self._q, v)),
            omega,
            alpha,
        )


def pose_of(kinematics: Any, q: Array, frame: ToolFrame | None = None) -> Pose:
    """Return the pose of E, or of another frame of an arm with two tools.

    Args:
        kinematics: Kinematics, as for `Pose`; their ``tools`` are `Tools`, or None.
        q: Joint positions, shape (..., n) [rad].
        frame: The frame; None for E.
    """
    tools: Tools | None = kinematics.tools
    if tools is None:
        if frame is not None:
            raise InvalidInputError(
                f"task: of: {frame} is a frame of an arm with two tools, arm.pair"
            )
        return Pose(kinematics, q)
    frame = frame or tools.task_frame
    first, second = Pose(tools.first, q), Pose(tools.second, q)
    if frame == "centre":
        return _Centre(first, second, tools.R_21)
    if frame == "relative":
        return _Relative(first, second)
    return first if frame == "first" else second


class _Relative(Pose):
    """The pose of the second tool as seen from the first one.

    Args:
        first, second: The poses of both.
    """

    def __init__(self, first: Pose, second: Pose) -> None:
        self._first, self._second = first, second

    @cached_property
    def _way(self) -> Three:
        return subtract(self._second.p, self._first.p)

    @cached_property
    def p(self) -> Three:
        return rotate_back(self._first.R, self._way)

    @cached_property
    def R(self) -> AnyArray:
        return product(self._first.R.swapaxes(-1, -2), self._second.R)

    @cached_property
    def J(self) -> Three:
        first, second = self._first, self._second
        carried = cross(first.J_omega, widen(self._way))
        return rotate_back(first.R, subtract(second.J, first.J, carried))

    @cached_property
    def J_omega(self) -> Three:
        return rotate_back(self._first.R, subtract(self._second.J_omega, self._first.J_omega))

    def rates(self, v: AnyArray) -> Rates:
        R, one, two, way = self._first.R, self._first.rates(v), self._second.rates(v), self._way
        # Both are seen from what turns.
        passing = subtract(two.v, one.v)
        carried = cross(one.omega, way)
        a = subtract(
            two.a,
            one.a,
            cross(one.alpha, way),
            scale(2.0, cross(one.omega, passing)),
            scale(-1.0, cross(one.omega, carried)),
        )
        alpha = subtract(two.alpha, one.alpha, cross(one.omega, two.omega))
        omega = subtract(two.omega, one.omega)
        v_seen = subtract(passing, carried)
        return Rates(*(rotate_back(R, each) for each in (v_seen, a, omega, alpha)))


class _Centre(Pose):
    """The pose half way between two tools.

    With tau, tan(theta / 4) along the axis of the rotation from one to the other, its angular
    velocity is (omega_1 + omega_2 + (omega_2 - omega_1) x tau) / 2: its quaternion is the mean.

    Args:
        first, second: The poses of both.
        R_21: Orientation of the first as seen from the second, about which it is half way.
    """

    def __init__(self, first: Pose, second: Pose, R_21: Array) -> None:
        self._first, self._second, self._R_21 = first, second, R_21

    @cached_property
    def _turned(self) -> AnyArray:
        """Orientation of the second tool, turned so as to be that of the first one."""
        return product(self._second.R, self._R_21)

    @cached_property
    def _tau(self) -> Three:
        return rodrigues(self._turned, self._first.R)

    def _between(self, one: Three, two: Three) -> Three:
        """Return the angular velocity, or rows that are such, of those of both."""
        tau = widen(self._tau) if np.ndim(one[0]) > np.ndim(self._tau[0]) else self._tau
        return scale(0.5, add(one, two, cross(subtract(two, one), tau)))

    @cached_property
    def p(self) -> Three:
        return scale(0.5, add(self._first.p, self._second.p))

    @cached_property
    def R(self) -> AnyArray:
        R, tau = self._first.R, self._tau
        gain = 2.0 / (1.0 + dot(tau, tau))
        columns = []
        for k in range(3):
            column = components(R[..., :, k])
            across = cross(tau, column)
            moved = scale(gain, add(across, cross(tau, across)))
            columns.append(stack(add(column, moved)))
        return functions_of(*columns).stack(columns, axis=-1)

    @cached_property
    def J(self) -> Three:
        return scale(0.5, add(self._first.J, self._second.J))

    @cached_property
    def J_omega(self) -> Three:
        return self._between(self._first.J_omega, self._second.J_omega)

    def rates(self, v: AnyArray) -> Rates:
        one, two = self._first.rates(v), self._second.rates(v)
        carried = rotate(self._turned, rotate_back(self._first.R, one.omega))
        turning = scale(0.25, rodrigues_rate(self._tau, subtract(two.omega, carried)))
        bent = scale(0.5, cross(subtract(two.omega, one.omega), turning))
        return Rates(
            scale(0.5, add(one.v, two.v)),
            scale(0.5, add(one.a, two.a)),
            self._between(one.omega, two.omega),
            add(self._between(one.alpha, two.alpha), bent),
        )


class Place(NamedTuple):
    """The pose of a frame at the start, where it is held.

    Attributes:
        p: Its position, shape (3,) [m].
        R: Its orientation, shape (3, 3).
    """

    p: Array
    R: Array

    def along(self, path: Any) -> _StillPose:
        """Return what is held as a path, beside one that is followed."""
        return _StillPose(self, path)


class _StillPose:
    """A pose that stays where it is, as a path; see `drake_rnn.signals.PathMotion`."""

    def __init__(self, place: Place, path: Any) -> None:
        self._place, self._path = place, path

    def position(self, t: Any) -> tuple[Any, Any, Any]:
        still = 0.0 * self._path.position(t)[0]
        return still + self._place.p, still, still

    def orientation(self, t: Any) -> tuple[Any, Any, Any]:
        still = 0.0 * self._path.position(t)[0]
        return still[..., None] + self._place.R, still, still
