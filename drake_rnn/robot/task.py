r"""The task of an end effector: axes of its position, its pose, or a list of objectives.

An objective says one thing about the pose of the task frame E: its position along axes of the
world, its orientation, where one axis of it points, or which point that axis looks at. It is an
object with all that others ask of it: its coordinates, their Jacobian and their derivatives, what
they should be along the path, its errors, and what a playback draws of it.

The coordinates are functions of the joint positions alone. So a law that takes a Jacobian and an
error of any size, or learns that Jacobian, takes those of a list as it takes a position. They are
positions [m], and for what turns charts of the angle [rad], which small errors do not tell from it:

=============  ====================================================================================
objective      coordinates
=============  ====================================================================================
position       p_WE along its axes
orientation    4 tan(theta / 4) along the axis of the rotation from the start's orientation
axis           with a the axis in W, d where it points at first, s = 1 + a . d, and B two axes
               normal to d: 2 B^T a / s, of the length 2 tan(theta / 2)
look           the same in E, with a the direction of the point, and d the axis
axis, look     with ``within``: a . d / sin(within), of which a bound holds
remote_centre  B^T x, with x from where its point is at first to where the shaft crosses a plane
               through it, and B two axes of that plane; with ``within``: |x|^2 / (2 within)
=============  ====================================================================================

An objective with a bound in place of a value has one row, and a law lets it alone but at its bound.

An arm with two tools has four frames: the first and the second tool, the second one as seen from
the first, and their centre. One of them is E; an objective may be about another one, ``of``, and
then it is to stay as it is at the start.

Arrays have the leading axes of robots, if any; all is written in elementwise functions of NumPy or
JAX.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import cos, pi, sin
from operator import is_not
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ..arrays.algebra import AnyArray, functions_of, root
from ..errors import InvalidInputError
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array, Finite, Point, Positive, Weight, between, validated
from ..inputs.keys import Meaning
from ..inputs.kinds import Kinds, Modules
from ..inputs.messages import fields_of, plain, short
from .rotation import angle_between, frame_about, product

#: Three components, each of shape (...) or, of a Jacobian's columns, (..., n).
Three = tuple[Any, Any, Any]
# Least 1 + cosine of the angle of a chart, which is not defined at half a turn.
_OPPOSITE = 1e-9
# Least distance from which a direction to a point is computed [m].
_NEAR = 1e-6
# Least cosine of the tilt of a shaft from the normal of its plane at the start, 78 degrees.
_ALONG_SHAFT = 0.2
_LETTERS = "xyz"


class RowBlock(NamedTuple):
    """What a law knows of the rows of an objective.

    Attributes:
        size: Number of rows.
        turns: Whether they are angles [rad], and not positions [m].
        weight: Price of its error, as a multiple of that of the others.
        lower, upper: Bounds of the one row of a range; None where it has none.
    """

    size: int
    turns: bool
    weight: float
    lower: float | None = None
    upper: float | None = None

    @property
    def is_range(self) -> bool:
        """Whether it has bounds in place of a value."""
        return self.lower is not None or self.upper is not None


#: The frames of an arm with two tools: the tools, the second as seen from the first, their centre.
ToolFrame = Literal["first", "second", "relative", "centre"]


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
        return _components(self._kinematics.p_WE(self._q))

    @cached_property
    def R(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        return self._kinematics.R_WE(self._q)

    @property
    def p_WE(self) -> AnyArray:
        """Position of E as an array, shape (..., 3) [m]."""
        return _stack(self.p)

    @cached_property
    def J(self) -> Three:
        """Rows of the Jacobian of the position, each of shape (..., n) [m]."""
        return _rows(self._kinematics.J(self._q))

    @cached_property
    def J_omega(self) -> Three:
        """Rows of the Jacobian of the angular velocity, likewise."""
        return _rows(self._kinematics.J_omega(self._q))

    def axis(self, axis: Array) -> Three:
        """Return an axis of E in W.

        Args:
            axis: The axis in E, shape (3,).
        """
        return _rotated(self.R, axis)

    def rates(self, v: AnyArray) -> Rates:
        """Return how E moves at constant joint velocities, shape (..., n) [rad/s]."""
        omega = _times(self.J_omega, v)
        # Joints that turn carry the axes of those after them.
        xp = functions_of(v)
        x, y, z = (row * v for row in self.J_omega)
        before = tuple(xp.cumsum(each, axis=-1) - each for each in (x, y, z))
        first, second, third = (each.sum(axis=-1) for each in _cross(before, (x, y, z)))
        alpha = first, second, third
        return Rates(
            _times(self.J, v),
            _components(self._kinematics.Jdot_v(self._q, v)),
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
        return _minus(self._second.p, self._first.p)

    @cached_property
    def p(self) -> Three:
        return _into(self._first.R, self._way)

    @cached_property
    def R(self) -> AnyArray:
        return product(self._first.R.swapaxes(-1, -2), self._second.R)

    @cached_property
    def J(self) -> Three:
        first, second = self._first, self._second
        carried = _cross(first.J_omega, _wide(self._way))
        return _into(first.R, _minus(second.J, first.J, carried))

    @cached_property
    def J_omega(self) -> Three:
        return _into(self._first.R, _minus(self._second.J_omega, self._first.J_omega))

    def rates(self, v: AnyArray) -> Rates:
        R, one, two, way = self._first.R, self._first.rates(v), self._second.rates(v), self._way
        # Both are seen from what turns.
        passing = _minus(two.v, one.v)
        carried = _cross(one.omega, way)
        a = _minus(
            two.a,
            one.a,
            _cross(one.alpha, way),
            _scaled(2.0, _cross(one.omega, passing)),
            _scaled(-1.0, _cross(one.omega, carried)),
        )
        alpha = _minus(two.alpha, one.alpha, _cross(one.omega, two.omega))
        omega = _minus(two.omega, one.omega)
        v_seen = _minus(passing, carried)
        return Rates(*(_into(R, each) for each in (v_seen, a, omega, alpha)))


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
        return _rodrigues(self._turned, self._first.R)

    def _between(self, one: Three, two: Three) -> Three:
        """Return the angular velocity, or rows that are such, of those of both."""
        tau = _wide(self._tau) if np.ndim(one[0]) > np.ndim(self._tau[0]) else self._tau
        return _scaled(0.5, _sum(one, two, _cross(_minus(two, one), tau)))

    @cached_property
    def p(self) -> Three:
        return _scaled(0.5, _sum(self._first.p, self._second.p))

    @cached_property
    def R(self) -> AnyArray:
        R, tau = self._first.R, self._tau
        gain = 2.0 / (1.0 + _dot(tau, tau))
        columns = []
        for k in range(3):
            column = _components(R[..., :, k])
            across = _cross(tau, column)
            moved = _scaled(gain, _sum(across, _cross(tau, across)))
            columns.append(_stack(_sum(column, moved)))
        return functions_of(*columns).stack(columns, axis=-1)

    @cached_property
    def J(self) -> Three:
        return _scaled(0.5, _sum(self._first.J, self._second.J))

    @cached_property
    def J_omega(self) -> Three:
        return self._between(self._first.J_omega, self._second.J_omega)

    def rates(self, v: AnyArray) -> Rates:
        one, two = self._first.rates(v), self._second.rates(v)
        carried = _out_of(self._turned, _into(self._first.R, one.omega))
        turning = _scaled(0.25, _rodrigues_rate(self._tau, _minus(two.omega, carried)))
        bent = _scaled(0.5, _cross(_minus(two.omega, one.omega), turning))
        return Rates(
            _scaled(0.5, _sum(one.v, two.v)),
            _scaled(0.5, _sum(one.a, two.a)),
            self._between(one.omega, two.omega),
            _sum(self._between(one.alpha, two.alpha), bent),
        )


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


def _components(vector: AnyArray) -> Three:
    return vector[..., 0], vector[..., 1], vector[..., 2]


def _rows(J: AnyArray) -> Three:
    return J[..., 0, :], J[..., 1, :], J[..., 2, :]


def _rotated(R: AnyArray, axis: Sequence[float] | Array) -> Three:
    x, y, z = (float(each) for each in axis)
    first, second, third = (
        R[..., i, 0] * x + R[..., i, 1] * y + R[..., i, 2] * z for i in range(3)
    )
    return first, second, third


def _out_of(R: AnyArray, a: Three) -> Three:
    """Return R a."""
    first, second, third = (
        R[..., i, 0] * a[0] + R[..., i, 1] * a[1] + R[..., i, 2] * a[2] for i in range(3)
    )
    return first, second, third


def _into(R: AnyArray, a: Three) -> Three:
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


def _wide(a: Three) -> Three:
    first, second, third = (each[..., None] for each in a)
    return first, second, third


def _cross(a: Three, b: Three) -> Three:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _dot(a: Three, b: Three) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _sum(*parts: Three) -> Three:
    first, second, third = (sum(each[1:], each[0]) for each in zip(*parts, strict=True))
    return first, second, third


def _minus(a: Three, *parts: Three) -> Three:
    total = parts[0] if len(parts) == 1 else _sum(*parts)
    return a[0] - total[0], a[1] - total[1], a[2] - total[2]


def _scaled(gain: Any, a: Three) -> Three:
    return gain * a[0], gain * a[1], gain * a[2]


@dataclass(frozen=True)
class _Chart:
    """Two coordinates of unit vectors about an aim, of the length 2 tan(theta / 2).

    Attributes:
        aim: The aim, a unit vector.
        sides: Two unit vectors normal to it and to each other.
    """

    aim: tuple[float, ...]
    sides: tuple[tuple[float, ...], ...]

    @staticmethod
    @lru_cache(maxsize=64)
    def about(aim: tuple[float, ...]) -> _Chart:
        """Return the chart about a unit vector, three numbers."""
        frame = frame_about(np.array(aim))
        sides = tuple(tuple(frame[:, k].tolist()) for k in (0, 1))
        return _Chart(aim, sides)

    def _scale(self, a: Three) -> Any:
        cosine = _dot(self.aim, a)  # type: ignore[arg-type]
        return functions_of(cosine).maximum(1.0 + cosine, _OPPOSITE)

    def coordinates(self, a: Three) -> list[Any]:
        """Return both coordinates."""
        s = self._scale(a)
        return [2.0 * _dot(side, a) / s for side in self.sides]  # type: ignore[arg-type]

    def rows(self, a: Three, J: Three) -> list[Any]:
        """Return the rows of their Jacobian, of that of the vector."""
        s = self._scale(a)[..., None]
        along = _dot(self.aim, J)  # type: ignore[arg-type]
        rows = []
        for side in self.sides:
            y = _dot(side, a)[..., None] / s  # type: ignore[arg-type]
            rows.append(2.0 * (_dot(side, J) - y * along) / s)  # type: ignore[arg-type]
        return rows

    def second(self, a: Three, first: Three, second: Three) -> tuple[list[Any], list[Any]]:
        """Return their first and second derivatives, of those of the vector."""
        s = self._scale(a)
        rate, bend = (_dot(self.aim, each) for each in (first, second))  # type: ignore[arg-type]
        speeds, accelerations = [], []
        for side in self.sides:
            y = _dot(side, a) / s  # type: ignore[arg-type]
            y_dot = (_dot(side, first) - y * rate) / s  # type: ignore[arg-type]
            bent = _dot(side, second) - y * bend - 2.0 * y_dot * rate  # type: ignore[arg-type]
            speeds.append(2.0 * y_dot)
            accelerations.append(2.0 * bent / s)
        return speeds, accelerations


class Port(NamedTuple):
    """A port through which the tool's shaft passes, as a playback draws it.

    Attributes:
        normal: Normal of its plane in W, shape (3,).
        radius: Radius of its hole [m]; 0 for a point.
        way: Returns how far it has moved at times, shape (k,) [s]: shape (k, 3) [m].
    """

    normal: Array
    radius: float
    way: Callable[[Array], Array]


class Drawing(NamedTuple):
    """What a playback draws of an objective.

    Attributes:
        axis: Axis of E that it is about, shape (3,); None without one.
        aim: Unit vector in W where that axis should point, shape (3,); None if it moves, or for a
            point.
        point: A fixed point in W, shape (3,) [m]; None without one.
        angle: Half of the opening of a cone round the aim [rad]; 0 without one.
        plane: An axis of W with a lower and an upper bound [m], each None without one; None
            without any.
        port: A port at that point, through which the axis passes; None without one.
    """

    axis: Array | None = None
    aim: Array | None = None
    point: Array | None = None
    angle: float = 0.0
    plane: tuple[int, float | None, float | None] | None = None
    port: Port | None = None


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


class TaskObjective(ABC):
    """Something that is asked of the pose of E.

    One of a user's own extends this class and is decorated with `validated`, which makes its fields
    the keys of an entry of ``task``; one of them must be ``weight``.
    """

    weight: float

    #: Frame that it is about, of an arm with two tools, which stays as it is at the start; None for
    #: E.
    of: ToolFrame | None = None
    #: Axes of the position that follow the path.
    path_axes: tuple[int, ...] = ()
    #: Whether the whole orientation follows that of the path.
    with_orientation = False
    #: Whether it follows a path that turns.
    sees_turning = False
    #: Whether its rows are angles.
    turns = True

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of its rows."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What it is, for a legend."""

    @property
    def bounds(self) -> tuple[float | None, float | None] | None:
        """Lower and upper bound of its one row in place of a value; None for a value."""
        return None

    @property
    def block(self) -> RowBlock:
        """What a law knows of its rows."""
        lower, upper = self.bounds or (None, None)
        return RowBlock(self.size, self.turns, self.weight, lower, upper)

    def at(self, key: str, R_WE: Array, p_WE: Array | None) -> TaskObjective:
        """Return the same of an arm that starts with a pose of E; by default itself.

        Args:
            key: Its place in the document, for messages.
            R_WE: Orientation of E at the start, shape (3, 3).
            p_WE: Its position, shape (3,) [m]; None if it is not known.
        """
        return self

    @abstractmethod
    def coordinates(self, pose: Pose, start: Array) -> list[Any]:
        """Return its coordinates, each of shape (...) [m or rad].

        Args:
            pose: The pose of E.
            start: Orientation of E at the start, shape (3, 3).
        """

    @abstractmethod
    def rows(self, pose: Pose, start: Array) -> list[Any]:
        """Return the rows of their Jacobian, each of shape (..., n), likewise."""

    @abstractmethod
    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        """Return their accelerations at constant joint velocities, shape (..., n), likewise."""

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        """Return what they should be along a path, with two derivatives; by default all are 0.

        Args:
            path: The path, see `drake_rnn.signals.PathMotion`; its ``time`` is that of which ``t``
                tells.
            t: The time [s], or what stands for it.
            start: Orientation of E at the start, shape (3, 3).
        """
        zero = [0.0 * path.position(t)[0][..., 0]] * self.size
        return zero, zero, zero

    def angle(self, p: Array, R: Array, R_desired: Array, start: Array) -> Any:
        """Return the angle by which its axis is off, shape (...) [rad]; None if it has no axis.

        Args:
            p: Positions of E, shape (..., 3) [m].
            R: Its orientations, shape (..., 3, 3).
            R_desired: Those of the path, likewise.
            start: Orientation at the start, shape (3, 3).
        """
        return None

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        """Return how far it is within its range, shape (...) [m or rad]; None without a range."""
        return None

    def frame_error(self, p: Array, R: Array, start: Place) -> Any:
        """Return how far its frame is from where it is held, shape (...) [m or rad].

        None for an objective that is not about all of a position or of an orientation.

        Args:
            p: Positions of the frame, shape (..., 3) [m].
            R: Its orientations, shape (..., 3, 3).
            start: Its pose at the start.
        """
        return None

    def distances(self, p: Array, R: Array, time: Any) -> tuple[Any, Any] | None:
        """Return how far a shaft passes from its point, and how deep it is inserted, shape (...).

        None without a shaft.

        Args:
            p: Positions of E, shape (..., 3) [m].
            R: Its orientations, shape (..., 3, 3).
            time: The time, shape (...) or a number [s].
        """
        return None

    def drawing(self, start: Array) -> Drawing | None:
        """Return what a playback draws of it; None for nothing."""
        return None


