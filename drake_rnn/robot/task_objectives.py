r"""Objectives of a task: position, orientation, axis, look, and remote centre of motion.

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

An objective of an arm with two tools may be about another frame than E, ``of``, and then it is to
stay as it is at the start.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, sin
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ..arrays.algebra import AnyArray, functions_of, root
from ..errors import InvalidInputError
from ..inputs.fields import Array, Finite, Point, Positive, Weight, between, validated
from ..inputs.keys import Meaning
from ..inputs.kinds import Kinds
from ..inputs.messages import fields_of, plain, short
from .rotation import angle_between, frame_about
from .task_frame import (
    OPPOSITE,
    Place,
    Pose,
    Three,
    ToolFrame,
    add,
    components,
    cross,
    dot,
    numbers,
    rodrigues,
    rodrigues_bend,
    rodrigues_rate,
    rotate,
    rotate_back,
    scale,
    widen,
)

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
        cosine = dot(self.aim, a)  # type: ignore[arg-type]
        return functions_of(cosine).maximum(1.0 + cosine, OPPOSITE)

    def coordinates(self, a: Three) -> list[Any]:
        """Return both coordinates."""
        s = self._scale(a)
        return [2.0 * dot(side, a) / s for side in self.sides]  # type: ignore[arg-type]

    def rows(self, a: Three, J: Three) -> list[Any]:
        """Return the rows of their Jacobian, of that of the vector."""
        s = self._scale(a)[..., None]
        along = dot(self.aim, J)  # type: ignore[arg-type]
        rows = []
        for side in self.sides:
            y = dot(side, a)[..., None] / s  # type: ignore[arg-type]
            rows.append(2.0 * (dot(side, J) - y * along) / s)  # type: ignore[arg-type]
        return rows

    def second(self, a: Three, first: Three, second: Three) -> tuple[list[Any], list[Any]]:
        """Return their first and second derivatives, of those of the vector."""
        s = self._scale(a)
        rate, bend = (dot(self.aim, each) for each in (first, second))  # type: ignore[arg-type]
        speeds, accelerations = [], []
        for side in self.sides:
            y = dot(side, a) / s  # type: ignore[arg-type]
            y_dot = (dot(side, first) - y * rate) / s  # type: ignore[arg-type]
            bent = dot(side, second) - y * bend - 2.0 * y_dot * rate  # type: ignore[arg-type]
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

    @property
    def joins_tools(self) -> bool:
        """Whether it keeps the second tool where the first one carries it, as a bar would."""
        return False

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
    def joins_tools(self) -> bool:
        return self.of == "relative" and self.bounds is None

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
        return [4.0 * each for each in rodrigues(pose.R, start)]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        return list(rodrigues_rate(widen(rodrigues(pose.R, start)), pose.J_omega))

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        rates = pose.rates(v)
        return list(rodrigues_bend(rodrigues(pose.R, start), rates.omega, rates.alpha))

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        R, omega, alpha = path.orientation(t)
        sigma = rodrigues(R, start)
        turning, bending = components(omega), components(alpha)
        return (
            [4.0 * each for each in sigma],
            list(rodrigues_rate(sigma, turning)),
            list(rodrigues_bend(sigma, turning, bending)),
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
        return [dot(numbers(aim), vector) / sin(self.within)]

    def rows(self, pose: Pose, start: Array) -> list[Any]:
        aim, vector, turning = self._aim(start), self._vector(pose), self._turning(pose)
        if self.within is None:
            return _Chart.about(tuple(aim.tolist())).rows(vector, turning)
        return [dot(numbers(aim), turning) / sin(self.within)]

    def bias(self, pose: Pose, start: Array, v: AnyArray) -> list[Any]:
        aim, vector = self._aim(start), self._vector(pose)
        first, second = self._bending(pose, v)
        if self.within is None:
            return _Chart.about(tuple(aim.tolist())).second(vector, first, second)[1]
        return [dot(numbers(aim), second) / sin(self.within)]

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        if self.within is None:
            return None
        return self.within - self.angle(p, R, R, start)


def _angle(a: Three, b: Three) -> Any:
    normal = cross(a, b)
    cosine = dot(a, b)
    return functions_of(cosine).arctan2(root(dot(normal, normal)), cosine)


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
        return rotate(pose.R, numbers(self._unit))

    def _turning(self, pose: Pose) -> Three:
        return cross(pose.J_omega, widen(self._vector(pose)))

    def _bending(self, pose: Pose, v: AnyArray) -> tuple[Three, Three]:
        return _turned(self._vector(pose), pose.rates(v).omega, pose.rates(v).alpha)

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        if not self.sees_turning:
            return super().desired(path, t, start)
        R, omega, alpha = path.orientation(t)
        vector = rotate(R, numbers(self._unit))
        first, second = _turned(vector, components(omega), components(alpha))
        chart = _Chart.about(tuple(self._aim(start).tolist()))
        return chart.coordinates(vector), *chart.second(vector, first, second)

    def angle(self, p: Array, R: Array, R_desired: Array, start: Array) -> Any:
        aim = numbers(self._aim(start))
        aim = rotate(R_desired, numbers(self._unit)) if self.sees_turning else aim
        return _angle(rotate(R, numbers(self._unit)), aim)

    def drawing(self, start: Array) -> Drawing | None:
        aim = None if self.sees_turning else self._aim(start)
        return Drawing(self._unit, aim, angle=self.within or 0.0)


def _turned(vector: Three, omega: Three, alpha: Three) -> tuple[Three, Three]:
    """Return the derivatives of a vector that turns."""
    first = cross(omega, vector)
    return first, add(cross(alpha, vector), cross(omega, first))


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
        distance = functions_of(p[0]).maximum(root(dot(way, way)), _NEAR)
        return distance, scale(1.0 / distance, way)

    def _vector(self, pose: Pose) -> Three:
        return rotate_back(pose.R, self._sight(pose.p)[1])

    def _turning(self, pose: Pose) -> Three:
        distance, sight = self._sight(pose.p)
        wide = widen(sight)
        passing = add(pose.J, scale(-dot(wide, pose.J), wide))
        seen = add(scale(-1.0 / distance[..., None], passing), cross(wide, pose.J_omega))
        return rotate_back(pose.R, seen)

    def _bending(self, pose: Pose, v: AnyArray) -> tuple[Three, Three]:
        rates = pose.rates(v)
        distance, u = self._sight(pose.p)
        nearer = -dot(u, rates.v)
        first = scale(-1.0 / distance, add(rates.v, scale(nearer, u)))
        bent = dot(first, first) * distance - dot(u, rates.a)
        second = scale(-1.0 / distance, add(rates.a, scale(2.0 * nearer, first), scale(bent, u)))
        against = cross(rates.omega, u)
        seen = add(first, scale(-1.0, against))
        seen_bending = add(
            second,
            scale(-2.0, cross(rates.omega, first)),
            scale(-1.0, cross(rates.alpha, u)),
            cross(rates.omega, against),
        )
        return rotate_back(pose.R, seen), rotate_back(pose.R, seen_bending)

    def angle(self, p: Array, R: Array, R_desired: Array, start: Array) -> Any:
        return _angle(rotate(R, numbers(self._unit)), self._sight(components(p))[1])

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
        away = add(pose.p, pose.axis(self.through), numbers(-self.point))
        cosine = dot(chart.aim, shaft)  # type: ignore[arg-type]
        xp = functions_of(cosine)
        cosine = xp.where(cosine < 0.0, xp.minimum(cosine, -OPPOSITE), xp.maximum(cosine, OPPOSITE))
        back = dot(chart.aim, away) / cosine  # type: ignore[arg-type]
        return add(away, scale(-back, shaft)), shaft, back, cosine

    def _rate(self, chart: _Chart, crossing: Any, away: Three, shaft: Three) -> tuple[Three, Any]:
        """Return how the crossing moves, and ``back``, of those of point and direction."""
        _, direction, back, cosine = crossing
        aim: Any = chart.aim
        rate = (dot(aim, away) - back * dot(aim, shaft)) / cosine
        return add(away, scale(-rate, direction), scale(-back, shaft)), rate

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
        wide = way, widen(direction), back[..., None], cosine[..., None]
        away = add(pose.J, cross(pose.J_omega, widen(pose.axis(self.through))))
        shaft = cross(pose.J_omega, widen(direction))
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
        first, rate = self._rate(chart, crossing, add(rates.v, lever), shaft)
        away = add(rates.a, lever_bend, scale(-2.0 * rate, shaft))
        bends = _along(chart, self._rate(chart, crossing, away, shaft_bend)[0])
        if self.within is None:
            return bends
        values, speeds = _along(chart, crossing[0]), _along(chart, first)
        terms = zip(values, speeds, bends, strict=True)
        return [sum(v * v + x * a for x, v, a in terms) / self.within]

    def desired(self, path: Any, t: Any, start: Array) -> tuple[list[Any], list[Any], list[Any]]:
        if self.moves is None:
            return super().desired(path, t, start)
        along = _along(self._chart(start), numbers(self.moves))
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
        shaft, through = rotate(R, numbers(self._unit)), rotate(R, numbers(self.through))
        share = self._share(time)[0]
        moves = (0.0, 0.0, 0.0) if self.moves is None else numbers(self.moves)
        beyond = add(components(p), numbers(-self.point), scale(-share, moves))
        across = cross(add(beyond, through), shaft)
        return root(dot(across, across)), dot(beyond, shaft)

    def margin(self, p: Array, R: Array, start: Array) -> Any:
        if self.within is None:
            return None
        pose = Pose(_Still(p, R), None)  # type: ignore[arg-type]
        way = self._crossing(pose, self._chart(start))[0]
        return self.within - root(dot(way, way))

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
    return [dot(side, vector) for side in chart.sides]  # type: ignore[arg-type]


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
