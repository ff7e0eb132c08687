"""Drake's own trajectories as paths.

- Paths whose poses are trajectories of Drake's: how they are passed, and where they lie.
- Orientations that vary in time, with angular velocity and acceleration.
- Paths that are given by their motion from their own first pose.
- A path that goes along with another point, such as the tool of a second arm.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from math import sqrt
from operator import attrgetter
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.trajectories import (
    BsplineTrajectory,
    PiecewisePose,
    PiecewiseQuaternionSlerp,
    PiecewiseTrajectory,
    Trajectory,
)

from ..errors import InvalidInputError
from ..inputs.fields import Array, Flag, Point, validated, zeros
from ..inputs.keys import Meaning
from ..robot.arm import Arm
from .path import (
    BASE,
    TOOL,
    Motion,
    Passage,
    Path,
    PathOfAnother,
    PlacedPath,
    require_pose,
    require_start,
    require_time,
    require_times,
    require_values,
)

# No postponed annotations: see `path`.


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


# Cosine of half the angle of a turn up to which its direction is not clear.
_HALF_TURN = 1e-6


class Turning(ABC):
    """An orientation as a function of time."""

    @abstractmethod
    def at(self, t: float) -> Motion:
        """Return the orientation at time ``t`` [s].

        Returns:
            Rotation matrix, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2],
            each of shape (3,), in the axes that the orientation refers to.
        """


class SlerpTurning(Turning):
    """Spherical linear interpolation: the angular velocity is constant between quaternions."""

    def __init__(self, trajectory: PiecewiseQuaternionSlerp) -> None:
        self._trajectory = trajectory

    def at(self, t: float) -> Motion:
        R = self._trajectory.orientation(t).rotation()
        w = np.asarray(self._trajectory.angular_velocity(t)).ravel()
        return R, w, np.zeros(3)


class QuaternionTurning(Turning):
    """A trajectory of quaternions w, x, y, z, which need not be of unit length.

    The orientation is that of q / |q|. With the product of quaternions, and v(q) the part
    x, y, z, the angular velocity is w = 2 v(q' q*) / |q|^2, since what changes |q| alone adds
    nothing to v; and w' = 2 v(q'' q*) / |q|^2 - 2 (q . q') / |q|^2 w.

    Args:
        trajectory: Quaternions, 4 rows, which do not vanish.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._q = trajectory
        self._dq, self._ddq = (trajectory.MakeDerivative(order) for order in (1, 2))

    def at(self, t: float) -> Motion:
        q, dq, ddq = (x.value(t).ravel() for x in (self._q, self._dq, self._ddq))
        square = float(q @ q)
        w = (2.0 / square) * _against(dq, q)
        alpha = (2.0 / square) * (_against(ddq, q) - float(q @ dq) * w)
        return Quaternion(q / sqrt(square)).rotation(), w, alpha


def _against(p: Array, q: Array) -> Array:
    """Return the part x, y, z of the product of ``p`` and the conjugate of ``q``, shape (3,)."""
    # Plain floats: this runs at every sample, and NumPy's overhead would take most of its time.
    (pw, px, py, pz), (qw, qx, qy, qz) = p.tolist(), q.tolist()
    return np.array(
        (
            qw * px - pw * qx - py * qz + pz * qy,
            qw * py - pw * qy - pz * qx + px * qz,
            qw * pz - pw * qz - px * qy + py * qx,
        )
    )


def align(quaternions: Array) -> Array:
    """Return quaternions with signs such that each turns from the one before by the shorter way.

    Args:
        quaternions: Shape (k, 4).

    Raises:
        ValueError: If two successive ones are half a turn apart, which has no shorter way.
    """
    signs = [1.0]
    for k, (one, other) in enumerate(pairwise(quaternions), 2):
        along = float(one @ other)
        if abs(along) < _HALF_TURN:
            raise ValueError(
                f"orientation {k}: is half a turn from the one before, either way round; give one "
                "between them"
            )
        signs.append(np.copysign(signs[-1], signs[-1] * along))
    return quaternions * np.array(signs)[:, np.newaxis]


def quaternion_rates(R: Array, w: Array, alpha: Array) -> tuple[Array, Array, Array]:
    """Return the unit quaternion of an orientation and its two derivatives, each of shape (4,).

    Args:
        R: Rotation matrix, shape (3, 3).
        w: Angular velocity, shape (3,) [rad/s].
        alpha: Angular acceleration, shape (3,) [rad/s^2].
    """
    q = RotationMatrix.ProjectToRotationMatrix(R).ToQuaternion().wxyz()
    dq = 0.5 * _times(w, q)
    return q, dq, 0.5 * _times(alpha, q) - 0.25 * float(w @ w) * q