_OF = Annotated[
    ToolFrame | None,
    Meaning(
        "Frame that it is about, of an arm with two tools: ``first``, ``second``, ``relative`` "
        "(the second tool as seen from the first one) or ``centre``, which is to stay as it is at "
        "the start. By default the task frame E, which follows the path."
    ),
]
_WEIGHT = Annotated[
    Weight,
    Meaning("Price of its error, as a multiple of that of an objective of weight 1."),
]
_WITHIN = Annotated[
    Positive | None,
    between(1e-3, 1.57),
    Meaning("Angle by which it may be off; None for none.", unit="rad"),
]
_AXIS_OF_TOOL = Annotated[Point, Meaning("Axis of the task frame E; its length does not matter.")]


@validated
class PositionObjective(TaskObjective):
    """The position of E along axes of the world: that of the path, or a range of one axis."""

    axes: Annotated[
        Literal["x", "y", "z", "xy", "xz", "yz", "xyz"],
        Meaning("Axes of the world."),
    ] = "xyz"
    at_least: Annotated[
        Finite | None,
        between(-1e3, 1e3),
        Meaning("Least position along one axis, in place of that of the path.", unit="m"),
    ] = None
    at_most: Annotated[
        Finite | None,
        between(-1e3, 1e3),
        Meaning("Largest position along one axis, likewise.", unit="m"),
    ] = None
    of: _OF = None
    weight: _WEIGHT = 1.0

    turns = False

    def __post_init__(self) -> None:
        if self.bounds is None:
            return
        if len(self.axes) != 1:
            raise ValueError(
                f"axes: must be x, y or z with at_least or at_most, not {self.axes}; give each "
                "axis an entry"
            )
        lower, upper = self.bounds
        if lower is not None and upper is not None and not lower < upper:
            raise ValueError(f"at_most: must be greater than at_least, {lower:g}, not {upper:g}")

    @property
    def _axes(self) -> tuple[int, ...]:
        return tuple(map(_LETTERS.index, self.axes))

    @property
    def path_axes(self) -> tuple[int, ...]:  # type: ignore[override]
        return () if self.bounds else self._axes

    @property
    def size(self) -> int:
        return len(self.axes)

    @property
    def bounds(self) -> tuple[float | None, float | None] | None:
        if self.at_least is None and self.at_most is None:
            return None
        return self.at_least, self.at_most

    @property
    def text(self) -> str:
        if self.bounds is None:
            return f"position {self.axes}"
        sides = zip(("at least", "at most"), self.bounds, strict=True)
        texts = [f"{word} {side:g} m" for word, side in sides if side is not None]
        return f"{self.axes} {' and '.join(texts)}"

    def coordinates(self, pose: Pose, start: Array) -> list[Any]:
        return [pose.p[axis] for axis in self._axes]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        return [pose.J[axis] for axis in self._axes]

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        return [pose.rates(v).a[axis] for axis in self._axes]

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        if self.bounds is not None:
            return super().desired(path, t, start)
        values, speeds, accelerations = (
            [each[..., axis] for axis in self._axes] for each in path.position(t)
        )
        return values, speeds, accelerations

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        if self.bounds is None:
            return None
        value = p[..., self._axes[0]]
        return _margin(value, *self.bounds)

    def frame_error(self, p: Array, R: Array, start: Place) -> Any:
        if self.bounds is not None:
            return None
        away = [p[..., axis] - start.p[axis] for axis in self._axes]
        return root(sum(each * each for each in away))

    def drawing(self, start: Array) -> Drawing | None:
        is_drawn = self.bounds is not None and self.of != "relative"
        return Drawing(plane=(self._axes[0], *self.bounds)) if is_drawn and self.bounds else None


