"""The base classes of paths: desired motions of the end effector, to be placed in the world.

- Checks of what a path returns, so that a wrong path is refused by name.
- Paths that are given by their motion from their own first pose.
- A path that goes along with another point, such as the tool of a second arm.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from operator import attrgetter
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array, Point, validated, zeros
from ..inputs.keys import Meaning
from ..inputs.messages import require_type, short
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics

_COUNTS = {2: "two", 3: "three"}
# Distance up to which two points count as the same [m].
_MEET = 1e-6
# Largest entry by which a rotation matrix may miss being one.
_ROTATION = 1e-6


def require_values(
    name: str,
    function: Callable[[float], Any],
    argument: str,
    at: Iterable[float],
    shapes: Sequence[tuple[int, ...]],
) -> None:
    """Raise an InvalidInputError unless a function returns finite arrays of these shapes.

    Args:
        name: Name of the function in messages.
        function: The function.
        argument: Name of its argument.
        at: Arguments at which it is called.
        shapes: Shape of each array that it must return.
    """
    expectation = (
        f"must return {_COUNTS[len(shapes)]} arrays of finite numbers, of shapes "
        + ", ".join(map(str, shapes))
    )
    for value in at:
        where = f"path: {name}({argument} = {value:.4g})"
        try:
            result = function(value)
        except (InvalidInputError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise InvalidInputError(
                f"{where}: fails with {type(error).__name__}: {error}; it {expectation}"
            ) from error
        fault = _fault(result, shapes)
        if fault:
            raise InvalidInputError(f"{where}: {expectation}, not {fault}")


def _fault(result: Any, shapes: Sequence[tuple[int, ...]]) -> str:
    """Return what is wrong with returned arrays; empty if they are right."""
    if not isinstance(result, (tuple, list)) or len(result) != len(shapes):
        return short(result)
    for value, shape in zip(result, shapes, strict=True):
        try:
            array = np.asarray(value)
        except (TypeError, ValueError):
            return short(value)
        if array.dtype.kind not in "iuf":
            return short(value)
        if array.shape != shape:
            return f"one of shape {array.shape}"
        if not np.isfinite(array).all():
            return short(value)
    return ""


def require_times(name: str, duration: Any, traversal: Any) -> None:
    """Raise an InvalidInputError unless a path's duration and traversal are times."""
    for key, value, finite in (("duration", duration, False), ("traversal", traversal, True)):
        number = isinstance(value, (int, float)) and value > 0.0
        if not number or (finite and not math.isfinite(value)):
            kind = "a finite time" if finite else "a time"
            raise InvalidInputError(
                f"path: {name}.{key}: must be {kind} above 0 [s], not {short(value)}"
            )


def require_pose(p_WE: Any, R_WE: Any) -> None:
    """Raise an InvalidInputError unless a pose has the shapes (3,) and (3, 3); each may be None."""
    for key, value, shape in (("p_WE", p_WE, (3,)), ("R_WE", R_WE, (3, 3))):
        if value is not None and (fault := _fault([value], [shape])):
            raise InvalidInputError(
                f"{key}: must be finite numbers of shape {shape}, not {fault.removeprefix('one ')}"
            )
    if R_WE is not None and not _is_rotation(np.asarray(R_WE, dtype=float)):
        raise InvalidInputError(f"R_WE: must be a rotation matrix, not {short(R_WE)}")


def _is_rotation(R: Array) -> bool:
    off = np.abs(R @ R.T - np.eye(3)).max()
    return bool(off < _ROTATION and np.linalg.det(R) > 0.0)


def require_start(name: str, first: Array, last: Array | None) -> None:
    """Raise an InvalidInputError unless a path starts at its first point, and closes if it says so.

    Args:
        name: Name of the path's class.
        first: Displacement at the start, shape (3,) [m].
        last: Displacement at the end of a lap, shape (3,) [m]; None for an open path.
    """
    away = float(np.linalg.norm(first))
    if away > _MEET:
        raise InvalidInputError(
            f"path: {name} must start at its first point, with a displacement of zero, not "
            f"{away:.3g} m away"
        )
    if last is not None and (away := float(np.linalg.norm(last))) > _MEET:
        raise InvalidInputError(
            f"path: {name} says that it is closed, and a lap ends {away:.3g} m from where it began"
        )


