"""Drake's own trajectories as paths."""

# No postponed annotations: see `path`.
from collections.abc import Callable
from functools import cached_property, partial
from math import isfinite
from typing import Any

import numpy as np
from pydrake.trajectories import (
    BsplineTrajectory,
    PiecewisePose,
    PiecewiseQuaternionSlerp,
    PiecewiseTrajectory,
    Trajectory,
)

from ..errors import InvalidInputError
from ..inputs.fields import Array, validated
from .path import Motion
from .relative import RelativePath
from .turning import QuaternionTurning, SlerpTurning, Turning

# Distance up to which the ends of a trajectory are the same point [m].
_CLOSED = 1e-6


@validated
class TrajectoryPath(RelativePath):
    """A trajectory of Drake's, of the end effector's position and perhaps its orientation.

    Its times are those of the run. Before the trajectory begins the point rests where it begins,
    and after its end where it ends.

    Args:
        trajectory: Positions [m] in 3 rows and one column, with two derivatives; or a
            `PiecewisePose`, which gives the orientation as well.
        orientation: Orientations: a `PiecewiseQuaternionSlerp`, or any trajectory of quaternions
            w, x, y, z in 4 rows with two derivatives; they need not be of unit length. None for an
            orientation that does not change.
        absolute: Whether the poses are those of the end effector; otherwise the path is moved and
            turned so that it begins at the arm's start, apart from ``offset``.
    """

    trajectory: Trajectory
    orientation: Trajectory | None = None
    absolute: bool = True

    def __post_init__(self) -> None:
        if isinstance(self.trajectory, PiecewisePose) and self.orientation is not None:
            raise ValueError("orientation: a PiecewisePose has its own; leave it out")
        if self.absolute and self.offset.any():
            raise ValueError(
                "offset: cannot be combined with absolute, which also sets where the path starts; "
                "give absolute=False"
            )
        _require_vectors("trajectory", self._positions, 3)
        if self._quaternions is not None:
            _require_vectors("orientation", self._quaternions, 4)
            if _span(self._quaternions) != _span(self._positions):
                raise ValueError(
                    "orientation: must begin and end with the trajectory, at "
                    f"{_span(self._positions)} s, not {_span(self._quaternions)}"
                )
        if not 0.0 <= self._begin < self._finish:
            raise ValueError(
                "trajectory: must begin at 0 s or later and end after that, not last from "
                f"{self._begin:g} to {self._finish:g} s"
            )

    @property
    def duration(self) -> float:
        """Time at which the trajectory ends [s]."""
        return self._finish

    @property
    def closed(self) -> bool:
        """Whether the trajectory ends where it began."""
        way = self._at(self._finish) - self._at(self._begin)
        return bool(np.linalg.norm(way) < _CLOSED)

    @property
    def turns(self) -> bool:
        """Whether the trajectory gives an orientation."""
        return self._quaternions is not None

    @property
    def has_place(self) -> bool:
        """Whether the poses are those of the end effector."""
        return self.absolute

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
        """See `RelativePath.evaluate`."""
        _require_finite(t)
        if not self._begin <= t < self._finish:
            edge = self._begin if t < self._begin else self._finish
            return self._at(edge) - self._first, np.zeros(3), np.zeros(3)
        rate, gain = self._derivatives
        v, a = np.array(rate.value(t)).ravel(), np.array(gain.value(t)).ravel()
        return self._at(t) - self._first, v, a

    def evaluate_rotation(self, t: float) -> Motion:
        """See `RelativePath.evaluate_rotation`."""
        if self._quaternions is None:
            return super().evaluate_rotation(t)
        _require_finite(t)
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
        """See `RelativePath.start_orientation`."""
        return self._first_orientation if self.absolute and self.turns else R_FE

    def knots(self, until: float) -> Array:
        """See `RelativePath.knots`."""
        parts = [np.array([0.0, self._begin, self._finish])]
        parts += [_breaks(part) for part in (self._positions, self._quaternions)]
        times = np.unique(np.concatenate(parts))
        return times[times <= until]


def as_path(motion: Any) -> Any:
    """Return a trajectory of Drake's as a path; anything else as it is."""
    return TrajectoryPath(trajectory=motion) if isinstance(motion, Trajectory) else motion


def _span(trajectory: Any) -> tuple[float, float]:
    return trajectory.start_time(), trajectory.end_time()


def _breaks(trajectory: Any) -> Array:
    """Return the times at which a derivative of a trajectory may jump [s]."""
    if isinstance(trajectory, PiecewiseTrajectory):
        return np.array(trajectory.get_segment_times(), dtype=float)
    if isinstance(trajectory, BsplineTrajectory):
        return np.unique(trajectory.basis().knots())
    return np.zeros(0)


def _require_vectors(name: str, trajectory: Any, rows: int) -> None:
    """Raise a ValueError unless a trajectory has this many rows and one column, and derivatives."""
    kind = type(trajectory).__name__
    shape = _asked(name, kind, lambda: (trajectory.rows(), trajectory.cols()))
    if shape != (rows, 1):
        raise ValueError(
            f"{name}: must have {rows} rows and 1 column, not {shape[0]} and {shape[1]}"
        )
    if not trajectory.has_derivative():
        raise ValueError(f"{name}: a {kind} has no derivatives; give one that has")
    begin, finish = _asked(name, kind, lambda: _span(trajectory))
    for t in np.linspace(begin, finish, 5).tolist():
        for order in range(3):
            value = _asked(name, kind, partial(trajectory.EvalDerivative, t, order))
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: is not finite at t = {t:g} s")


def _asked(name: str, kind: str, question: Callable[[], Any]) -> Any:
    """Return the answer of a trajectory; Drake's errors name the key and the class."""
    try:
        return question()
    except RuntimeError as error:
        raise ValueError(f"{name}: this {kind} cannot be used: {error}") from None


def _require_finite(t: float) -> None:
    if not isfinite(t):
        raise InvalidInputError(f"t: must be finite, not {t}")
