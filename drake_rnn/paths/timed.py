"""Paths whose poses are trajectories of Drake's: how they are passed, and where they lie."""

# No postponed annotations: see `path`.
from abc import abstractmethod
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydrake.trajectories import (
    BsplineTrajectory,
    PiecewiseQuaternionSlerp,
    PiecewiseTrajectory,
)

from ..inputs.fields import Array, Flag, validated
from ..inputs.keys import Meaning
from .checks import require_time
from .path import Motion
from .relative import RelativePath
from .turning import QuaternionTurning, SlerpTurning, Turning

# Distance up to which the ends of a trajectory are the same point [m].
_CLOSED = 1e-6


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
