"""Desired motion of the end effector as signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pydrake.systems.framework import Context
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..inputs.numbers import is_number
from ..paths import Path, PlacedPath, as_path
from ..robot.task import named_task
from ..signals import ORIENTATION_OF_PATH, POSITION_OF_PATH, SIGNALS, DelayedPath, Signal, View
from .block import Block


class PathSource(Block):
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
        delay: Delay of all outputs [s]; until then they rest at the path's start.

    Raises:
        InvalidInputError: If ``preview`` or ``delay`` is negative, infinite or not a number, or the
            path cannot be placed, see `Path.placed`.
    """

    def __init__(
        self,
        path: Path | PlacedPath | Trajectory,
        p_WE: Array | None = None,
        task: str = "xyz",
        R_WE: Array | None = None,
        preview: float | None = None,
        delay: float = 0.0,
    ) -> None:
        super().__init__()
        if preview is not None:
            require_time("preview", preview)
        require_time("delay", delay)
        self.preview, self.delay = preview, delay
        self.placed = _placed(path, p_WE, R_WE)
        about = named_task(task)
        self._view = View(about, path=DelayedPath(self.placed, delay))
        self._lengths = {"axes": len(about.axes)}
        at_time = {self.time_ticket()}
        self._declare(POSITION_OF_PATH, at_time)
        if self.placed.oriented:
            # An orientation that does not vary is computed once.
            tickets = at_time if self.placed.turns else {self.nothing_ticket()}
            self._declare(ORIENTATION_OF_PATH, tickets)

    def _declare(self, names: Sequence[str], tickets: set[Any]) -> None:
        """Declare the outputs of a motion and its derivatives, now and, if asked for, ahead."""
        signals = [SIGNALS[name] for name in names]
        ports = [(signal.name, signal, 0.0) for signal in signals]
        if self.preview is not None:
            ports += [(signal.ahead, signal, self.preview) for signal in signals]
        for name, signal, ahead in ports:
            calc = _port(self._view, signal, ahead)
            self.DeclareVectorOutputPort(name, signal.size(**self._lengths), calc, tickets)


def _port(view: View, signal: Signal, ahead: float) -> Callable[[Context, Any], None]:
    """Return what computes a signal of the path, ``ahead`` [s] from now."""
    function = signal.function
    assert function is not None

    def calc(context: Context, output: Any) -> None:
        output.set_value(function(view, None, None, context.get_time() + ahead).ravel())

    return calc


def require_time(name: str, value: Any) -> None:
    """Raise an InvalidInputError if a value is no time of 0 or more.

    Args:
        name: What it is, for the message.
        value: The value.
    """
    if not is_number(value) or value < 0.0:
        raise InvalidInputError(f"{name}: must be a time of 0 or more, not {short(value)}")


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