def require_count(count: object) -> None:
    """Raise an InvalidInputError unless a number of points is a whole number of at least 1."""
    if not isinstance(count, (int, np.integer)) or count < 1:
        raise InvalidInputError(f"count: must be a whole number of at least 1, not {short(count)}")


def require_time(t: object) -> None:
    """Raise an InvalidInputError unless a time is a finite number."""
    if not isinstance(t, Real) or not math.isfinite(t):
        raise InvalidInputError(f"t: must be finite, not {short(t)}")


#: Value at a time, and its two derivatives.
Motion = tuple[Array, Array, Array]

#: Frames in which any path may be given: the base, which is the world frame W, and the tool, which
#: is the task frame E when the path begins.
BASE, TOOL = "base", "tool"

# Largest rounding error between equal times [s] and between equal places [m].
_INSTANT, _SAME = 1e-9, 1e-6


class Passage(ABC):
    """How a path is traversed in time, placed or not."""

    @property
    @abstractmethod
    def duration(self) -> float:
        """Time at which the path ends [s]; infinite for one without an end."""

    @property
    def traversal(self) -> float:
        """Time after which all of the path has been passed once, finite [s].

        It is one lap of a closed curve, and the duration of an open one.
        """
        return self.duration

    @property
    def closed(self) -> bool:
        """Whether the path ends where it began."""
        return False

    @property
    def turns(self) -> bool:
        """Whether the path carries an orientation of its own, which may vary."""
        return False

    def knots(self, until: float) -> Array:
        """Return the times in [0, until] at which a derivative may jump or the point rests [s].

        Raises:
            InvalidInputError: If ``until`` and the duration are both infinite.
        """
        until = min(until, self.duration)
        if not np.isfinite(until):
            raise InvalidInputError(f"until: must be finite, not {until}")
        times = np.unique(np.concatenate([np.atleast_1d(part) for part in self._breaks(until)]))
        return times[times <= until]

    def _breaks(self, until: float) -> list[Array | float]:
        """Return times that hold all of `knots` up to ``until`` [s], and perhaps later ones."""
        return [0.0, self.duration]

    @abstractmethod
    def sample(self, count: int) -> Array:
        """Return points that show the path passed once, shape (count, 3) [m].

        Raises:
            InvalidInputError: If ``count`` is not a whole number of at least 1.
        """

    def _sample(self, motion: Callable[[float], Motion], count: int) -> Array:
        """Return the points of a motion at equal steps of time, see `sample`."""
        require_count(count)
        return np.array([motion(t)[0] for t in np.linspace(0.0, self.traversal, count).tolist()])


class PlacedPath(Passage):
    """A path in the world frame W: the desired motion of the end effector E as functions of time.

    `Path.placed` returns one. Before t = 0 the point rests where the path begins, after its end
    where it ends.
    """

    @property
    @abstractmethod
    def oriented(self) -> bool:
        """Whether `orientation` is known, as the path carries it or it was placed with one."""

    @abstractmethod
    def position(self, t: float) -> Motion:
        """Return the desired motion of E's origin at time ``t`` [s].

        Where a derivative jumps, the value after the jump is returned.

        Returns:
            p_WE [m], v_WE [m/s] and a_WE [m/s^2], each of shape (3,).

        Raises:
            InvalidInputError: If ``t`` is not finite.
        """

    @abstractmethod
    def orientation(self, t: float) -> Motion:
        """Return the desired orientation of E at time ``t`` [s].

        For a path that does not turn it is the orientation at the start, at all times.

        Returns:
            R_WE, shape (3, 3); angular velocity w_WE of E in W [rad/s] and its derivative
            alpha_WE [rad/s^2], each of shape (3,), in W.

        Raises:
            InvalidInputError: If it is not known, see `oriented`, or ``t`` is not finite.
        """

    def last_lap(self, until: float) -> float | None:
        """Return the time at which the last complete lap before a time began [s].

        None for a path that does not close, or has not closed by then.

        Args:
            until: The time [s].
        """
        if not self.closed:
            return None
        end = min(until, self.duration)
        # A sequence of paths closes as a whole.
        for begin in (end - self.traversal, 0.0):
            if -_INSTANT <= begin < end:
                away = self.position(max(begin, 0.0))[0] - self.position(end)[0]
                if np.linalg.norm(away) < _SAME:
                    return max(begin, 0.0)
        return None

    def sample(self, count: int) -> Array:
        """See `Passage.sample`; points are positions in W."""
        return self._sample(self.position, count)