def _times(w: Array, q: Array) -> Array:
    """Return the product of the quaternion (0, w) and ``q``, shape (4,)."""
    return np.array([-w @ q[1:], *(q[0] * w + np.cross(w, q[1:]))])


# No postponed annotations: see `path`.


# Distance up to which the ends of a trajectory are the same point [m].
_CLOSURE = 1e-6


@validated
class TimedPath(RelativePath):
    """A path that follows Drake trajectories, in the time of the run.

    Before they begin the point rests where they begin, and after their end where they end.
    """

    absolute: Annotated[
        Flag,
        Meaning(
            "Whether the poses are those of the end effector; otherwise the path is moved and "
            "turned so that it begins at the arm's start, apart from ``offset``.",
        ),
    ] = False

    def __post_init__(self) -> None:
        if self.absolute:
            self._require_no_offset("absolute", "it needs absolute: false")

    @property
    @abstractmethod
    def _positions(self) -> Any:
        """Positions [m], 3 rows and one column, with two derivatives."""

    @property
    @abstractmethod
    def _quaternions(self) -> Any:
        """Orientations, see `TrajectoryPath`; None for one that does not change."""

    @property
    def begins(self) -> float:
        """Time at which the trajectory begins [s]."""
        return self._begin

    @property
    def duration(self) -> float:
        """Time at which the trajectory ends [s]."""
        return self._finish

    @property
    def closed(self) -> bool:
        """Whether the trajectory ends where it began."""
        way = self._at(self._finish) - self._at(self._begin)
        return bool(np.linalg.norm(way) < _CLOSURE)

    @property
    def turns(self) -> bool:
        """Whether the trajectory gives an orientation."""
        return self._quaternions is not None

    @property
    def has_place(self) -> bool:
        """Whether the poses are those of the end effector."""
        return self.absolute

    @cached_property
    def _begin(self) -> float:
        return float(self._positions.start_time())

    @cached_property
    def _finish(self) -> float:
        return float(self._positions.end_time())

    @cached_property
    def _derivatives(self) -> tuple[Any, Any]:
        return self._positions.MakeDerivative(1), self._positions.MakeDerivative(2)

    @cached_property
    def _turning(self) -> Turning:
        if isinstance(self._quaternions, PiecewiseQuaternionSlerp):
            return SlerpTurning(self._quaternions)
        return QuaternionTurning(self._quaternions)

    @cached_property
    def _first(self) -> Array:
        """First position, shape (3,) [m]."""
        return self._at(self._begin)

    @cached_property
    def _first_orientation(self) -> Array:
        """First orientation, shape (3, 3)."""
        return self._turning.at(self._begin)[0]

    def _at(self, t: float) -> Array:
        return np.array(self._positions.value(t)).ravel()

    def evaluate(self, t: float) -> Motion:
        require_time(t)
        if not self._begin <= t < self._finish:
            edge = self._begin if t < self._begin else self._finish
            return self._at(edge) - self._first, np.zeros(3), np.zeros(3)
        rate, gain = self._derivatives
        v, a = np.array(rate.value(t)).ravel(), np.array(gain.value(t)).ravel()
        return self._at(t) - self._first, v, a

    def evaluate_rotation(self, t: float) -> Motion:
        if self._quaternions is None:
            return super().evaluate_rotation(t)
        require_time(t)
        back = self._first_orientation.T
        if not self._begin <= t < self._finish:
            edge = self._begin if t < self._begin else self._finish
            return self._turning.at(edge)[0] @ back, np.zeros(3), np.zeros(3)
        R, w, alpha = self._turning.at(t)
        return R @ back, w, alpha

    def start_point(self, p_FE: Array) -> Array:
        """See `RelativePath.start_point`; with ``absolute`` it is the trajectory's first point."""
        return self._first.copy() if self.absolute else super().start_point(p_FE)

    def start_orientation(self, R_FE: Array | None) -> Array | None:
        return self._first_orientation if self.absolute and self.turns else R_FE

    def _breaks(self, until: float) -> list[Array | float]:
        inner = [breaks(part) for part in (self._positions, self._quaternions)]
        return [0.0, self._begin, self._finish, *inner]


def breaks(trajectory: Any) -> Array:
    """Return the times at which a derivative of a trajectory may jump [s]."""
    if isinstance(trajectory, PiecewiseTrajectory):
        return np.array(trajectory.get_segment_times(), dtype=float)
    if isinstance(trajectory, BsplineTrajectory):
        return np.unique(trajectory.basis().knots())
    return np.zeros(0)


