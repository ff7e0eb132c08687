"""What is measured of motions among obstacles, by the same judge for every scheme."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_rnn import Array
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.scheme import Motion

#: Error below which an arm is on its path at the end [m].
BACK = 1e-5
#: Share of its bound that an acceleration has to pass on both sides of zero to count as a reversal.
NOTICED = 0.01


class Judged(NamedTuple):
    """Figures of a motion, or of several; bounds are those of held velocities.

    Attributes:
        scenes: Number of motions.
        collided: Number of those in which a distance is negative, between samples too.
        failures: Number of samples for which the scheme found no solution.
        least: Least distance, between samples too [m].
        velocity, acceleration: Largest ratio to a joint's bound.
        beyond: Largest excess over a position limit [rad].
        reversals: Changes of sign of a joint's acceleration a second, in the mean over joints;
            accelerations within `NOTICED` of the bound are not looked at.
        error: Largest position error in the window [m].
        back: Number of motions that are on their path at the end, to `BACK`.
    """

    scenes: int
    collided: int
    failures: int
    least: float
    velocity: float
    acceleration: float
    beyond: float
    reversals: float
    error: float
    back: int


def judged(motion: Motion, task: ObstacleTask) -> Judged:
    """Return the figures of a motion; distances are those of `Clearance`, poses Drake's."""
    q, v, h, limits = motion.position, motion.velocity, task.period, task.limits
    least = float(task.clearance.least_along(q).min())
    acceleration = np.diff(v, axis=0, prepend=np.zeros((1, v.shape[1]))) / h / limits.acceleration
    kinematics, window = task.arm.kinematics(), range(len(q))[task.window]
    error = [float(np.linalg.norm(kinematics.p_WE(q[k]) - task.p_WE[k])) for k in window]
    return Judged(
        scenes=1,
        collided=int(least < 0.0),
        failures=motion.failures,
        least=least,
        velocity=float((np.abs(v) / limits.velocity).max()),
        acceleration=float(np.abs(acceleration).max()),
        beyond=float(max((limits.position_lower - q).max(), (q - limits.position_upper).max(), 0)),
        reversals=reversals(acceleration) / (len(v) * h),
        error=max(error),
        back=int(error[-1] < BACK),
    )


def reversals(acceleration: Array) -> float:
    """Return how often joints turn their acceleration round, in the mean over joints.

    Args:
        acceleration: Accelerations of joints, relative to their bounds, shape (steps, n).
    """
    counts = []
    for joint in acceleration.T:
        signs = np.sign(joint[np.abs(joint) > NOTICED])
        counts.append(int((signs[1:] != signs[:-1]).sum()))
    return float(np.mean(counts))


def together(parts: Sequence[Judged]) -> Judged:
    """Return the figures of several motions: sums, extremes and the mean of the reversals."""
    return Judged(
        scenes=sum(part.scenes for part in parts),
        collided=sum(part.collided for part in parts),
        failures=sum(part.failures for part in parts),
        least=min(part.least for part in parts),
        velocity=max(part.velocity for part in parts),
        acceleration=max(part.acceleration for part in parts),
        beyond=max(part.beyond for part in parts),
        reversals=float(np.mean([part.reversals for part in parts])),
        error=max(part.error for part in parts),
        back=sum(part.back for part in parts),
    )