def _margin(value: Any, lower: float | None, upper: float | None) -> Any:
    gaps = [] if lower is None else [value - lower]
    gaps += [] if upper is None else [upper - value]
    return gaps[0] if len(gaps) == 1 else functions_of(value).minimum(*gaps)


@validated
class OrientationObjective(TaskObjective):
    """The orientation of E: that of the start, or the one to which the path turns."""

    of: _OF = None
    weight: _WEIGHT = 1.0

    with_orientation = True
    sees_turning = True
    size = 3
    text = "orientation"

    def frame_error(self, p: Array, R: Array, start: Place) -> Any:
        return angle_between(R, start.R[None])

    def coordinates(self, pose: Pose, start: Array) -> list[Any]:
        return [4.0 * each for each in _rodrigues(pose.R, start)]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        return list(_rodrigues_rate(_wide(_rodrigues(pose.R, start)), pose.J_omega))

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        rates = pose.rates(v)
        return list(_rodrigues_bend(_rodrigues(pose.R, start), rates.omega, rates.alpha))

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        R, omega, alpha = path.orientation(t)
        sigma = _rodrigues(R, start)
        turning, bending = _components(omega), _components(alpha)
        return (
            [4.0 * each for each in sigma],
            list(_rodrigues_rate(sigma, turning)),
            list(_rodrigues_bend(sigma, turning, bending)),
        )


