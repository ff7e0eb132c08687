"""The episodes of `held_stick.py` by other libraries: mink, OInK, Ruckig and klimits.

All get the same arm, start, scene, bounds and stick, and are judged alike, by our capsules::

    python benchmarks/held_stick_peers.py --cases 600 --kept FILE
    python benchmarks/held_stick_peers.py --cases 600 --kept FILE --schemes mink OInK --jobs 1

Of the episodes, those of a Panda and of a UR5 are run. Each library is used as it is meant, and
what it lacks it is not given:

- *mink* follows a frame task, or a posture task for joint velocities, within its limits of
  position, velocity and collisions, and in a second row with a limit of acceleration that a user
  adds to it;
- *OInK* does the same within its own limits of position, velocity and acceleration, and with its
  barrier against collisions;
- *Ruckig*, by its velocity interface, and *klimits* take joint velocities, here those of the damped
  Jacobian, and know no collisions; Ruckig knows no limits of position.

The programs of the first two have a task that damps joints by as much as that Jacobian is. A
library that finds no solution brakes within its bound of acceleration. It is blocked as in
`held_stick.py`, without anyone to tell. A limit is broken that is passed by more than 1e-3 of it,
or a position by 1 mrad; distances of others than ours are those at the samples. A scheme whose
package is not installed is left out.
"""

from __future__ import annotations

import argparse
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

import held_stick
from drake_rnn import Arm, Array, JointLimits, Shield, ShieldSettings, arm_clearance, make_obstacles
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.rotation import rotation_by, rotation_error
from drake_rnn.shield.report import pose_of
from held_stick import Side, about, draw_of, judged, placed
from kept_cases import Found, cases
from markdown_table import head, row
from peer_schemes.scheme import Aim, NoSolutionError
from shared_options import add_case_options

ARMS = ("panda", "ur5")
OURS = "shield"
# What counts as beyond a limit, of programs that iterate and see an arm half a sample ahead.
ROUNDED = 1e-3
# Damping of the Jacobian [m], gain [1/s], deceleration [m/s^2] and largest speed [m/s] of the
# feedback of poses, likewise of orientations [rad/s^2, rad/s].
DAMPING, GAIN, BRAKING, FASTEST = 0.05, 10.0, (0.5, 2.0), (0.3, 1.0)
# Rate of a barrier [1/s], the distance that it keeps [m], and how many pairs it looks at.
RATE, KEPT, PAIRS = 2.0, 0.01, 30


@dataclass
class StickTask:
    """What a scheme is told, with the members of `peer_schemes.obstacle_tasks.ObstacleTask`.

    Attributes:
        arm: The arm.
        start: Where it rests, shape (n,) [rad].
        limits: Limits of the joints.
        period: Time between two commands [s].
        obstacles: What is round it.
        clearance: Its capsules and the obstacles.
    """

    arm: Arm
    start: Array
    limits: JointLimits
    period: float
    obstacles: Any
    clearance: Clearance
    oriented: bool = True
    R_WE: list[Array] = field(default_factory=list)

    @classmethod
    def of(cls, shield: Shield) -> StickTask:
        """Return the task of a shield."""
        obstacles, q = make_obstacles(shield.obstacles), shield.position
        clearance, _ = arm_clearance(shield.arm, obstacles, q)
        return cls(shield.arm, q, shield.limits, shield.period, obstacles, clearance)


