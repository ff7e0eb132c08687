"""What is measured of a motion, the same for every scheme."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from drake_rnn import Array
from drake_rnn.robot.rotation import rotation_error
from peer_schemes.scheme import Motion
from peer_schemes.tasks import Task

#: Position error below which a motion has settled [m].
SETTLED = 1e-3


class Figures(NamedTuple):
    """Figures of a motion; bounds are those of held velocities, over the whole run.

    Attributes:
        error_max, error_rms: Position error in the window [m].
        turned_max: Orientation error in the window [rad].
        settling: Time after which the position error stays below `SETTLED` [s]; infinite if never.
        velocity, acceleration: Largest ratio to a joint's bound; the acceleration is that of the
            differences of held velocities, from rest.
        beyond: Largest excess over a position limit [rad].
        jerk: Largest second difference of the held velocities of a joint [rad/s^3].
        drift: Largest way of a joint over the last lap [rad].
    """

    error_max: float
    error_rms: float
    turned_max: float
    settling: float
    velocity: float
    acceleration: float
    beyond: float
    jerk: float
    drift: float


def figures_of(motion: Motion, task: Task) -> Figures:
    """Return the figures of a motion; the poses are Drake's."""
    q, v, h = motion.position, motion.velocity, task.period
    kinematics, limits = task.arm.kinematics(), task.limits
    p_WE = np.array([kinematics.p_WE(each) for each in q])
    error = np.linalg.norm(p_WE - task.p_WE[: len(q)], axis=1)
    R_WE = [kinematics.R_WE(each) for each in q[task.window]] if task.oriented else []
    turned = [
        float(np.linalg.norm(rotation_error(R, desired)))
        for R, desired in zip(R_WE, task.R_WE[: len(q)][task.window], strict=False)
    ]
    acceleration = np.diff(v, axis=0, prepend=np.zeros((1, v.shape[1]))) / h
    inside = error[task.window]
    return Figures(
        error_max=float(inside.max()),
        error_rms=float(np.sqrt(np.mean(inside**2))),
        turned_max=max(turned, default=np.nan),
        settling=_settling(error, h),
        velocity=float((np.abs(v) / limits.velocity).max()),
        acceleration=float((np.abs(acceleration) / limits.acceleration).max()),
        beyond=float(max((limits.position_lower - q).max(), (q - limits.position_upper).max(), 0)),
        jerk=float(np.abs(np.diff(acceleration, axis=0)).max() / h),
        drift=float(np.abs(q[-1] - q[-1 - task.lap]).max()),
    )


def _settling(error: Array, period: float) -> float:
    far = np.flatnonzero(~(error < SETTLED))
    if far.size == 0:
        return 0.0
    return float("inf") if far[-1] == error.size - 1 else float((far[-1] + 1) * period)