def _rodrigues(R: AnyArray, start: Array) -> Three:
    """Return tan(theta / 4) along the axis of the rotation from the start's orientation."""
    is_one = isinstance(start, np.ndarray) and start.ndim == 2
    each = [[start[..., i, k] for k in range(3)] for i in range(3)] if not is_one else []
    S = start.tolist() if is_one else each

    def entry(i: int, k: int) -> Any:
        return R[..., i, 0] * S[k][0] + R[..., i, 1] * S[k][1] + R[..., i, 2] * S[k][2]

    sine = (entry(2, 1) - entry(1, 2), entry(0, 2) - entry(2, 0), entry(1, 0) - entry(0, 1))
    trace = entry(0, 0) + entry(1, 1) + entry(2, 2)
    xp = functions_of(trace)
    half = 0.5 * root(xp.maximum(1.0 + trace, _OPPOSITE))
    return _scaled(0.25 / (half * (1.0 + half)), sine)


def _rodrigues_rate(sigma: Three, omega: Three) -> Three:
    """Return 4 times the derivative of the above, of angular velocities in W."""
    return _sum(
        _scaled(1.0 - _dot(sigma, sigma), omega),
        _scaled(2.0, _cross(omega, sigma)),
        _scaled(2.0 * _dot(sigma, omega), sigma),
    )


def _rodrigues_bend(sigma: Three, omega: Three, alpha: Three) -> Three:
    """Return 4 times the second derivative, of angular velocities and their derivatives."""
    rate = _scaled(0.25, _rodrigues_rate(sigma, omega))
    return _sum(
        _rodrigues_rate(sigma, alpha),
        _scaled(-2.0 * _dot(sigma, rate), omega),
        _scaled(2.0, _cross(omega, rate)),
        _scaled(2.0 * _dot(rate, omega), sigma),
        _scaled(2.0 * _dot(sigma, omega), rate),
    )


class _Pointing(TaskObjective):
    """An axis of E that points somewhere: two coordinates, or one with a bound of the angle."""

    axis: Array
    within: float | None

    @property
    def size(self) -> int:
        return 2 if self.within is None else 1

    @property
    def bounds(self) -> tuple[float | None, float | None] | None:
        return None if self.within is None else (cos(self.within) / sin(self.within), None)

    @property
    def _unit(self) -> Array:
        return self.axis / np.linalg.norm(self.axis)

    def _check_axis(self) -> None:
        if not np.linalg.norm(self.axis) > 0.0:
            raise ValueError("axis: must not be zero")

    @abstractmethod
    def _aim(self, start: Array) -> Array:
        """Return where the vector should point, in the frame of the chart, shape (3,)."""

    @abstractmethod
    def _vector(self, pose: Pose) -> Three:
        """Return the vector that should point there."""

    @abstractmethod
    def _turning(self, pose: Pose) -> Three:
        """Return the rows of its Jacobian."""

    @abstractmethod
    def _bending(self, pose: Pose, v: AnyArray) -> tuple[Three, Three]:
        """Return its derivatives at constant joint velocities."""

    def coordinates(self, pose: Pose, start: Array) -> list[Any]:
        aim, vector = self._aim(start), self._vector(pose)
        if self.within is None:
            return _Chart.about(tuple(aim.tolist())).coordinates(vector)
        return [_dot(_numbers(aim), vector) / sin(self.within)]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        aim, vector, turning = self._aim(start), self._vector(pose), self._turning(pose)
        if self.within is None:
            return _Chart.about(tuple(aim.tolist())).rows(vector, turning)
        return [_dot(_numbers(aim), turning) / sin(self.within)]

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        aim, vector = self._aim(start), self._vector(pose)
        first, second = self._bending(pose, v)
        if self.within is None:
            return _Chart.about(tuple(aim.tolist())).second(vector, first, second)[1]
        return [_dot(_numbers(aim), second) / sin(self.within)]

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        if self.within is None:
            return None
        return self.within - self.angle(p, R, R, start)


def _numbers(vector: Array) -> Three:
    x, y, z = vector.tolist()
    return x, y, z


def _angle(a: Three, b: Three) -> Any:
    normal = _cross(a, b)
    cosine = _dot(a, b)
    return functions_of(cosine).arctan2(root(_dot(normal, normal)), cosine)


@validated
class AxisObjective(_Pointing):
    """Where an axis of E points: along a direction, or as the path turns it."""

    axis: _AXIS_OF_TOOL = Field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    toward: Annotated[
        Point | None,
        Meaning(
            "Direction in the world where it should point; by default that of the start, turned "
            "as the path turns."
        ),
    ] = None
    within: _WITHIN = None
    of: _OF = None
    weight: _WEIGHT = 1.0

    def __post_init__(self) -> None:
        self._check_axis()
        if self.toward is not None and not np.linalg.norm(self.toward) > 0.0:
            raise ValueError("toward: must not be zero")

    @property
    def sees_turning(self) -> bool:  # type: ignore[override]
        return self.toward is None and self.within is None

    @property
    def text(self) -> str:
        return "axis" if self.within is None else f"axis within {self.within:.3g} rad"

    def _aim(self, start: Array) -> Array:
        aim = start @ self._unit if self.toward is None else self.toward
        return np.asarray(aim / np.linalg.norm(aim))

    def _vector(self, pose: Pose) -> Three:
        return _rotated(pose.R, self._unit)

    def _turning(self, pose: Pose) -> Three:
        return _cross(pose.J_omega, _wide(self._vector(pose)))

    def _bending(self, pose: Pose, v: AnyArray) -> tuple[Three, Three]:
        return _turned(self._vector(pose), pose.rates(v).omega, pose.rates(v).alpha)

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        if not self.sees_turning:
            return super().desired(path, t, start)
        R, omega, alpha = path.orientation(t)
        vector = _rotated(R, self._unit)
        first, second = _turned(vector, _components(omega), _components(alpha))
        chart = _Chart.about(tuple(self._aim(start).tolist()))
        return chart.coordinates(vector), *chart.second(vector, first, second)

    def angle(self, p: Array, R: Array, R_desired: Array, start: Array) -> Any:
        aim = _numbers(self._aim(start))
        aim = _rotated(R_desired, self._unit) if self.sees_turning else aim
        return _angle(_rotated(R, self._unit), aim)

    def drawing(self, start: Array) -> Drawing | None:
        aim = None if self.sees_turning else self._aim(start)
        return Drawing(self._unit, aim, angle=self.within or 0.0)