class Follower(ABC):
    """An arm that a library leads, with the members that an episode needs of a shield.

    Args:
        task: What it is told.
        shield: The shield in whose place it is.
    """

    uncertified = 0
    lacks: ClassVar[str] = "-"

    def __init__(self, task: StickTask, shield: Shield) -> None:
        self.task, self.arm, self.period = task, task.arm, task.period
        self.limits, self.obstacles = task.limits, shield.obstacles
        self.position, self.velocity = task.start.copy(), np.zeros(task.arm.n)
        self._kinematics = task.arm.kinematics()
        self._kind, self._target = "", np.zeros(0)
        self._times: Array = np.zeros(0)

    def follow_velocities(self, v: Array, t: float) -> None:
        """Follow joint velocities, shape (n,) [rad/s]."""
        self._kind, self._target = "velocity", v

    def follow_twists(self, V_WE: Array, t: float) -> None:
        """Follow a twist of the tool, shape (6,) [rad/s, m/s]."""
        self._kind, self._target = "twist", V_WE

    def follow_poses(self, X_WE: Array, rate: float, start: float, t: float) -> None:
        """Follow poses, shape (k, 7), of which the first is due at a time [s]."""
        self._kind, self._target = "pose", X_WE
        self._times = start + np.arange(len(X_WE)) / rate

    def command(self, t: float) -> Array:
        """Return the positions a period later, shape (n,) [rad]."""
        before = self.position
        try:
            self.position = self._next(t)
        except NoSolutionError:
            change = self.period * self.limits.sides("acceleration").least
            self.position = before + self.period * (
                self.velocity - self.velocity.clip(-change, change)
            )
        self.velocity = (self.position - before) / self.period
        return self.position

    @abstractmethod
    def _next(self, t: float) -> Array:
        """Return the positions a period later, shape (n,) [rad]; may raise a NoSolutionError."""

    def _twist(self, t: float) -> Array:
        """Return the twist that the tool is to have now, shape (6,) [rad/s, m/s]."""
        if self._kind == "twist":
            return self._target
        q, rows = self.position, self._target
        p = np.array([np.interp(t + self.period, self._times, x) for x in rows[:, :3].T])
        R, _ = pose_of(rows[0])
        ahead = (np.interp(t + 2.0 * self.period, self._times, x) for x in rows[:, :3].T)
        errors = rotation_error(self._kinematics.R_WE(q), R), p - self._kinematics.p_WE(q)
        turn, way = (
            error * min(GAIN, *_rates(float(np.linalg.norm(error)), braking, fastest))
            for error, braking, fastest in zip(
                errors, reversed(BRAKING), reversed(FASTEST), strict=True
            )
        )
        return np.concatenate((turn, way + (np.array([*ahead]) - p) / self.period))

    def _joint_velocity(self, t: float) -> Array:
        """Return the joint velocities that are wanted, shape (n,) [rad/s]."""
        if self._kind == "velocity":
            return self._target
        q = self.position
        J = np.concatenate((self._kinematics.J_omega(q), self._kinematics.J(q)))
        return np.asarray(J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), self._twist(t)))


def _rates(error: float, braking: float, fastest: float) -> tuple[float, float]:
    """Return gains by which an error is taken back braking in time, and within a speed [1/s]."""
    if not error:
        return np.inf, np.inf
    return (2.0 * braking / error) ** 0.5, fastest / error


class ByRuckig(Follower):
    """Ruckig's velocity interface."""

    name: ClassVar[str] = "Ruckig"
    lacks: ClassVar[str] = "position, pairs"
    package: ClassVar[str] = "ruckig"

    @cached_property
    def _generator(self) -> Any:
        ruckig = import_module("ruckig")
        n, limits = self.arm.n, self.limits
        given = ruckig.InputParameter(n)
        given.control_interface = ruckig.ControlInterface.Velocity
        given.synchronization = ruckig.Synchronization.No
        given.current_position = self.position.tolist()
        given.max_velocity = limits.sides("velocity").least.tolist()
        given.max_acceleration = limits.sides("acceleration").least.tolist()
        given.max_jerk = np.broadcast_to(limits.jerk, n).tolist()
        return ruckig.Ruckig(n, self.period), given, ruckig.OutputParameter(n)

    def _next(self, t: float) -> Array:
        generator, given, found = self._generator
        most = self.limits.sides("velocity").least
        given.target_velocity = self._joint_velocity(t).clip(-most, most).tolist()
        generator.update(given, found)
        found.pass_to_input(given)
        return np.array(found.new_position)