class PathOfAnother(PlacedPath):
    """A placed path that follows from another one, and turns as that one does.

    Attributes:
        own: The other path.
    """

    own: PlacedPath

    @property
    def traversal(self) -> float:
        """See `Passage.traversal`; that of the other path."""
        return self.own.traversal

    @property
    def turns(self) -> bool:
        """See `Passage.turns`."""
        return self.own.turns

    @property
    def oriented(self) -> bool:
        """See `PlacedPath.oriented`."""
        return self.own.oriented


@validated
class Path(ABC):
    """A desired motion of the end effector, to be placed where an arm starts."""

    @property
    def has_place(self) -> bool:
        """Whether the path has a fixed place, independent of where the arm starts."""
        return False

    @property
    def frames(self) -> frozenset[str]:
        """Names of the model's frames in which the path is given, besides base and tool."""
        return frozenset()

    @property
    def notes(self) -> Sequence[str]:
        """Sentences about what was taken of its file and what was not."""
        return ()

    @abstractmethod
    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        """Return the path in the world frame, for an arm that starts at a pose.

        Args:
            p_WE: Position of E at the start, shape (3,) [m]; optional for a path with a fixed
                place.
            R_WE: Orientation of E at the start, shape (3, 3); optional for a path that does not
                depend on it.
            frames: Poses X_WF of the model's frames in which the path is given, by name.

        Raises:
            InvalidInputError: If a pose that the path depends on is missing, or the path is not a
                motion that a point can follow.
        """

    def pen_is_down(self, points: Array) -> NDArray[np.bool_]:
        """Return which desired points a pen draws, shape (k,); all of them unless it is lifted.

        Args:
            points: Points of the path from its start on, shape (k, 3) [m].
        """
        return np.ones(len(points), dtype=bool)

    def placed_on(self, arm: Arm, q: Array) -> PlacedPath:
        """Return the path in the world frame, for an arm that starts in posture ``q``.

        Args:
            arm: The arm.
            q: Start posture, shape (n,) [rad].

        Raises:
            InvalidInputError: If the arm lacks the frame in which the path is given, or as `placed`
                does.
        """
        require_type("arm", arm, Arm)
        return self.placed_by(arm.kinematics(), q)

    def placed_by(self, kinematics: ArmKinematics, q: Array) -> PlacedPath:
        """Return the path in the world frame, for an arm with these kinematics.

        Arguments and errors are those of `placed_on`.
        """
        try:
            frames = {name: kinematics.X_WF(q, name) for name in self.frames}
        except InvalidInputError as error:
            raise InvalidInputError(f"path.{error}") from None
        return self.placed(kinematics.p_WE(q), kinematics.R_WE(q), frames)


# Number of times at which a path is tried when it is placed.
_CHECKS = 5