def _turned(vector: Three, omega: Three, alpha: Three) -> tuple[Three, Three]:
    """Return the derivatives of a vector that turns."""
    first = _cross(omega, vector)
    return first, _sum(_cross(alpha, vector), _cross(omega, first))


@validated
class LookObjective(_Pointing):
    """An axis of E that points to a fixed point."""

    point: Annotated[Point, Meaning("The point in the world.", unit="m")]
    axis: _AXIS_OF_TOOL = Field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    within: _WITHIN = None
    of: _OF = None
    weight: _WEIGHT = 1.0

    def __post_init__(self) -> None:
        self._check_axis()

    @property
    def text(self) -> str:
        return "look at" if self.within is None else f"look at, within {self.within:.3g} rad"

    def _aim(self, start: Array) -> Array:
        return self._unit

    def _sight(self, p: Three) -> tuple[Any, Three]:
        """Return the distance of the point and its direction, in W."""
        x, y, z = self.point.tolist()
        way = x - p[0], y - p[1], z - p[2]
        distance = functions_of(p[0]).maximum(root(_dot(way, way)), _NEAR)
        return distance, _scaled(1.0 / distance, way)

    def _vector(self, pose: Pose) -> Three:
        return _into(pose.R, self._sight(pose.p)[1])

    def _turning(self, pose: Pose) -> Three:
        distance, sight = self._sight(pose.p)
        wide = _wide(sight)
        passing = _sum(pose.J, _scaled(-_dot(wide, pose.J), wide))
        seen = _sum(_scaled(-1.0 / distance[..., None], passing), _cross(wide, pose.J_omega))
        return _into(pose.R, seen)

    def _bending(self, pose: Pose, v: AnyArray) -> tuple[Three, Three]:
        rates = pose.rates(v)
        distance, u = self._sight(pose.p)
        nearer = -_dot(u, rates.v)
        first = _scaled(-1.0 / distance, _sum(rates.v, _scaled(nearer, u)))
        bent = _dot(first, first) * distance - _dot(u, rates.a)
        second = _scaled(
            -1.0 / distance, _sum(rates.a, _scaled(2.0 * nearer, first), _scaled(bent, u))
        )
        against = _cross(rates.omega, u)
        seen = _sum(first, _scaled(-1.0, against))
        seen_bending = _sum(
            second,
            _scaled(-2.0, _cross(rates.omega, first)),
            _scaled(-1.0, _cross(rates.alpha, u)),
            _cross(rates.omega, against),
        )
        return _into(pose.R, seen), _into(pose.R, seen_bending)

    def angle(self, p: Array, R: Array, R_desired: Array, start: Array) -> Any:
        return _angle(_rotated(R, self._unit), self._sight(_components(p))[1])

    def drawing(self, start: Array) -> Drawing | None:
        return Drawing(self._unit, point=self.point, angle=self.within or 0.0)


