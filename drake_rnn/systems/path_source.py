"""Desired motion of the end effector as signals."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..paths import Path, PlacedPath, as_path
from ..robot.task import named_task

Port = Callable[[Context, Any], None]

_POSITION = ("p_WE_desired", "v_WE_desired", "a_WE_desired")
_POSITION_AHEAD = ("p_preview", "v_preview", "a_preview")
_ORIENTATION = ("R_WE_desired", "w_WE_desired", "alpha_WE_desired")
_ORIENTATION_AHEAD = ("R_preview", "w_preview", "alpha_preview")


class PathSource(LeafSystem):
    """Source of a path as signals.

    Outputs are ``p_WE_desired``, ``v_WE_desired`` and ``a_WE_desired``, shape (m,)
    [m, m/s, m/s^2]. Where the desired orientation is known, there are also ``R_WE_desired``,
    shape (9,), a flattened rotation matrix, and ``w_WE_desired`` and ``alpha_WE_desired``, the
    angular velocity of E in W and its derivative, shape (3,) [rad/s, rad/s^2].

    Args:
        path: Path of the end effector; one that has been placed, without ``p_WE`` and ``R_WE``; or
            a trajectory of Drake's, as `drake_rnn.TrajectoryPath` takes it.
        p_WE: Start position of the end effector, shape (3,) [m]; None for a path with a place of
            its own.
        task: A key of `drake_rnn.robot.task.TASKS`, which determines the m axes.
        R_WE: Start orientation of the end effector, shape (3, 3): the one to hold, or from which
            the path turns it; None if the orientation does not matter, or the path alone
            determines it.
        preview: Time ahead [s] of the outputs ``p_preview``, ``v_preview``, ``a_preview`` and,
            with an orientation, ``R_preview``, ``w_preview`` and ``alpha_preview``; None for no
            such outputs.

    Raises:
        InvalidInputError: If ``preview`` is negative, infinite or not a number, or the path cannot
            be placed, see `Path.placed`.
    """

    def __init__(
        self,
        path: Path | PlacedPath | Trajectory,
        p_WE: Array | None = None,
        task: str = "xyz",
        R_WE: Array | None = None,
        preview: float | None = None,
    ) -> None:
        super().__init__()
        if preview is not None and not (isinstance(preview, Real) and 0.0 <= preview < np.inf):
            raise InvalidInputError(f"preview: must be a time of 0 or more, not {preview!r}")
        self.preview = preview
        self.placed = _placed(path, p_WE, R_WE)
        self._axes = list(named_task(task).axes)
        self._declare(_POSITION, 0.0)
        if preview is not None:
            self._declare(_POSITION_AHEAD, preview)
        if self.placed.oriented:
            self._declare_orientation(_ORIENTATION, 0.0)
            if preview is not None:
                self._declare_orientation(_ORIENTATION_AHEAD, preview)

    def _declare(self, names: tuple[str, ...], ahead: float) -> None:
        """Declare the outputs of the position and its derivatives, ``ahead`` [s] from now."""
        sizes, tickets = [len(self._axes)] * 3, {self.time_ticket()}
        for name, size, port in zip(names, sizes, _ports(self._position_at, ahead), strict=True):
            self.DeclareVectorOutputPort(name, size, port, tickets)

    def _declare_orientation(self, names: tuple[str, ...], ahead: float) -> None:
        """Declare the outputs of the orientation and its derivatives, ``ahead`` [s] from now."""
        # An orientation that does not vary is computed once.
        tickets = {self.time_ticket() if self.placed.turns else self.nothing_ticket()}
        ports = _ports(self._orientation_at, ahead)
        for name, size, port in zip(names, (9, 3, 3), ports, strict=True):
            self.DeclareVectorOutputPort(name, size, port, tickets)

    def _position_at(self, t: float) -> list[Array]:
        values = self.placed.position(self._path_time(t))
        return [*values] if len(self._axes) == 3 else [value[self._axes] for value in values]

    def _orientation_at(self, t: float) -> list[Array]:
        R, w, alpha = self.placed.orientation(self._path_time(t))
        return [R.ravel(), w, alpha]

    def _path_time(self, t: float) -> float:
        """Return the path's own time at time ``t`` of the signals [s]."""
        return t


def _ports(motion: Callable[[float], list[Array]], ahead: float) -> list[Port]:
    """Return what computes the outputs of a motion at ``ahead`` [s] from now."""
    # The three ports evaluate the path once per time.
    memo: list[Any] = [np.nan, []]

    def port(order: int) -> Port:
        def calc(context: Context, output: Any) -> None:
            t = context.get_time() + ahead
            if memo[0] != t:
                memo[:] = t, motion(t)
            output.set_value(memo[1][order])

        return calc

    return [port(order) for order in range(3)]


def _placed(path: Any, p_WE: Array | None, R_WE: Array | None) -> PlacedPath:
    path = as_path(path)
    require_type("path", path, Path, PlacedPath, Trajectory)
    if isinstance(path, Path):
        return path.placed(p_WE, R_WE)
    placed: PlacedPath = path
    if p_WE is not None or R_WE is not None:
        raise InvalidInputError(
            "p_WE: must be left out, with R_WE, for a path that has been placed"
        )
    return placed