class ByKlimits(Follower):
    """The accelerations that klimits leaves, of which the nearest leads to the velocity."""

    name: ClassVar[str] = "klimits"
    lacks: ClassVar[str] = "pairs"
    package: ClassVar[str] = "klimits"

    @cached_property
    def _room(self) -> Any:
        klimits, n, limits = import_module("klimits"), self.arm.n, self.limits

        def both(most: Array | float) -> list[list[float]]:
            return [[-x, x] for x in np.broadcast_to(most, n).tolist()]

        bounds = np.stack((limits.position_lower, limits.position_upper), axis=1)
        self._v, self._a = np.zeros(n), np.zeros(n)
        return klimits.PosVelJerkLimitation(
            time_step=self.period,
            pos_limits=bounds.tolist(),
            vel_limits=both(limits.sides("velocity").least),
            acc_limits=both(limits.sides("acceleration").least),
            jerk_limits=both(limits.jerk),
            acceleration_after_max_vel_limit_factor=0.0001,
            normalize_acc_range=False,
            num_threads=1,
        )

    def _next(self, t: float) -> Array:
        klimits, room, q, period = import_module("klimits"), self._room, self.position, self.period
        v, a = self._v, self._a
        allowed, _ = room.calculate_valid_acceleration_range(q, v, a)
        lack, jerk = self._joint_velocity(t) - v, np.asarray(self.limits.jerk)
        wanted = np.sign(lack) * np.minimum(np.sqrt(jerk * np.abs(lack)), np.abs(lack) / period)
        after = np.clip(wanted, allowed[:, 0], allowed[:, 1])
        self._v = np.asarray(klimits.calculate_end_velocity(a, after, v, period))
        self._a = after
        return np.asarray(klimits.calculate_end_position(a, after, v, q, period))


class ByProgram(Follower):
    """A quadratic program among capsules, linearised at the middle of the sample."""

    _scheme: Any  # one of `peer_schemes`

    def _damp(self, q: Array) -> None:
        """Have joints that the task leaves free rest at a posture, shape (n,) [rad]."""

    @abstractmethod
    def _follow_joints(self, q: Array) -> Any:
        """Have the program lead to joint positions, shape (n,) [rad], and return its tasks."""

    def _next(self, t: float) -> Array:
        q, v, period = self.position, self.velocity, self.period
        scheme = self._scheme
        middle = q + 0.5 * period * v
        p, R = scheme.pose(middle)
        aim = Aim(middle, p, R, p, R)
        if self._kind == "velocity":
            tasks = scheme._tasks
            scheme._tasks = self._follow_joints(middle + period * self._target)
            try:
                return np.asarray(q + period * scheme.towards(aim, q, v))
            finally:
                scheme._tasks = tasks
        self._damp(middle)
        V_WE = self._twist(t)
        R_target = rotation_by(period * V_WE[:3]) @ R
        aim = Aim(middle, p, R, p + period * V_WE[3:], R_target)
        return np.asarray(q + period * scheme.towards(aim, q, v))


class ByMink(ByProgram):
    """mink's `CollisionAvoidanceLimit`, with its own gain."""

    name: ClassVar[str] = "mink"
    lacks: ClassVar[str] = "acceleration, jerk"
    package: ClassVar[str] = "mink"
    bounds_acceleration: ClassVar[bool] = False

    @cached_property
    def _scheme(self) -> Any:
        module = import_module("peer_schemes.mink_obstacles")
        # With the gain of its documentation an arm stops within a sample; one that brakes needs a
        # rate.
        gain = RATE * self.period**2 if self.bounds_acceleration else 0.85
        chosen = {"gain": gain, "minimum_distance": KEPT, "detection": 0.2}
        made = type("Mink", (module.MinkAmong,), {"chosen": chosen, "follows_twists": False})
        scheme = made(self.task)
        model = scheme._configuration.model
        scheme._tasks += (import_module("mink").DampingTask(model, cost=DAMPING),)
        if not self.bounds_acceleration:
            scheme._limits.remove(scheme._own)
        return scheme

    def _follow_joints(self, q: Array) -> Any:
        mink = import_module("mink")
        task = mink.PostureTask(self._scheme._configuration.model, cost=1.0)
        task.set_target(q)
        return (task,)


class ByMinkBounded(ByMink):
    """The same with a limit of the user's own for the acceleration."""

    name: ClassVar[str] = "mink, own limit"
    lacks: ClassVar[str] = "jerk"
    bounds_acceleration: ClassVar[bool] = True


class ByOInK(ByProgram):
    """OInK's `SelfCollisionBarrier`, with its limits of velocity and acceleration."""

    name: ClassVar[str] = "OInK"
    lacks: ClassVar[str] = "jerk"
    package: ClassVar[str] = "roboplan"

    @cached_property
    def _scheme(self) -> Any:
        module = import_module("peer_schemes.roboplan_obstacles")
        chosen = {
            "n_collision_pairs": PAIRS,
            "gain": RATE,
            "d_min": KEPT,
            "safe_displacement_gain": 1.0,
        }
        return type("OInK", (module.OInKAmong,), {"chosen": chosen})(self.task)

    @cached_property
    def _tasks(self) -> list[Any]:
        """Those of the scheme without damping."""
        return list(self._scheme._tasks)

    def _damp(self, q: Array) -> None:
        self._scheme._tasks = [*self._tasks, self._configuration_task(q, DAMPING**2)]

    def _configuration_task(self, q: Array, weight: float) -> Any:
        ik, scheme = import_module("roboplan.optimal_ik"), self._scheme
        options = ik.ConfigurationTaskOptions(task_gain=1.0)
        weights = np.full(self.arm.n, scheme.scale * weight)
        return ik.ConfigurationTask(scheme._oink, q, weights, options)

    def _follow_joints(self, q: Array) -> Any:
        return [self._configuration_task(q, 1.0)]