@validated
class RemoteCentreObjective(TaskObjective):
    """A shaft, a line fixed in E, that passes through a point: a remote centre of motion.

    The point is given, or is on the shaft at the start. The coordinates are those of where the
    shaft crosses a plane through it. At the start they are distances across the shaft; tilted by
    theta from the plane's normal, the shaft passes the point by up to cos(theta) of them. A shaft
    that lies in the plane crosses it nowhere.
    """

    point: Annotated[
        Point | None, Meaning("The point in the world, at first if it moves.", unit="m")
    ] = None
    depth: Annotated[
        Finite | None,
        between(-10.0, 10.0),
        Meaning(
            "In place of ``point``: the point is on the shaft at the start, and E is this far "
            "beyond it.",
            unit="m",
        ),
    ] = None
    axis: Annotated[
        Point,
        Meaning("Direction of the shaft in the task frame E, towards its tip, of any length."),
    ] = Field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    through: Annotated[Point, Meaning("A point of the shaft in the task frame E.", unit="m")] = (
        Field(default_factory=lambda: np.zeros(3))
    )
    normal: Annotated[
        Point | None,
        Meaning(
            "Normal in the world of the plane in which offsets are measured, of any length; by "
            "default the shaft at the start, but normal to ``moves``."
        ),
    ] = None
    moves: Annotated[
        Point | None,
        Meaning("Way of the point along a straight line, there and back; None at rest.", unit="m"),
    ] = None
    period: Annotated[
        Positive | None,
        between(1e-2, 1e4),
        Meaning("Time that it takes there and back.", unit="s"),
    ] = None
    within: Annotated[
        Positive | None,
        between(1e-5, 1.0),
        Meaning(
            "Radius of a hole in the plane through which the shaft passes anywhere; None for the "
            "point.",
            unit="m",
        ),
    ] = None
    weight: _WEIGHT = 1.0

    turns = False

    def __post_init__(self) -> None:
        directions = {"axis": self.axis, "normal": self.normal, "moves": self.moves}
        for name, vector in directions.items():
            if vector is not None and not np.linalg.norm(vector) > 0.0:
                raise ValueError(f"{name}: must not be zero")
        if (self.point is None) == (self.depth is None):
            raise ValueError("point: give either point or depth")
        if (self.moves is None) != (self.period is None):
            raise ValueError("moves: must be given with a period, and a period with it")
        if self.moves is not None and self.within is not None:
            raise ValueError("within: must be left out with moves; a hole is at rest")
        if self.moves is not None and self.normal is not None:
            sine = np.dot(self.normal, self.moves)
            if abs(sine) > 1e-9 * np.linalg.norm(self.normal) * np.linalg.norm(self.moves):
                raise ValueError("normal: must be normal to moves, which is in the plane")

    @property
    def size(self) -> int:
        return 2 if self.within is None else 1

    @property
    def bounds(self) -> tuple[float | None, float | None] | None:
        return None if self.within is None else (None, 0.5 * self.within)

    @property
    def text(self) -> str:
        if self.within is not None:
            return f"shaft within {1e3 * self.within:.3g} mm"
        return "remote centre" if self.moves is None else "remote centre, moving"

    def at(self, key: str, R_WE: Array, p_WE: Array | None) -> TaskObjective:
        shaft = R_WE @ self._unit
        normal = self._plane(R_WE)
        way = short(np.round(shaft, 3).tolist())
        pointing = f"the shaft, which points along {way} at the start"
        if np.linalg.norm(normal) < _ALONG_SHAFT:
            raise InvalidInputError(
                f"{key}.moves: must be across {pointing}, not {short(plain(self.moves))}"
            )
        if abs(shaft @ normal) < _ALONG_SHAFT * np.linalg.norm(normal):
            raise InvalidInputError(
                f"{key}.normal: must not be across {pointing}, not {short(plain(self.normal))}"
            )
        if self.depth is None:
            return self
        if p_WE is None:
            raise InvalidInputError(f"{key}.depth: needs the place of E at the start")
        point = p_WE + R_WE @ self.through - self.depth * shaft
        given = {name: value for name, value in fields_of(self).items() if value is not None}
        return type(self)(**{name: given[name] for name in given if name != "depth"}, point=point)

    @property
    def _unit(self) -> Array:
        return self.axis / np.linalg.norm(self.axis)

    def _plane(self, start: Array) -> Array:
        """Return the normal of the plane, not of unit length, shape (3,)."""
        if self.normal is not None:
            return self.normal / np.linalg.norm(self.normal)
        shaft = np.asarray(start @ self._unit)
        if self.moves is None:
            return shaft
        way = self.moves / np.linalg.norm(self.moves)
        return shaft - (shaft @ way) * way

    def _chart(self, start: Array) -> _Chart:
        normal = self._plane(start)
        return _Chart.about(tuple((normal / np.linalg.norm(normal)).tolist()))

    def _crossing(self, pose: Pose, chart: _Chart) -> tuple[Three, Three, Any, Any]:
        """Return the way to where the shaft crosses the plane, and its direction.

        Then how far behind the shaft's own point that is, and the cosine of its tilt.
        """
        assert self.point is not None
        shaft = pose.axis(self._unit)
        away = _sum(pose.p, pose.axis(self.through), _numbers(-self.point))
        cosine = _dot(chart.aim, shaft)  # type: ignore[arg-type]
        xp = functions_of(cosine)
        cosine = xp.where(
            cosine < 0.0, xp.minimum(cosine, -_OPPOSITE), xp.maximum(cosine, _OPPOSITE)
        )
        back = _dot(chart.aim, away) / cosine  # type: ignore[arg-type]
        return _sum(away, _scaled(-back, shaft)), shaft, back, cosine

    def _rate(self, chart: _Chart, crossing: Any, away: Three, shaft: Three) -> tuple[Three, Any]:
        """Return how the crossing moves, and ``back``, of those of point and direction."""
        _, direction, back, cosine = crossing
        aim: Any = chart.aim
        rate = (_dot(aim, away) - back * _dot(aim, shaft)) / cosine
        return _sum(away, _scaled(-rate, direction), _scaled(-back, shaft)), rate

    def coordinates(self, pose: Pose, start: Array) -> list[Any]:
        chart = self._chart(start)
        way = self._crossing(pose, chart)[0]
        values = _along(chart, way)
        if self.within is None:
            return values
        return [sum(each * each for each in values) / (2.0 * self.within)]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        chart = self._chart(start)
        way, direction, back, cosine = self._crossing(pose, chart)
        wide = way, _wide(direction), back[..., None], cosine[..., None]
        away = _sum(pose.J, _cross(pose.J_omega, _wide(pose.axis(self.through))))
        shaft = _cross(pose.J_omega, _wide(direction))
        rows = _along(chart, self._rate(chart, wide, away, shaft)[0])
        if self.within is None:
            return rows
        values = [each[..., None] for each in _along(chart, way)]
        return [sum(x * row for x, row in zip(values, rows, strict=True)) / self.within]

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        chart, rates = self._chart(start), pose.rates(v)
        crossing = self._crossing(pose, chart)
        direction = crossing[1]
        shaft, shaft_bend = _turned(direction, rates.omega, rates.alpha)
        lever, lever_bend = _turned(pose.axis(self.through), rates.omega, rates.alpha)
        first, rate = self._rate(chart, crossing, _sum(rates.v, lever), shaft)
        away = _sum(rates.a, lever_bend, _scaled(-2.0 * rate, shaft))
        bends = _along(chart, self._rate(chart, crossing, away, shaft_bend)[0])
        if self.within is None:
            return bends
        values, speeds = _along(chart, crossing[0]), _along(chart, first)
        terms = zip(values, speeds, bends, strict=True)
        return [sum(v * v + x * a for x, v, a in terms) / self.within]

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        if self.moves is None:
            return super().desired(path, t, start)
        along = _along(self._chart(start), _numbers(self.moves))
        zero = 0.0 * path.position(t)[0][..., 0]
        values, speeds, accelerations = (
            [zero + way * share for way in along] for share in self._share(path.time(t))
        )
        return values, speeds, accelerations

    def _share(self, time: Any) -> tuple[Any, Any, Any]:
        """Return the share of its way that the point has come, with two derivatives."""
        if self.period is None:
            return 0.0, 0.0, 0.0
        w, xp = 2.0 * pi / self.period, functions_of(time)
        angle = w * time
        sine, cosine = xp.sin(angle), xp.cos(angle)
        return 0.5 * (1.0 - cosine), 0.5 * w * sine, 0.5 * w * w * cosine

    def distances(self, p: Array, R: Array, time: Any) -> tuple[Any, Any] | None:
        assert self.point is not None
        shaft, through = _rotated(R, self._unit), _rotated(R, self.through)
        share = self._share(time)[0]
        moves = (0.0, 0.0, 0.0) if self.moves is None else _numbers(self.moves)
        beyond = _sum(_components(p), _numbers(-self.point), _scaled(-share, moves))
        across = _cross(_sum(beyond, through), shaft)
        return root(_dot(across, across)), _dot(beyond, shaft)

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        if self.within is None:
            return None
        pose = Pose(_Still(p, R), None)  # type: ignore[arg-type]
        way = self._crossing(pose, self._chart(start))[0]
        return self.within - root(_dot(way, way))

    def drawing(self, start: Array) -> Drawing | None:
        moves = np.zeros(3) if self.moves is None else self.moves
        normal = self._plane(start)
        port = Port(
            normal / np.linalg.norm(normal),
            self.within or 0.0,
            lambda times: np.multiply.outer(self._share(times)[0] + 0.0 * times, moves),
        )
        return Drawing(-self._unit, point=self.point, port=port)


