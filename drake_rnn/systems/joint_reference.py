"""Future desired joint positions as a signal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.arguments import checked, function, number, whole
from ..inputs.fields import Array
from ..laws.parts.damped_inverse import damped_joint_velocity
from ..paths import Path, PlacedPath
from ..robot.arm import Arm
from ..robot.task import named_task
from .block import Block

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


def held_posture(q: Array) -> PositionsAt:
    """Return the joint positions of a posture ``q``, shape (n,) [rad], desired at all times."""
    posture = np.array(q, dtype=float)
    return lambda times: np.broadcast_to(posture, (times.size, posture.size))


def followed_path(
    path: Path | PlacedPath,
    arm: Arm,
    start: Array,
    until: float,
    task: str = "xyz",
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
    followed = named_task(task)
    if followed.with_orientation:
        raise InvalidInputError(f"task: may be xyz, xy for a joint reference, not {task!r}")
    if step * _FEEDBACK >= 1.0:
        raise InvalidInputError(f"step: must be below {1.0 / _FEEDBACK:g} s, not {step:g}")
    kinematics = arm.kinematics()
    q = np.array(start, dtype=float)
    placed = path.placed_on(arm, q) if isinstance(path, Path) else path

    def desired(t: float) -> Array:
        return followed.position(placed.position(t)[0])

    times = step * np.arange(int(np.ceil(until / step)) + 1)
    positions = np.empty((times.size, q.size))
    ahead = desired(0.0)
    for k, t in enumerate(times.tolist()):
        positions[k] = q
        now, ahead = ahead, desired(t + step)
        error = now - followed.position(kinematics.p_WE(q))
        v_WE = _FEEDBACK * error + (ahead - now) / step
        q = q + step * damped_joint_velocity(followed.J(kinematics, q), v_WE, _DAMPING)

    def positions_at(at: Array) -> Array:
        where = np.clip(np.asarray(at) / step, 0.0, times.size - 1.0)
        before = np.minimum(where.astype(np.intp), times.size - 2)
        share = (where - before)[:, np.newaxis]
        return np.asarray((1.0 - share) * positions[before] + share * positions[before + 1])

    return positions_at