# No postponed annotations: see `path`.


# Time before a break at which a trajectory is compared with the break [s], and the least jump.
_BEFORE, _JUMP = 1e-9, 1e-6


@validated
class TrajectoryPath(TimedPath):
    """A trajectory of Drake's, of the end effector's position and perhaps its orientation.

    Args:
        trajectory: Positions [m] in 3 rows and one column, with two derivatives; or a
            `PiecewisePose`, which gives the orientation as well.
        orientation: Orientations: a `PiecewiseQuaternionSlerp`, or any trajectory of quaternions
            w, x, y, z in 4 rows with two derivatives; they need not be of unit length. None for an
            orientation that does not change.
        absolute: See `TimedPath`; the poses are those of the end effector by default.
    """

    trajectory: Trajectory
    orientation: Trajectory | None = None
    absolute: Flag = True

    def __post_init__(self) -> None:
        if isinstance(self.trajectory, PiecewisePose) and self.orientation is not None:
            raise ValueError("orientation: a PiecewisePose has its own; leave it out")
        super().__post_init__()
        _require_vectors("trajectory", self._positions, 3)
        if self._quaternions is not None:
            _require_vectors("orientation", self._quaternions, 4)
            if _span(self._quaternions) != _span(self._positions):
                raise ValueError(
                    "orientation: must begin and end with the trajectory, at "
                    f"{_span(self._positions)} s, not {_span(self._quaternions)}"
                )
            _require_connected("orientation", self._quaternions)
        _require_connected("trajectory", self._positions)
        if not 0.0 <= self._begin < self._finish:
            raise ValueError(
                "trajectory: must begin at 0 s or later and end after that, not last from "
                f"{self._begin:g} to {self._finish:g} s"
            )

    @cached_property
    def _positions(self) -> Any:
        if isinstance(self.trajectory, PiecewisePose):
            return self.trajectory.get_position_trajectory()
        return self.trajectory

    @cached_property
    def _quaternions(self) -> Any:
        if isinstance(self.trajectory, PiecewisePose):
            return self.trajectory.get_orientation_trajectory()
        return self.orientation


def as_path(motion: Any) -> Any:
    """Return a trajectory of Drake's as a path; anything else as it is."""
    return TrajectoryPath(trajectory=motion) if isinstance(motion, Trajectory) else motion


def _span(trajectory: Any) -> tuple[float, float]:
    return trajectory.start_time(), trajectory.end_time()


def _require_vectors(name: str, trajectory: Any, rows: int) -> None:
    """Raise a ValueError unless a trajectory has this many rows and one column, and derivatives."""
    kind = type(trajectory).__name__
    shape = _ask(name, kind, lambda: (trajectory.rows(), trajectory.cols()))
    if shape != (rows, 1):
        raise ValueError(
            f"{name}: must have {rows} rows and 1 column, not {shape[0]} and {shape[1]}"
        )
    if not trajectory.has_derivative():
        raise ValueError(f"{name}: a {kind} has no derivatives; give one that has")
    begin, finish = _ask(name, kind, lambda: _span(trajectory))
    if not np.isfinite([begin, finish]).all():
        raise ValueError(f"{name}: must begin and end, not last from {begin:g} to {finish:g} s")
    for t in np.linspace(begin, finish, 5).tolist():
        for order in range(3):
            value = _ask(name, kind, partial(trajectory.EvalDerivative, t, order))
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: is not finite at t = {t:g} s")


def _require_connected(name: str, trajectory: Any) -> None:
    """Raise a ValueError if a trajectory jumps, which its derivatives do not tell."""
    for t in breaks(trajectory)[1:-1].tolist():
        before = trajectory.value(t - _BEFORE * max(t, 1.0))
        jump = float(np.linalg.norm(trajectory.value(t) - before))
        if jump > _JUMP:
            raise ValueError(
                f"{name}: jumps by {jump:.3g} at t = {t:g} s, which no arm can follow; give one "
                "that is continuous, e.g. PiecewisePolynomial.FirstOrderHold"
            )


def _ask(name: str, kind: str, question: Callable[[], Any]) -> Any:
    """Return the answer of a trajectory; Drake's errors name the key and the class."""
    try:
        return question()
    # Drake exits where a condition of its own code fails, e.g. without any segment.
    except (RuntimeError, SystemExit) as error:
        raise ValueError(f"{name}: this {kind} cannot be used: {error}") from None