class _Still:
    """A pose that is known already, as kinematics."""

    def __init__(self, p_WE: Array, R_WE: Array) -> None:
        self._p_WE, self._R_WE = p_WE, R_WE

    def p_WE(self, q: Any) -> Array:
        return self._p_WE

    def R_WE(self, q: Any) -> Array:
        return self._R_WE


def _along(chart: _Chart, vector: Three) -> list[Any]:
    """Return the components of a vector, or of rows, along both sides of a chart."""
    return [_dot(side, vector) for side in chart.sides]  # type: ignore[arg-type]


#: Objectives that an entry of ``task`` may name by their ``kind``.
TASK_OBJECTIVES: Kinds[TaskObjective] = Kinds(
    "task_objective",
    TaskObjective,
    {
        "position": PositionObjective,
        "orientation": OrientationObjective,
        "axis": AxisObjective,
        "look": LookObjective,
        "remote_centre": RemoteCentreObjective,
    },
)


@dataclass(frozen=True)
class Task:
    """Axes of the position of the task frame E that are controlled, and perhaps its orientation.

    Attributes:
        axes: Axes of the position, each 0 to 2.
        with_orientation: Whether the orientation is controlled; the first three rows of J are then
            those of the angular velocity.
        objectives: What is asked in place of these, in order; then the above are what errors are
            measured along: the axes that objectives follow the path with, or all if there are none.
        start: Orientation of E at the start, row by row, to which objectives refer; None if it is
            not known yet.
        key: Text that tells tasks of objectives apart.
        places: Of an arm with two tools, the poses at the start of frames that objectives are
            about, each a name and the twelve numbers of position and orientation, row by row.
    """

    axes: tuple[int, ...]
    with_orientation: bool = False
    objectives: tuple[TaskObjective, ...] = field(default=(), compare=False)
    start: tuple[float, ...] | None = None
    key: str = ""
    places: tuple[tuple[str, tuple[float, ...]], ...] = ()

    @classmethod
    def of(cls, section: Sequence[Any], modules: Modules = True) -> Task:
        """Return the task of a list of objectives, as a document has it.

        Args:
            section: The entries, each with its ``kind`` and its keys.
            modules: Modules that may be imported for a class.

        Raises:
            InvalidInputError: If the list is empty, or an entry is wrong.
        """
        if not section:
            raise InvalidInputError("task: must have one objective or more, not []")
        objectives = tuple(
            _objective(entry, f"task[{number}]", modules) for number, entry in enumerate(section)
        )
        own = [each for each in objectives if each.of is None]
        axes = [axis for each in own for axis in each.path_axes]
        if len(set(axes)) < len(axes):
            raise InvalidInputError("task: two objectives follow the path along the same axis")
        frames = [each.of for each in objectives if each.with_orientation]
        if frame_twice := [each for each in frames if frames.count(each) > 1]:
            of = f" of {frame_twice[0]}" if frame_twice[0] else ""
            raise InvalidInputError(f"task: must have one orientation{of} at most")
        if all(each.bounds is not None for each in objectives):
            raise InvalidInputError(
                "task: must have an objective with a value besides ranges, which leave all free"
            )
        turns = any(each.with_orientation for each in own)
        key = json.dumps(plain(list(section)), sort_keys=True, default=repr)
        return cls(tuple(sorted(axes)) or (0, 1, 2), turns, objectives, None, key)

    def at(self, R_WE: Array, kinematics: Any = None, q: Array | None = None) -> Task:
        """Return the task of an arm that starts with an orientation of E, shape (3, 3).

        Args:
            R_WE: The orientation, shape (3, 3).
            kinematics: Kinematics of the arm, for objectives that refer to more of its start.
            q: Its start, shape (n,) [rad].

        Raises:
            InvalidInputError: If an objective is not one from there.
        """
        if not self.objectives:
            return self
        R_WE, p_WE = np.asarray(R_WE, dtype=float), None
        places: dict[str, Place] = {}
        if kinematics is not None:
            p_WE = np.array(kinematics.p_WE(q))
            for frame in self.frames:
                pose = pose_of(kinematics, np.asarray(q), frame)
                places[frame] = Place(np.array(pose.p_WE), np.array(pose.R))
        placed = []
        for number, each in enumerate(self.objectives):
            place = places.get(each.of or "")
            p, R = (p_WE, R_WE) if place is None else place
            placed.append(each.at(f"task[{number}]", R, p))
        key = self.key
        if p_WE is not None and any(map(is_not, placed, self.objectives)):
            key = json.dumps([key, p_WE.tolist()])
        return replace(
            self,
            objectives=tuple(placed),
            start=tuple(R_WE.ravel().tolist()),
            key=key,
            places=tuple(
                (name, (*p.tolist(), *R.ravel().tolist())) for name, (p, R) in places.items()
            ),
        )

    @property
    def frames(self) -> tuple[ToolFrame, ...]:
        """Frames of two tools that objectives are about, each once."""
        return tuple(dict.fromkeys(each.of for each in self.objectives if each.of is not None))

    def place(self, frame: ToolFrame | None) -> Place:
        """Return the pose of a frame at the start; of E, None, the orientation alone is known."""
        if frame is None:
            return Place(np.full(3, np.nan), self.start_orientation)
        return self._places[frame]

    @cached_property
    def _places(self) -> dict[str, Place]:
        each = {name: np.array(numbers) for name, numbers in self.places}
        return {name: Place(x[:3], x[3:].reshape(3, 3)) for name, x in each.items()}

    def _each(self, kinematics: Any, q: Array) -> list[tuple[TaskObjective, Pose, Array]]:
        """Return each objective with the pose of its frame, and its orientation at the start."""
        frames = dict.fromkeys(each.of for each in self.objectives)
        poses = {frame: pose_of(kinematics, q, frame) for frame in frames}
        return [(each, poses[each.of], self.place(each.of).R) for each in self.objectives]

    @property
    def measured(self) -> Task:
        """Axes and orientation along which errors are measured."""
        return Task(self.axes, self.with_orientation) if self.objectives else self

    @property
    def valued(self) -> Task:
        """The task without the objectives that have a range in place of a value."""
        return replace(self, objectives=tuple(o for o in self.objectives if o.bounds is None))

    @property
    def size(self) -> int:
        """Number of rows of J."""
        if self.objectives:
            return sum(each.size for each in self.objectives)
        return 3 * self.with_orientation + len(self.axes)

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the axes of signals that depend on the task, by their names."""
        return {"axes": self.size if self.objectives else len(self.axes), "rows": self.size}

    @property
    def blocks(self) -> tuple[RowBlock, ...]:
        """What laws know of the rows of its objectives."""
        return tuple(each.block for each in self.objectives)

    @property
    def has_ranges(self) -> bool:
        """Whether an objective has a range in place of a value."""
        return any(block.is_range for block in self.blocks)

    @property
    def has_weights(self) -> bool:
        """Whether an objective has a weight other than 1."""
        return any(block.weight != 1.0 for block in self.blocks)

    @property
    def sees_turning(self) -> bool:
        """Whether an objective follows the orientation of a path."""
        return any(each.sees_turning for each in self.objectives if each.of is None)

    def position(self, vector: Array) -> Array:
        """Return the rows of ``vector``, shape (3, ...), that belong to the task's axes."""
        return vector if len(self.axes) == 3 else vector[list(self.axes)]

    def J(self, kinematics: Any, q: Array) -> Array:
        """Return the task's Jacobian, shape (size, n); rotation comes first, as in Drake."""
        if self.objectives:
            rows = [
                row
                for each, pose, start in self._each(kinematics, q)
                for row in each.rows(pose, start)
            ]
            return functions_of(*rows).stack(rows, axis=-2)
        J = self.position(kinematics.J(q))
        return np.vstack((kinematics.J_omega(q), J)) if self.with_orientation else J

    def coordinates(self, kinematics: Any, q: Array) -> Array:
        """Return the position along the axes, or the coordinates of objectives, shape (..., m)."""
        if not self.objectives:
            return self.position(kinematics.p_WE(q))
        each_one = self._each(kinematics, q)
        return _stack([x for each, pose, start in each_one for x in each.coordinates(pose, start)])

    def velocity(self, kinematics: Any, q: Array, v: Array) -> Array:
        """Return their derivative, shape (m,)."""
        if not self.objectives:
            velocity: Array = self.position(kinematics.J(q)).dot(v)
            return velocity
        return self.J(kinematics, q).dot(v)

    def bias(self, kinematics: Any, q: Array, v: Array) -> Array:
        """Return their acceleration at constant joint velocities, shape (..., m)."""
        if not self.objectives:
            return self.position(kinematics.Jdot_v(q, v))
        each_one = self._each(kinematics, q)
        return _stack([a for each, pose, start in each_one for a in each.bias(pose, start, v)])

    def desired(self, path: Any, t: Any) -> tuple[Array, Array, Array]:
        """Return what they should be along a path, with two derivatives, shape (..., m) each."""
        if not self.objectives:
            p, v, a = path.position(t)
            return self.position(p), self.position(v), self.position(a)
        each = []
        for objective in self.objectives:
            place = self.place(objective.of)
            way = path if objective.of is None else place.along(path)
            each.append(objective.desired(way, t, place.R))
        p, v, a = (_stack([x for one in each for x in one[order]]) for order in range(3))
        return p, v, a

    def errors(
        self,
        p: Array,
        R: Array,
        R_desired: Array,
        time: Any = 0.0,
        frames: Mapping[str, tuple[Array, Array]] | None = None,
    ) -> dict[str, Any]:
        """Return errors and margins of objectives, by the names of `TASK_MEASURES`.

        Args:
            p: Positions of E, shape (k, 3) [m].
            R: Its orientations, shape (k, 3, 3).
            R_desired: Those of the path, likewise.
            time: The time, shape (k,) or a number [s].
            frames: Positions and orientations of each of `frames`, likewise, by their names.
        """
        xp, E = functions_of(p), (p, R, R_desired)
        errors: dict[str, Any] = {}
        for each in self.objectives:
            place = self.place(each.of)
            start, (p, R, R_desired) = place.R, E
            if each.of is not None:
                p, R = (frames or {})[each.of]
                R_desired = 0.0 * R + place.R
                if (away := each.frame_error(p, R, place)) is not None:
                    name = "frame_orientation_error" if each.turns else "frame_position_error"
                    errors[name] = xp.maximum(errors.get(name, 0.0), away)
            margin, angle = each.margin(p, R, start), None
            if margin is None:
                angle = each.angle(p, R, R_desired, start)
            name = "angle_margin" if each.turns else "position_margin"
            if margin is not None:
                errors[name] = xp.minimum(errors.get(name, np.inf), margin)
            if angle is not None:
                errors["axis_error"] = xp.maximum(errors.get("axis_error", 0.0), angle)
            if (distances := each.distances(p, R, time)) is not None:
                away, depth = distances
                errors["shaft_distance"] = xp.maximum(errors.get("shaft_distance", 0.0), away)
                errors["insertion_depth"] = xp.minimum(errors.get("insertion_depth", np.inf), depth)
        return errors

    @cached_property
    def start_orientation(self) -> Array:
        """Orientation of E at the start, shape (3, 3), to which objectives refer."""
        if self.start is None:
            raise InvalidInputError("task: objectives need the start; call Task.at first")
        return np.array(self.start).reshape(3, 3)


