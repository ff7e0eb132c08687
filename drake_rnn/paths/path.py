"""The base classes of paths: desired motions of the end effector, to be placed in the world.

- Checks of what a path returns, so that a wrong path is refused by name.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array, validated
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


# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.


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
        """Whether `orientation` is known: the path carries it, or it was placed with one."""

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
