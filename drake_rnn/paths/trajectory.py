"""Drake's own trajectories as paths."""

# No postponed annotations: see `path`.
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np
from pydrake.trajectories import PiecewisePose, Trajectory

from ..inputs.fields import Flag, validated
from .timed import TimedPath, breaks

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
    shape = _asked(name, kind, lambda: (trajectory.rows(), trajectory.cols()))
    if shape != (rows, 1):
        raise ValueError(
            f"{name}: must have {rows} rows and 1 column, not {shape[0]} and {shape[1]}"
        )
    if not trajectory.has_derivative():
        raise ValueError(f"{name}: a {kind} has no derivatives; give one that has")
    begin, finish = _asked(name, kind, lambda: _span(trajectory))
    if not np.isfinite([begin, finish]).all():
        raise ValueError(f"{name}: must begin and end, not last from {begin:g} to {finish:g} s")
    for t in np.linspace(begin, finish, 5).tolist():
        for order in range(3):
            value = _asked(name, kind, partial(trajectory.EvalDerivative, t, order))
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


def _asked(name: str, kind: str, question: Callable[[], Any]) -> Any:
    """Return the answer of a trajectory; Drake's errors name the key and the class."""
    try:
        return question()
    # Drake exits where a condition of its own code fails, e.g. without any segment.
    except (RuntimeError, SystemExit) as error:
        raise ValueError(f"{name}: this {kind} cannot be used: {error}") from None