def _stack(values: Sequence[Any]) -> Array:
    stacked: Array = functions_of(*values).stack(values, axis=-1)
    return stacked


def _objective(section: Any, key: str, modules: Modules) -> TaskObjective:
    if not isinstance(section, Mapping):
        raise InvalidInputError(f"{key}: must be a mapping of keys to values, not {short(section)}")
    kind = TASK_OBJECTIVES.named_by(section, modules, key)
    return construct(kind, without_kind(section), key)


#: The tasks an experiment may name.
TASKS = {"xyz": Task((0, 1, 2)), "xy": Task((0, 1)), "pose": Task((0, 1, 2), True)}
#: What an experiment may ask for: the name of a task, or a list of objectives.
TaskSection = str | Sequence[Any] | Task


def named_task(name: TaskSection, modules: Modules = True) -> Task:
    """Return the task of this name, or of a list of objectives; a task itself is returned.

    Args:
        name: The name, the list, or the task.
        modules: Modules that may be imported for objectives.

    Raises:
        InvalidInputError: If there is no such task.
    """
    if isinstance(name, Task):
        return name
    if isinstance(name, (list, tuple)):
        return Task.of(name, modules)
    if not isinstance(name, str) or name not in TASKS:
        raise InvalidInputError(
            f"task: may be {', '.join(TASKS)}, or a list of objectives, not {short(name)}"
        )
    return TASKS[name]


def tasks_suiting(shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the names of the tasks of which signals of these shapes may be.

    Args:
        shapes: Shapes by the names of signals; those that depend on the task have their number of
            rows.
    """
    return [name for name, task in TASKS.items() if suits(task, shapes)]


def suits(task: Task, shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Return whether signals of these shapes may be of a task, see `tasks_suiting`."""
    axes, size = task.lengths["axes"], task.size
    rows = {"p_WE": axes, "v_WE": axes, "Jdot_v": axes, "J": size, "J_hat": size}
    return all(shapes[name][0] == rows[name] for name in rows.keys() & shapes.keys())
