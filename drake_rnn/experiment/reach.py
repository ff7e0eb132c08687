"""Is a path within an arm's reach, and how close does it come to what the arm cannot do?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from ..robot.rotation import rotation_error
from .experiment import Experiment

_SAMPLES = 400
_MISS = 1e-3
_DAMPING = 1e-6
# Makes a length of a rotation [m].
_LEVER = 0.2


@dataclass(frozen=True)
class Reach:
    """A path, followed by damped least squares from the start posture; k points.

    Attributes:
        time: Shape (k,) [s].
        position: Joint positions, shape (k, n) [rad].
        miss: Distance from the path, shape (k,) [m]; where the orientation is held, with how
            far off that is [rad] times a lever of 0.2 m.
        singular_value: Smallest singular value of J, shape (k,).
        velocity: J^+ v_WE_desired, shape (k, n) [rad/s].
        acceleration: Its rate, shape (k, n) [rad/s^2].
        desired: Points of the path, shape (k, m) [m].
    """

    time: Array
    position: Array
    miss: Array
    singular_value: Array
    velocity: Array
    acceleration: Array
    desired: Array


def follow(experiment: Experiment, samples: int = _SAMPLES) -> Reach:
    """Follow the experiment's path by inverse kinematics, over its duration or one lap."""
    rows = list(experiment.task.axes)
    held = experiment.R_WE_start if experiment.holds_orientation else None
    aim = _Aim(experiment.arm.kinematics(), rows, held)
    origin = experiment.path.start_point(experiment.p_WE_start)
    if experiment.contact is not None:
        # Where it presses.
        origin = origin - experiment.contact.surface.gap * experiment.contact.surface.normal_W
    time = np.linspace(0.0, min(experiment.path.period, experiment.document.duration), samples)
    q = experiment.start.copy()
    miss: list[float] = []
    position, singular, velocity, desired = [], [], [], []
    for t in time:
        p, v, _ = experiment.path.evaluate(float(t))
        target = (origin + p)[rows]
        # Once the path is lost, how far it leads away is all there is to know.
        if max(miss, default=0.0) > _MISS:
            q = _descend(aim, q, target, 20)
        else:
            q = _towards(aim, q, target)
        J = aim.J(q)
        position.append(q)
        desired.append(target)
        miss.append(_miss(aim, q, target))
        singular.append(np.linalg.svd(J, compute_uv=False)[-1])
        asked = np.concatenate((np.zeros(J.shape[0] - len(rows)), v[rows]))
        velocity.append(_damped_inverse(J) @ asked)
    return Reach(
        time=time,
        position=np.array(position),
        miss=np.array(miss),
        singular_value=np.array(singular),
        velocity=np.array(velocity),
        acceleration=np.gradient(np.array(velocity), time, axis=0),
        desired=np.array(desired),
    )


def check_reach(experiment: Experiment) -> list[str]:
    """Warnings of what the path comes close to, after those of the experiment's own making.

    The posture is not unique for a redundant arm: limits that a least-squares posture
    meets may be avoided, so they are warned of and not refused.

    Raises:
        InvalidInputError: If inverse kinematics misses the path by more than 1 mm, or motors
            would have to be stronger than they are to press as asked.
    """
    if experiment.target is not None:
        return list(experiment.warnings)
    _require_within_task(experiment)
    reach = follow(experiment)
    worst = int(np.argmax(reach.miss))
    if reach.miss[worst] > _MISS:
        first = int(np.argmax(reach.miss > _MISS))
        place = ", ".join(f"{value:.4g}" for value in reach.desired[first])
        raise InvalidInputError(
            f"path: out of reach: {experiment.arm.name} misses the point ({place}) m, at "
            f"t = {reach.time[first]:.4g} s, by {reach.miss[first] * 1e3:.3g} mm; "
            f"the farthest miss is {reach.miss[worst]:.3g} m at t = {reach.time[worst]:.4g} s"
        )
    _require_torque(experiment, reach)
    return [
        *experiment.warnings,
        *_near_limits(experiment, reach),
        *_near_singular(reach),
        *_beyond_bounds(experiment, reach),
    ]


def _near_limits(experiment: Experiment, reach: Reach) -> list[str]:
    limits = experiment.limits
    margin = np.minimum(
        reach.position - limits.position_lower, limits.position_upper - reach.position
    )
    k, joint = np.unravel_index(np.argmin(margin), margin.shape)
    left = float(margin[k, joint])
    if left >= 0.05:
        return []
    place = f"comes within {left:.3g} rad of" if left >= 0 else f"goes {-left:.3g} rad beyond"
    name = experiment.arm.joints[joint]
    return [f"path: {name} {place} its limit near t = {reach.time[k]:.3g} s"]


