"""Sources of signals: paths, joint references and targets.

- Desired motion of the end effector as signals.
- Future desired joint positions as a signal.
- Joint targets as a signal: each at the sample at which it has come.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, function, number, whole
from ..inputs.messages import is_number, require_type, short
from ..laws.pseudoinverse import damped_joint_velocity
from ..paths import JointTargets, Path, PlacedPath, as_path
from ..robot.arm import Arm
from ..robot.task import TaskSection, named_task
from ..signals import (
    ORIENTATION_OF_PATH,
    POSITION_OF_PATH,
    SIGNALS,
    DelayedPath,
    Signal,
    View,
)
from .block import AutoDiffFunctions, Block, Calc, constant_time, varies


class PreviewSource(Block):
    """Base class of sources of a path that show it ahead of time as well.

    Attributes:
        preview: The time ahead [s]; None if it shows nothing ahead.
    """

    preview: float | None


class PathSource(PreviewSource):
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

    role = "reference"

    def __init__(
        self,
        path: Path | PlacedPath | Trajectory,
        p_WE: Array | None = None,
        task: TaskSection = "xyz",
        R_WE: Array | None = None,
        preview: float | None = None,
        delay: float = 0.0,
    ) -> None:
        super().__init__()
        if preview is not None:
            require_time("preview", preview)
        require_time("delay", delay)
        self.preview, self.delay = preview, delay
        self.placed = _place(path, p_WE, R_WE)
        about = named_task(task)
        self._view = View(about, path=DelayedPath(self.placed, delay))
        self._lengths = {"axes": about.lengths["axes"]}
        self._signals: dict[str, tuple[Signal, float]] = {}
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
            self._signals[name] = (signal, ahead)

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        view = self._view
        return AutoDiffFunctions(
            {name: _autodiff_port(name, view, *each) for name, each in self._signals.items()}
        )


def _port(view: View, signal: Signal, ahead: float) -> Callable[[Context, Any], None]:
    """Return what computes a signal of the path, ``ahead`` [s] from now."""
    function = signal.function
    assert function is not None

    def calc(context: Context, output: Any) -> None:
        output.set_value(function(view, None, None, context.get_time() + ahead).ravel())

    return calc


def _autodiff_port(name: str, view: View, signal: Signal, ahead: float) -> Calc:
    """Return what computes a signal of the path, ``ahead`` [s] from now, and its rate by time."""
    function, rate = signal.function, _RATES.get(signal.name)
    assert function is not None

    def calc(context: Context) -> Any:
        t = context.get_time()
        if rate is None or not varies(t):
            return function(view, None, None, constant_time(context, name) + ahead)
        at = t.value() + ahead
        return function(view, None, None, at) + rate(view, at) * (t - t.value())

    return calc


def _turning(view: View, t: float) -> Array:
    """Return the rate of R_WE_desired, shape (3, 3) [1/s]."""
    R, w, _ = view.path.orientation(t)
    return np.cross(w, R, axisb=0, axisc=0)


#: Rates by time of the signals of a path; those of accelerations are not known.
_RATES: dict[str, Callable[[View, float], Array]] = {
    POSITION_OF_PATH[0]: lambda view, t: view.desired(t)[1],
    POSITION_OF_PATH[1]: lambda view, t: view.desired(t)[2],
    ORIENTATION_OF_PATH[0]: _turning,
    ORIENTATION_OF_PATH[1]: lambda view, t: view.path.orientation(t)[2],
}


def require_time(name: str, value: Any) -> None:
    """Raise an InvalidInputError if a value is no time of 0 or more.

    Args:
        name: What it is, for the message.
        value: The value.
    """
    if not is_number(value) or value < 0.0:
        raise InvalidInputError(f"{name}: must be a time of 0 or more, not {short(value)}")


def _place(path: Any, p_WE: Array | None, R_WE: Array | None) -> PlacedPath:
    path = as_path(path)
    require_type("path", path, Path, PlacedPath, Trajectory)
    if isinstance(path, Path):
        return path.placed(p_WE, R_WE)
    placed_path: PlacedPath = path
    if p_WE is not None or R_WE is not None:
        raise InvalidInputError(
            "p_WE: must be left out, with R_WE, for a path that has been placed"
        )
    return placed_path


# Gain of the position error [1/s] and damping of the pseudoinverse [m].
_FEEDBACK, _DAMPING = 10.0, 1e-6

#: Function from times, shape (k,) [s], to joint positions, shape (k, n) [rad].
# Positions that a law may see ahead.
_MOST = 100_000
PositionsAt = Callable[[Array], Array]


class JointReference(Block):
    """Source of ``position_preview``, the future desired joint positions, shape (count, n) [rad].

    At time t its rows are the positions at t + interval, t + 2 interval, ... t + count interval.
    The output is flattened.

    Args:
        positions_at: Desired joint positions as a function of time.
        n: Number of joints.
        interval: Time between two positions [s].
        count: Number of positions.

    Raises:
        InvalidInputError: If the interval is not positive, ``count`` is less than 1, or
            ``positions_at`` returns an array of another shape.
    """

    role = "reference"

    @checked(
        positions_at=function("times"),
        n=whole(1),
        interval=number(above=0.0),
        count=whole(1, _MOST),
    )
    def __init__(self, positions_at: PositionsAt, n: int, interval: float, count: int) -> None:
        super().__init__()
        self.interval = interval
        ahead: Array = interval * np.arange(1.0, count + 1.0)
        shape = np.shape(positions_at(ahead))
        if shape != (count, n):
            raise InvalidInputError(
                f"positions_at: must give shape {(count, n)} for {count} times, not {shape}"
            )

        def preview(context: Context, output: Any) -> None:
            output.set_value(positions_at(context.get_time() + ahead).ravel())

        self.DeclareVectorOutputPort("position_preview", count * n, preview, {self.time_ticket()})
        self._positions_at, self._ahead = positions_at, ahead

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        positions_at, ahead, name = self._positions_at, self._ahead, "position_preview"
        return AutoDiffFunctions(
            {name: lambda context: positions_at(constant_time(context, name) + ahead)}
        )


def held_posture(q: Array) -> PositionsAt:
    """Return the joint positions of a posture ``q``, shape (n,) [rad], desired at all times."""
    posture = np.array(q, dtype=float)
    return lambda times: np.broadcast_to(posture, (times.size, posture.size))


def followed_path(
    path: Path | PlacedPath,
    arm: Arm,
    start: Array,
    until: float,
    task: TaskSection = "xyz",
    step: float = 1e-3,
) -> PositionsAt:
    """Return the joint positions with which the damped pseudoinverse follows a path.

    The positions are computed once, sampled every ``step``, with the difference quotient of the
    desired position fed forward and the position error fed back. Between samples they are
    interpolated linearly; before the first and after the last sample they are constant.

    Args:
        path: Path of the end effector; or one that has been placed.
        arm: The arm.
        start: Posture at t = 0, shape (n,) [rad].
        until: End time [s].
        task: A key of `drake_rnn.robot.task.TASKS`, without orientation.
        step: Sampling period [s].

    Raises:
        InvalidInputError: If there is no such task, or it includes the orientation.
    """
    task_size = named_task(task)
    if task_size.with_orientation:
        raise InvalidInputError(f"task: may be xyz, xy for a joint reference, not {task!r}")
    if step * _FEEDBACK >= 1.0:
        raise InvalidInputError(f"step: must be below {1.0 / _FEEDBACK:g} s, not {step:g}")
    kinematics = arm.kinematics()
    q = np.array(start, dtype=float)
    placed_path = path.placed_on(arm, q) if isinstance(path, Path) else path

    def desired_position(t: float) -> Array:
        return task_size.position(placed_path.position(t)[0])

    times = step * np.arange(int(np.ceil(until / step)) + 1)
    positions = np.empty((times.size, q.size))
    ahead = desired_position(0.0)
    for k, t in enumerate(times.tolist()):
        positions[k] = q
        now, ahead = ahead, desired_position(t + step)
        error = now - task_size.position(kinematics.p_WE(q))
        v_WE = _FEEDBACK * error + (ahead - now) / step
        q = q + step * damped_joint_velocity(task_size.J(kinematics, q), v_WE, _DAMPING)

    def positions_at(at: Array) -> Array:
        where = np.clip(np.asarray(at) / step, 0.0, times.size - 1.0)
        before = np.minimum(where.astype(np.intp), times.size - 2)
        share = (where - before)[:, np.newaxis]
        return np.asarray((1.0 - share) * positions[before] + share * positions[before + 1])

    return positions_at


class TargetSource(Block):
    """Source of joint targets: the output ``target``, shape (n,) [rad].

    At a sample it is the newest target that has come since the sample before; NaN if none has.

    Args:
        targets: The targets, with the times at which they come.
        period: Sampling period of the controller [s].
    """

    def __init__(self, targets: JointTargets, period: float) -> None:
        super().__init__()
        size = targets.position.shape[1]
        none = np.full(size, np.nan)

        def newest_target(context: Context, output: Any) -> None:
            sample = round(context.get_time() / period)
            before, newest = targets.newest(period * np.array((sample - 1, sample))).tolist()
            output.set_value(none if newest == before else targets.position[newest])

        self.DeclareVectorOutputPort("target", size, newest_target, {self.time_ticket()})