@validated
class RelativePath(Path, Passage):
    """A path given by its motion from its first pose, along the axes of a frame F."""

    offset: Annotated[
        Point,
        Meaning("Arm's start relative to the path's first point, in F, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    frame: Annotated[
        str,
        Meaning(
            "The frame F: ``base``; ``tool``, the task frame E as it is when the path begins; or "
            "the name of any frame of the model, e.g. a camera's, as it is when the run begins.",
        ),
    ] = BASE

    @property
    def frames(self) -> frozenset[str]:
        return frozenset() if self.frame in (BASE, TOOL) else frozenset((self.frame,))

    @abstractmethod
    def evaluate(self, t: float) -> Motion:
        """Return the motion of the point at time ``t`` [s].

        Before t = 0 the point rests at the start, after the end where it ends. Where a derivative
        jumps, the value after the jump is returned.

        Returns:
            Displacement from the first point [m], velocity [m/s], acceleration [m/s^2]; each
            of shape (3,), in F.

        Raises:
            InvalidInputError: If ``t`` is not finite.
        """

    def evaluate_rotation(self, t: float) -> Motion:
        """Return the rotation from the first orientation at time ``t`` [s].

        Returns:
            The rotation, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2], each
            of shape (3,), in F. A path that `turns` overrides this method.
        """
        return np.eye(3), np.zeros(3), np.zeros(3)

    def start_point(self, p_FE: Array) -> Array:
        """Return the path's first point for an arm that starts at ``p_FE``, shape (3,) [m]."""
        return p_FE - self.offset

    def start_orientation(self, R_FE: Array | None) -> Array | None:
        """Return the path's first orientation, shape (3, 3), for an arm that starts with ``R_FE``.

        None if the arm's orientation is not known.
        """
        return R_FE

    def begun_at(self, p_FE: Array) -> RelativePath:
        """Return the path for an arm that starts at ``p_FE``, shape (3,) [m].

        By default that is the path itself; a path whose displacement depends on where it begins
        overrides this method.
        """
        return self

    def _require_no_offset(self, rival: str, remedy: str = "give one of them") -> None:
        """Raise a ValueError for an ``offset`` beside another key that sets the start."""
        if self.offset.any():
            raise ValueError(
                f"offset: cannot be combined with {rival}, which also sets where the path starts; "
                f"{remedy}"
            )

    def sample(self, count: int) -> Array:
        """See `Passage.sample`; points are displacements from the first one, in F."""
        return self._sample(self.evaluate, count)

    def require_motion(self) -> None:
        """Raise an InvalidInputError unless this is a motion that a point can follow."""
        name = type(self).__name__
        require_times(name, self.duration, self.traversal)
        times = [-1.0, *np.linspace(0.0, self.traversal, _CHECKS).tolist(), 2.0 * self.traversal]
        require_values(f"{name}.evaluate", self.evaluate, "t", times, ((3,), (3,), (3,)))
        if self.turns:
            require_values(
                f"{name}.evaluate_rotation",
                self.evaluate_rotation,
                "t",
                times,
                ((3, 3), (3,), (3,)),
            )
        last = self.sample(2)[-1] if self.closed else None
        require_start(name, self.evaluate(0.0)[0], last)

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        require_pose(p_WE, R_WE)
        if p_WE is None:
            if not self.has_place or self.frame == TOOL:
                raise InvalidInputError(
                    "p_WE: must be given, for a path that begins where the arm starts"
                )
            p_WE = np.zeros(3)
        X_WF = self._frame_pose(p_WE, R_WE, frames or {})
        if X_WF is None:
            path = self.begun_at(p_WE)
            path.require_motion()
            return _PathInWorld(path, path.start_point(p_WE), path.start_orientation(R_WE))
        p_WF, R_WF = X_WF
        p_FE = R_WF.T @ (p_WE - p_WF)
        path = self.begun_at(p_FE)
        path.require_motion()
        R_FE = path.start_orientation(None if R_WE is None else R_WF.T @ R_WE)
        start = p_WF + R_WF @ path.start_point(p_FE)
        return _PathInFrame(path, start, None if R_FE is None else R_WF @ R_FE, R_WF)

    def _frame_pose(
        self, p_WE: Array, R_WE: Array | None, frames: Mapping[str, RigidTransform]
    ) -> tuple[Array, Array] | None:
        """Return origin and axes of F; None for the base."""
        if self.frame == BASE:
            return None
        if self.frame == TOOL:
            if R_WE is None:
                raise InvalidInputError("R_WE: must be given, for a path in the frame of the tool")
            return p_WE, R_WE
        if self.frame not in frames:
            raise InvalidInputError(
                f"frames: must hold the pose of {self.frame!r}, which the path is given in"
            )
        X_WF = frames[self.frame]
        return X_WF.translation(), X_WF.rotation().matrix()


@dataclass(frozen=True, eq=False)
class _PathInWorld(PlacedPath):
    """A path along the axes of W.

    Attributes:
        path: The path.
        start: First point, shape (3,) [m].
        R_WE: First orientation, shape (3, 3); None if it is not known.
    """

    path: RelativePath
    start: Array
    R_WE: Array | None

    duration = property(attrgetter("path.duration"))
    traversal = property(attrgetter("path.traversal"))
    closed = property(attrgetter("path.closed"))
    turns = property(attrgetter("path.turns"))

    @property
    def oriented(self) -> bool:
        return self.R_WE is not None

    def position(self, t: float) -> Motion:
        p, v, a = self.path.evaluate(t)
        return self.start + p, v, a

    def orientation(self, t: float) -> Motion:
        if self.R_WE is None:
            raise InvalidInputError("R_WE: must be given, for the orientation to be known")
        if not self.path.turns:
            return self.R_WE, np.zeros(3), np.zeros(3)
        R, w, alpha = self.path.evaluate_rotation(t)
        return R @ self.R_WE, w, alpha

    def knots(self, until: float) -> Array:
        return self.path.knots(until)

    def sample(self, count: int) -> Array:
        return self.start + self.path.sample(count)


def displacement_of(path: PlacedPath) -> tuple[RelativePath, Array] | None:
    """Return the path whose displacement a placed path adds to its first point, and that point.

    Paths that differ only in their first point can share the computed displacement. None for a path
    along the axes of another frame, and for one that is not a `RelativePath`.

    Args:
        path: The placed path.
    """
    return (path.path, path.start) if type(path) is _PathInWorld else None


@dataclass(frozen=True, eq=False)
class _PathInFrame(_PathInWorld):
    """A path along the axes of another frame F.

    Attributes:
        R_WF: Orientation of F, shape (3, 3).
    """

    R_WF: Array

    def position(self, t: float) -> Motion:
        p, v, a = self.path.evaluate(t)
        return self.start + self.R_WF @ p, self.R_WF @ v, self.R_WF @ a

    def orientation(self, t: float) -> Motion:
        if self.R_WE is None or not self.path.turns:
            return super().orientation(t)
        R, w, alpha = self.path.evaluate_rotation(t)
        R_WE = self.R_WF @ R @ self.R_WF.T @ self.R_WE
        return R_WE, self.R_WF @ w, self.R_WF @ alpha

    def sample(self, count: int) -> Array:
        return np.asarray(self.start + self.path.sample(count) @ self.R_WF.T)


@dataclass(frozen=True, eq=False)
class LedPath(PathOfAnother):
    """A placed path, each point of which is displaced by how far another path has led by then.

    Attributes:
        own: The path by itself.
        leader: The path that leads it.
        arm: The arm that follows that path.
        begin: Where that arm's end effector starts, in its own base, shape (3,) [m].
        R: Orientation of the leader's base in that of the path, shape (3, 3).
    """

    own: PlacedPath
    leader: PlacedPath
    arm: Arm
    begin: Array
    R: Array

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return max(self.own.duration, self.leader.duration)

    @property
    def traversal(self) -> float:
        """See `Passage.traversal`."""
        return max(self.own.traversal, self.leader.traversal)

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        p, v, a = self.own.position(t)
        p_led, v_led, a_led = self.leader.position(t)
        return p + self.R @ (p_led - self.begin), v + self.R @ v_led, a + self.R @ a_led

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        return self.own.orientation(t)

    def _breaks(self, until: float) -> list[Array | float]:
        return [*self.own._breaks(until), *self.leader._breaks(until)]

    def beside(self, t: float, p_leader: Array) -> Array:
        """Return the point at a time where the leader is in truth, shape (3,) [m].

        Args:
            t: The time [s].
            p_leader: Where the leading end effector is, in its own base, shape (3,) [m].
        """
        return np.asarray(self.own.position(t)[0] + self.R @ (p_leader - self.begin))