def _near_singular(reach: Reach) -> list[str]:
    k = np.argmin(reach.singular_value)
    if reach.singular_value[k] >= 0.05:
        return []
    return [
        f"path: near-singular posture near t = {reach.time[k]:.3g} s: smallest singular "
        f"value of J {reach.singular_value[k]:.3g}"
    ]


def _beyond_bounds(experiment: Experiment, reach: Reach) -> list[str]:
    warnings = []
    for article, name, unit, asked in (
        ("a", "velocity", "rad/s", reach.velocity),
        ("an", "acceleration", "rad/s^2", reach.acceleration),
    ):
        bound = experiment.limits.bounds[name]
        if bound is None:
            continue
        ratio = np.abs(asked) / bound
        k, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
        if ratio[k, joint] > 1.0:
            warnings.append(
                f"path: asks {experiment.arm.joints[joint]} for {article} {name} of "
                f"{ratio[k, joint] * bound[joint]:.3g} {unit} near t = {reach.time[k]:.3g} s; "
                f"its limit is {bound[joint]:.3g}"
            )
    return warnings


def _require_torque(experiment: Experiment, reach: Reach) -> None:
    """At rest, at each point of the path, motors must hold gravity and the pressing force."""
    if experiment.contact is None or not experiment.level.has_motors:
        return
    kinematics, effort = experiment.arm.kinematics(), experiment.arm.effort
    most = max(experiment.contact.force.value, experiment.contact.force.initial)
    pushed = most * experiment.contact.surface.normal_W
    for t, q in zip(reach.time, reach.position, strict=True):
        torque = np.abs(kinematics.gravity(q) + kinematics.J(q).T @ pushed)
        weakest = int(np.argmax(torque - effort))
        if torque[weakest] > effort[weakest]:
            raise InvalidInputError(
                f"force.value: {most:g} N asks {experiment.arm.joints[weakest]} "
                f"for {torque[weakest]:.4g} Nm near t = {t:.3g} s; its motor has "
                f"{effort[weakest]:g} Nm"
            )


def _require_within_task(experiment: Experiment) -> None:
    """A planar task must not drop a part of its path without a word."""
    dropped = [axis for axis in range(3) if axis not in experiment.task.axes]
    lap = experiment.path.sample(50)
    extent = np.ptp(lap[:, dropped], axis=0).max(initial=0.0)
    if extent > 1e-9:
        raise InvalidInputError(
            f"path: leaves the plane of task {experiment.document.task} by {extent:.3g} m; "
            "give it a path in that plane"
        )


@dataclass(frozen=True)
class _Aim:
    """What of E's pose is to be reached: some axes of its position, and perhaps ``R_WE``."""

    kinematics: ArmKinematics
    rows: list[int]
    R_WE: Array | None

    def error(self, q: Array, target: Array) -> Array:
        """What is left, the rotation first, as far as a lever would show it [m]."""
        left = target - self.kinematics.p_WE(q)[self.rows]
        if self.R_WE is None:
            return np.asarray(left)
        turn = rotation_error(self.kinematics.R_WE(q), self.R_WE)
        return np.concatenate((_LEVER * turn, left))

    def J(self, q: Array) -> Array:
        """Its Jacobian."""
        J = self.kinematics.J(q)[self.rows]
        if self.R_WE is None:
            return np.asarray(J)
        return np.vstack((_LEVER * self.kinematics.J_omega(q), J))


def _towards(aim: _Aim, q: Array, target: Array) -> Array:
    """The posture next to ``q`` that reaches ``target``, or comes as near as it can."""
    best = _descend(aim, q, target)
    if _miss(aim, best, target) > _MISS:
        # J may be singular in just the direction asked for, as an outstretched arm's is: try
        # postures a little aside.
        aside = 0.1 * np.cos(np.arange(1, q.size + 1))
        found = [best, *(_descend(aim, q + step, target) for step in (aside, -aside))]
        best = min(found, key=lambda posture: _miss(aim, posture, target))
    return best


def _miss(aim: _Aim, q: Array, target: Array) -> float:
    return float(np.linalg.norm(aim.error(q, target)))


def _descend(aim: _Aim, q: Array, target: Array, steps: int = 200) -> Array:
    """Levenberg's method, its steps cut to 0.2 rad so that it does not leave the branch."""
    damping = _DAMPING
    error = aim.error(q, target)
    for _ in range(steps):
        if error @ error < 1e-20 or damping > 1e6:
            break
        step = _damped_inverse(aim.J(q), damping) @ error
        longest = float(np.abs(step).max())
        if longest < 1e-9:
            break
        tried = q + step * min(1.0, 0.2 / longest)
        remaining = aim.error(tried, target)
        if remaining @ remaining < error @ error:
            q, error, damping = tried, remaining, max(_DAMPING, damping / 10)
        else:
            damping *= 10
    return q


def _damped_inverse(J: Array, damping: float = _DAMPING) -> Array:
    return np.asarray(np.linalg.solve(J @ J.T + damping * np.eye(J.shape[0]), J).T)
