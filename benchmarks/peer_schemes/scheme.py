"""What every scheme is: joint velocities, sample by sample; and its run on a task."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar, NamedTuple

import numpy as np

from bench import unit
from drake_rnn import Array
from drake_rnn.robot.rotation import rotation_error
from peer_schemes.tasks import POSITION, ROTATION, Braking, Task
from peer_schemes.turns import rotated_by, swept, twice_turned

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


class Aim(NamedTuple):
    """The posture about which a scheme linearises, and the pose to reach from there.

    Attributes:
        q: The posture, shape (n,) [rad].
        p, R: Pose there, shapes (3,) [m] and (3, 3).
        p_target, R_target: Pose to reach in one sample, likewise; where the orientation is free,
            one that the scheme need not reach.
    """

    q: Array
    p: Array
    R: Array
    p_target: Array
    R_target: Array


class AimedScheme(Scheme):
    """A scheme that is given a target for the next sample, and linearises the arm about a posture.

    Attributes:
        braking, turn_braking: Feedback of position and orientation.
        in_the_middle: Whether that posture is the one half a sample ahead, by the last velocity, in
            place of that of the sample. From there the arm has as far to go, and as far to turn.
        follows_twists: Whether the library takes the way from a pose to a target for a constant
            twist in the frame that moves, which sweeps aside what it turns.
    """

    braking: ClassVar[Braking] = POSITION
    turn_braking: ClassVar[Braking] = ROTATION
    in_the_middle: ClassVar[bool] = False
    follows_twists: ClassVar[bool] = False

    @abstractmethod
    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        """Return the joint velocity that leads to a target, shape (n,) [rad/s].

        Args:
            aim: The target, and about what to linearise; the library is at that posture.
            q: Joint positions, shape (n,) [rad].
            v: Velocity that was held before, shape (n,) [rad/s].

        Raises:
            NoSolutionError: If there is none.
        """

    def velocity(self, k: int, q: Array, v: Array) -> Array:
        task = self.task
        p, R = self.pose(q)
        p_target = task.target(k, p, self.braking)
        R_target = task.orientation_target(k, R, self.turn_braking) if task.oriented else R
        if not self.in_the_middle:
            return self.towards(Aim(q, p, R, p_target, R_target), q, v)
        middle = q + 0.5 * task.period * v
        p_middle, R_middle = self.pose(middle)
        way = p_target - p
        if not (task.oriented or self.follows_twists):
            return self.towards(Aim(middle, p_middle, R_middle, p_middle + way, R_middle), q, v)
        # Where the orientation is free, the arm is expected to turn on as in the first half.
        turn = rotation_error(R, R_target) if task.oriented else twice_turned(R, R_middle)
        if self.follows_twists:
            way = swept(way, turn)
        aim = Aim(middle, p_middle, R_middle, p_middle + way, rotated_by(turn, R_middle))
        return self.towards(aim, q, v)


def in_the_middle(scheme: type[AimedScheme]) -> type[AimedScheme]:
    """Return a scheme that linearises about the middle of the sample."""
    about = {
        "name": f"{scheme.name}, midpoint",
        "setting": "the same, linearised at the middle of the sample",
        "in_the_middle": True,
    }
    return type(f"{scheme.__name__}InTheMiddle", (scheme,), about)


def braked(scheme: type[AimedScheme], deceleration: float) -> type[AimedScheme]:
    """Return a scheme whose feedback brakes otherwise."""
    about = {
        "name": f"{scheme.name}, braking {deceleration:g}",
        "setting": f"the same, the feedback brakes at {deceleration:g} m/s^2",
        "braking": replace(scheme.braking, deceleration=deceleration),
    }
    return type(f"{scheme.__name__}Braked", (scheme,), about)


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
        began = time.process_time()
        for k in part:
            position[k] = q
            try:
                v = scheme.velocity(k, q, v)
            except NoSolutionError:
                failures += 1
                v = v - np.clip(v, -change, change)
            velocity[k] = v
            q = q + task.period * v
        costs.append((time.process_time() - began) / len(part) * 1e6 / one)
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
