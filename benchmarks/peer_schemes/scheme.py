"""What every scheme is: joint velocities, sample by sample; and its run on a task."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from bench import unit
from drake_rnn import Array
from peer_schemes.tasks import Task

#: Steps of a run that are timed together: the machine's pace changes within seconds.
PART = 500


class NoSolutionError(Exception):
    """A scheme found no joint velocities."""


class Motion(NamedTuple):
    """What a scheme made of a task.

    Attributes:
        position: Joint positions at the samples, shape (steps + 1, n) [rad].
        velocity: Joint velocities held between them, shape (steps, n) [rad/s].
        failures: Samples at which the scheme found no solution; the arm brakes then, within its
            bounds.
        costs: Costs of a step in parts of the run, each in units of pydrake's p_WE and J measured
            just before it.
    """

    position: Array
    velocity: Array
    failures: int = 0
    costs: tuple[float, ...] = ()


class Scheme(ABC):
    """A scheme of any library.

    Args:
        task: What it is to do.
    """

    name: ClassVar[str]
    setting: ClassVar[str]

    def __init__(self, task: Task) -> None:
        self.task = task

    @abstractmethod
    def pose(self, q: Array) -> tuple[Array, Array]:
        """Return p_WE and R_WE as the scheme's library computes them."""

    @abstractmethod
    def velocity(self, k: int, q: Array, v: Array) -> Array:
        """Return the joint velocity to hold after sample ``k``, shape (n,) [rad/s].

        Args:
            k: Number of the sample.
            q: Joint positions, shape (n,) [rad].
            v: Velocity that was held before, shape (n,) [rad/s].

        Raises:
            NoSolutionError: If there is none.
        """


def run(scheme: Scheme) -> Motion:
    """Return what a scheme makes of its task: ideal joints, velocities held over a period."""
    task = scheme.task
    position = np.empty((task.steps + 1, task.arm.n))
    velocity = np.empty((task.steps, task.arm.n))
    q, v, failures, costs = task.start.copy(), np.zeros(task.arm.n), 0, []
    change = task.period * task.limits.acceleration
    for first in range(0, task.steps, PART):
        part = range(first, min(first + PART, task.steps))
        one = unit(task.experiment, repeats=PART)
        began = time.perf_counter()
        for k in part:
            position[k] = q
            try:
                v = scheme.velocity(k, q, v)
            except NoSolutionError:
                failures += 1
                v = v - np.clip(v, -change, change)
            velocity[k] = v
            q = q + task.period * v
        costs.append((time.perf_counter() - began) / len(part) * 1e6 / one)
    position[-1] = q
    return Motion(position, velocity, failures, tuple(costs))


def pose_difference(scheme: Scheme, postures: int = 100) -> float:
    """Return the largest difference of a scheme's p_WE and R_WE from Drake's, over postures."""
    arm = scheme.task.arm
    kinematics, limits = arm.kinematics(), arm.limits
    drawn = np.random.default_rng(0).uniform(
        limits.position_lower, limits.position_upper, (postures, arm.n)
    )
    return max(
        float(max(np.abs(p - kinematics.p_WE(q)).max(), np.abs(R - kinematics.R_WE(q)).max()))
        for q in drawn
        for p, R in (scheme.pose(q),)
    )