FOLLOWERS: dict[str, type[Follower]] = {
    each.name: each for each in (ByMink, ByMinkBounded, ByOInK, ByRuckig, ByKlimits)
}


def episode(seed: int, scheme: str) -> Found:
    """Return what an episode comes to by a scheme."""
    draw = draw_of(seed)
    if scheme == OURS:
        return held_stick.episode(seed)
    made = placed(draw, ShieldSettings(compiled=False))
    if made is None:
        return about(draw) | {"refused": True}
    shield, target = made
    assert isinstance(shield, Shield)
    arm = FOLLOWERS[scheme](StickTask.of(shield), shield)
    side: Any = Side(arm, arm, arm.arm, slice(None), None, [])
    found = about(draw) | judged(side, draw, target, _least)
    motion = found.pop("motion")
    return found | {"orders": [*_orders(motion, draw.limits, draw.period)]}


def _least(clearance: Clearance, motion: Array) -> float:
    """Return the least distance of a motion at its samples [m]."""
    parts = np.array_split(motion, 1 + len(motion) // 500)
    return min(float(clearance.gaps(part).min()) for part in parts)


def _orders(motion: Array, limits: JointLimits, period: float) -> Iterator[float]:
    """Yield by which share velocity, acceleration and jerk are beyond their bounds."""
    v = np.diff(np.vstack((motion[:1],) * 3 + (motion,)), axis=0) / period
    for order, bound in enumerate((limits.velocity, limits.acceleration, limits.jerk)):
        assert bound is not None
        size = np.abs(np.diff(v, n=order, axis=0)) / period**order
        yield float((size / bound).max() - 1.0)


def seeds_of(count: int) -> list[int]:
    """Return the seeds of episodes of a Panda or a UR5."""
    return [seed for seed in range(count) if draw_of(seed).name in ARMS]


def print_table(found: dict[str, list[Found]]) -> None:
    """Print a row for each scheme."""
    beyond = ("beyond q", "v", "a", "jerk")
    asked = ("collided", "least distance [mm]", "slide on", "at rest", "left")
    head("by", "episodes", "does not bound", *beyond, *asked)
    for name, rows in found.items():
        rows = [each for each in rows if "refused" not in each]
        rest = [each for each in rows if "slides" not in each]
        orders = [each.get("orders", 3 * [each["beyond"]]) for each in rows]
        counts = [sum(each["outside"] > ROUNDED for each in rows)]
        counts += [int(n) for n in (np.array(orders) > ROUNDED).sum(axis=0)]
        row(
            name,
            len(rows),
            "-" if name == OURS else FOLLOWERS[name].lacks,
            *counts,
            sum(each["distance"] <= 0.0 for each in rows),
            f"{1e3 * min(each['distance'] for each in rows):.1f}",
            len(rows) - len(rest),
            f"{sum(each['speed'] < held_stick.REST for each in rest)} of {len(rest)}",
            f"{sum(held_stick.is_left(each) for each in rows)} of {len(rows)}",
        )


def main() -> None:
    """Run the episodes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=60, help="seeds below this one")
    names = [OURS, *FOLLOWERS]
    parser.add_argument("--schemes", nargs="+", choices=names, default=names)
    add_case_options(parser)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    found, seeds = {}, seeds_of(options.cases)
    for name in options.schemes:
        if name != OURS and not _is_installed(FOLLOWERS[name]):
            print(f"{name}: {FOLLOWERS[name].package} is not installed")
            continue
        task = partial(episode, scheme=name)
        found[name] = cases(task, seeds, options.jobs, options.kept, name)
    print_table(found)


def _is_installed(follower: Any) -> bool:
    try:
        import_module(follower.package)
    except ModuleNotFoundError:
        return False
    return True


if __name__ == "__main__":
    main()
