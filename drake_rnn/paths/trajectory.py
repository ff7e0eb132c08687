"""Drake's own trajectories as paths.

- Paths whose poses are trajectories of Drake's: how they are passed, and where they lie.
- Orientations that vary in time, with angular velocity and acceleration.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property, partial
from itertools import pairwise
from math import sqrt
from typing import Annotated, Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.trajectories import (
    BsplineTrajectory,
    PiecewisePose,
    PiecewiseQuaternionSlerp,
    PiecewiseTrajectory,
    Trajectory,
)

from ..inputs.fields import Array, Flag, validated
from ..inputs.keys import Meaning
from .path import Motion, RelativePath, require_time

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
