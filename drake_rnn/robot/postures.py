"""Postures of an arm: random ones, self-motion, and the inertia that joints move there.

- Postures of an arm: random ones, and one to start from.
- The largest inertia that each joint of an arm has to move.
- Self-motion: the postures an arm can reach while its end effector stays in place.
- Inverse kinematics: the posture near another one that reaches a pose, or meets objectives.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, instance, is_vector, whole
from ..inputs.messages import require_type, short
from .arm import Arm
from .kinematics import ArmKinematics
from .rotation import rotation_error
from .task import Task, TaskSection, named_task
from .task_objectives import RowBlock

# A joint is drawn from at most one turn about the middle of its range, which holds every posture of
# a joint that turns [rad], or from so much of its way if it slides [m]; the middle of an unlimited
# joint is 0.
_HALF_TURN, _HALF_WAY = np.pi, 1.0
# Random postures that compete to be the home posture, those that are improved, and their trials.
_CANDIDATES, _FINALISTS, _TRIALS = 2000, 6, 600
# Standard deviation of the first and the last trials' steps [rad].
_FIRST_STEP, _LAST_STEP = 0.3, 0.01
# A joint this share of half its range away from its limits is far enough; so is a frame E that is
# this share of the arm's reach above the base.
_ENOUGH_ROOM, _ENOUGH_HEIGHT = 0.25, 0.25
# Bodies at half of the largest distance that they can have are far enough from each other; those
# that are always close, relative to the reach, do not count.
_APART, _ALWAYS_CLOSE = 0.5, 0.02
# A body is out over the work if it is farther from the base's axis than this share of the reach; it
# may be below E by that share.
_OUT, _BELOW = 0.2, 0.05
# Digits of the proposed posture.
_DIGITS = 2


def random_postures(arm: Arm, count: int, seed: int = 0) -> Array:
    """Return postures within the position limits, uniformly distributed, shape (count, n).

    A joint whose range exceeds one turn, or 2 m if it slides, is drawn from so much of it about the
    middle; units are those of ``arm.units``.

    Args:
        arm: The arm.
        count: Number of postures.
        seed: Seed of the random numbers.
    """
    lower, upper = _range(arm)
    return np.random.default_rng(seed).uniform(lower, upper, (count, arm.n))


@checked(arm=instance(Arm), seed=whole())
def proposed_home(arm: Arm, seed: int = 0) -> Array:
    """Return a posture to start from, away from limits and singularities.

    It is the best of 2000 random postures, improved by a random search. A posture is judged by the
    product of

    - the smallest distance of a joint from its limits as a share of half its range; 0.25 is
      enough;
    - the reciprocal condition number of the Jacobian, of the pose for six joints or more, otherwise
      of the position, in its structural rank; lengths are taken relative to the arm's reach;
    - how much E's z axis points down, along gravity, and how far E is ahead, along the base's x
      axis: (1 + cosine) / 2 both, the first squared;
    - the smallest distance of two bodies of the chain as a share of the largest that they can have;
      0.5 is enough;
    - the distance of E from the base's xy plane as a share of the arm's reach; 0.25 is enough. No
      body may be behind that plane, and of those that are out over the work none below E.

    Where no posture fulfils the last of these, as for an arm that hangs, only the joints' limits,
    the Jacobian and the distances of bodies count.

    Args:
        arm: The arm; a home posture that it has does not matter.
        seed: Seed of the random search.

    Returns:
        The posture with two decimals, shape (n,) [rad].

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`.
    """
    candidates = random_postures(arm, _CANDIDATES, seed)
    merit = _merit(arm, candidates)
    worth = np.array([merit(q) for q in candidates])
    if not worth.any():
        merit = _merit(arm, candidates, stands=False)
        worth = np.array([merit(q) for q in candidates])
    rng = np.random.default_rng(seed)
    candidates_improved = [
        _improve(arm, merit, candidates[k], float(worth[k]), rng)
        for k in np.argsort(-worth, kind="stable")[:_FINALISTS]
    ]
    best = max(candidates_improved, key=lambda pair: pair[1])[0]
    posture = np.round(best, _DIGITS) + 0.0
    return posture if not arm.limits.violation(posture).any() else best


def conditioning(kinematics: ArmKinematics, q: Array, reach: float) -> Array:
    """Return the singular values of the Jacobian at ``q``, relative to the largest, descending.

    Args:
        kinematics: Kinematics of the arm.
        q: Posture, shape (n,) [rad].
        reach: Length to which those of the Jacobian are related [m].
    """
    J = kinematics.J(q) / reach
    if q.size >= 6:
        J = np.vstack((J, kinematics.J_omega(q)))
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values / values[0])


def structural_rank(kinematics: ArmKinematics, postures: Array, reach: float) -> int:
    """Return the largest rank of the Jacobian over postures, shape (k, n), see `conditioning`."""
    return max(int((conditioning(kinematics, q, reach) > 1e-6).sum()) for q in postures)


def _range(arm: Arm) -> tuple[Array, Array]:
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    is_finite = np.isfinite(lower) & np.isfinite(upper)
    middle = np.zeros(arm.n)
    middle[is_finite] = (lower[is_finite] + upper[is_finite]) / 2.0
    # A joint with one limit is drawn from the turn next to it.
    half = np.array([_HALF_TURN if unit == "rad" else _HALF_WAY for unit in arm.units])
    above, below = np.isfinite(lower) & ~is_finite, np.isfinite(upper) & ~is_finite
    middle[above] = (lower + half)[above]
    middle[below] = (upper - half)[below]
    return np.maximum(lower, middle - half), np.minimum(upper, middle + half)


def _improve(
    arm: Arm,
    merit: Callable[[Array], float],
    q: Array,
    worth: float,
    rng: np.random.Generator,
) -> tuple[Array, float]:
    """Return a posture near ``q`` that is worth more, and its worth."""
    for step in np.geomspace(_FIRST_STEP, _LAST_STEP, _TRIALS):
        trial = q + step * rng.standard_normal(q.size)
        if arm.limits.violation(trial).any():
            continue
        if (worth_here := merit(trial)) > worth:
            q, worth = trial, worth_here
    return q, worth


def _merit(arm: Arm, candidates: Array, stands: bool = True) -> Callable[[Array], float]:
    """Return the function that judges a posture, from 0 to 1.

    Args:
        arm: The arm.
        candidates: Postures to compare with, shape (k, n).
        stands: Whether it matters where E points, and what is ahead of the base or below E.
    """
    kinematics, limits = arm.kinematics(), arm.limits
    weight = float(np.linalg.norm(arm.gravity))
    down = arm.gravity / weight if weight > 0.0 else np.array([0.0, 0.0, -1.0])
    chains = np.array([kinematics.skeleton(q) for q in candidates])
    reach = float(np.linalg.norm(chains[:, -1], axis=1).max())
    is_planar = bool(np.ptp(chains[:, -1, 2]) < 1e-9)
    farthest = np.max([_distances(chain) for chain in chains], axis=0)
    counts = farthest > _ALWAYS_CLOSE * reach
    half = (limits.position_upper - limits.position_lower) / 2.0
    rank = structural_rank(kinematics, candidates[:50], reach)

    def merit(q: Array) -> float:
        chain = kinematics.skeleton(q)
        place = placed(q, chain[1:]) if stands else 1.0
        if place == 0.0:
            return 0.0
        room = np.minimum(q - limits.position_lower, limits.position_upper - q)
        shares = np.divide(room, half, out=np.ones(arm.n), where=np.isfinite(half))
        apart = float((_distances(chain)[counts] / farthest[counts]).min())
        worth = min(float(shares.min()) / _ENOUGH_ROOM, 1.0) * min(apart / _APART, 1.0)
        return place * worth * float(conditioning(kinematics, q, reach)[rank - 1])

    def placed(q: Array, bodies: Array) -> float:
        p_WE, heights = bodies[-1], -bodies @ down
        out = np.linalg.norm(bodies[:, :2], axis=1) > _OUT * reach
        if bodies[:, 2].min() < 0.0 or (heights[out] < heights[-1] - _BELOW * reach).any():
            return 0.0
        ahead = (1.0 + p_WE[0] / max(float(np.linalg.norm(p_WE)), 1e-9)) / 2.0
        pointing = (1.0 + float(kinematics.R_WE(q)[:, 2] @ down)) / 2.0
        high = 1.0 if is_planar else min(float(p_WE[2]) / (_ENOUGH_HEIGHT * reach), 1.0)
        return ahead * pointing**2 * high

    return merit


def _distances(points: Array) -> Array:
    """Return the distances between points, shape (k, 3), pair by pair."""
    first, second = np.triu_indices(len(points), 1)
    return np.asarray(np.linalg.norm(points[first] - points[second], axis=1))


# Number of postures; a larger number raises the result by less than 8 %.
_POSTURES = 1000


def largest_inertia(arm: Arm) -> Array:
    """Return the largest inertia of each joint over the postures of an arm, (n,) [kg m^2].

    For joint i it is the largest sum over j of abs(M_ij), where M is the mass matrix with the tool,
    over the home posture and 1000 `random_postures`, which are always the same. With R the diagonal
    matrix of these sums, R - M is positive semidefinite at these postures, because it is diagonally
    dominant.

    Args:
        arm: The arm.
    """
    postures = random_postures(arm, _POSTURES)
    if arm.home is not None:
        postures = np.vstack((arm.home, postures))
    M = arm.kinematics().M
    return np.max([np.abs(M(q)).sum(axis=1) for q in postures], axis=0)


# A posture lies on the manifold if the end effector is this close to its place [m, rad].
_ON_IT = 1e-12
# A joint counts as at a limit if it is this close [rad].
_AT = 1e-6
_LONGEST_STEP = 0.1  # largest step of any joint [rad]
_MOST_STEPS = 1500


class SelfMotion:
    """The part of an arm's self-motion manifold that is connected to one posture.

    Args:
        arm: The arm.
        start: The posture, shape (n,) [rad].
        task: Part of the end effector's pose that is held: a key of
        `drake_rnn.robot.task.TASKS`.

    Raises:
        InvalidInputError: If there is no such task, or ``start`` is not n finite numbers.
    """

    def __init__(self, arm: Arm, start: Array, task: TaskSection = "xyz") -> None:
        require_type("arm", arm, Arm)
        self._task = named_task(task)
        self._kinematics = arm.kinematics()
        self.arm = arm
        self.start = self._vector("start", start).copy()
        self._p_WE = self._kinematics.p_WE(self.start)
        self._R_WE = self._kinematics.R_WE(self.start)

    @property
    def free_dimensions(self) -> int:
        """Number of joint directions at the start that leave the end effector in place."""
        J = self._task.J(self._kinematics, self.start)
        return self.arm.n - int(np.linalg.matrix_rank(J, tol=1e-6))

    def miss(self, q: Array) -> Array:
        """Return the displacement of the end effector at ``q``, shape (task size,) [rad, m].

        If the task includes the orientation, a rotation vector comes first.
        """
        position = self._task.position(self._kinematics.p_WE(q) - self._p_WE)
        if not self._task.with_orientation:
            return position
        rotation = rotation_error(self._R_WE, self._kinematics.R_WE(q))
        return np.concatenate((rotation, position))

    def distance(self, q: Array) -> float:
        """Return the distance of the end effector at ``q`` from its place [m]."""
        return float(np.linalg.norm(self.miss(q)[-len(self._task.axes) :]))

    def angle(self, q: Array) -> float:
        """Return the end effector's rotation at ``q`` [rad]; 0 for a task without orientation."""
        return float(np.linalg.norm(self.miss(q)[:3])) if self._task.with_orientation else 0.0

    def towards(self, target: Array) -> Array:
        """Return the end of the self-motion that goes as straight towards ``target`` as possible.

        Every step brings the joints closer to ``target`` and keeps them within their limits, like
        a law of state adjustment with slack velocity bounds. As there, a joint that starts outside
        its limits comes back, wherever the target lies.

        Args:
            target: Posture, shape (n,) [rad].

        Returns:
            ``target``, if the self-motion leads there; otherwise the closest posture on the way,
            shape (n,) [rad].

        Raises:
            InvalidInputError: If ``target`` is not n finite numbers.
        """
        target = self._vector("target", target)
        limits = self.arm.limits
        q = self._approach(self.start.copy(), target)
        # A joint to which the end effector leaves little freedom needs the higher pressure.
        for pressure in (10.0, 100.0):
            outside = np.clip(q, limits.position_lower, limits.position_upper) - q
            if outside.any():
                inside = self._approach(q, q + pressure * outside)
                q = self._approach(inside, target)
        return q

    def walk(self, direction: Array, length: float) -> Array:
        """Return the posture reached by following ``direction`` as closely as possible.

        Args:
            direction: Direction of the joint motion, shape (n,).
            length: Largest joint displacement from the start, positive and at most one turn [rad].

        Returns:
            Posture with the end effector in place and no joint farther outside its limits than at
            the start, shape (n,) [rad].

        Raises:
            InvalidInputError: If the self-motion ends before that, or an argument is invalid.
        """
        direction = self._vector("direction", direction)
        _require_length(length)
        q, distance = self.start, 0.0
        for _ in range(_MOST_STEPS):
            step = self._along(q, direction)
            longest = float(np.abs(step).max())
            if longest < 1e-6:
                break
            # Go until the first joint has moved by the length; go back if one has moved farther.
            left = length - np.sign(step) * (q - self.start)
            # A joint that hardly moves may need an infinite share, which is never the least.
            with np.errstate(over="ignore"):
                shares = left[step != 0] / np.abs(step[step != 0])
            trial = self._move(q, min(shares.min(), _LONGEST_STEP / 5 / longest) * step)
            if trial is None:
                break
            far = float(np.abs(trial - self.start).max())
            if abs(length - far) < 1e-9:
                return trial
            if abs(length - far) > abs(length - distance) - 1e-9:
                break
            q, distance = trial, far
        raise InvalidInputError(
            f"length: the self-motion of {self.arm.name} ends {distance:.3g} rad from the start in "
            f"this direction, before {length:g} rad"
        )

    def somewhere(self, length: float, seed: int = 0) -> Array:
        """Return a random target that state adjustment can reach.

        Args:
            length: Largest joint displacement of the target from the start, as in `walk` [rad].
            seed: Seed of the random directions.

        Returns:
            Posture within the limits, shape (n,) [rad].

        Raises:
            InvalidInputError: If none is found in 20 random directions, or an argument is invalid.
        """
        _require_length(length)
        if seed < 0:
            raise InvalidInputError(f"seed: must be 0 or more, not {seed}")
        rng = np.random.default_rng(seed)
        last = f"the self-motion of {self.arm.name} reaches the posture only by a detour"
        for _ in range(20):
            try:
                q = self.walk(rng.standard_normal(self.arm.n), length)
            except InvalidInputError as error:
                last = str(error)
                continue
            inside = not self.arm.limits.violation(q).any()
            if inside and np.abs(self.towards(q) - q).max() < 1e-6:
                return q
        raise InvalidInputError(f"no posture found in 20 directions; in the last: {last}")

    def _approach(self, q: Array, target: Array) -> Array:
        reach = _LONGEST_STEP
        for _ in range(_MOST_STEPS):
            step = self._along(q, target - q)
            longest = float(np.abs(step).max())
            # Where the manifold shrinks to a point, no step is short enough.
            if longest < 1e-10 or reach < _AT / 10:
                break
            trial = self._move(q, min(1.0, reach / longest) * step)
            if trial is None or np.linalg.norm(target - trial) >= np.linalg.norm(target - q):
                reach = min(reach, longest) / 2.0
            else:
                q, reach = trial, min(2.0 * reach, _LONGEST_STEP)
        return q

    def _along(self, q: Array, direction: Array) -> Array:
        """Return the part of ``direction`` that holds E and takes no joint beyond a limit."""
        limits = self.arm.limits
        at_upper, at_lower = q > limits.position_upper - _AT, q < limits.position_lower + _AT
        side = at_upper.astype(float) - at_lower
        J = self._task.J(self._kinematics, q)
        is_fixed = np.zeros(self.arm.n, dtype=bool)
        # Murty's principal pivoting, one joint at a time, ends at the step nearest to direction.
        for _ in range(50):
            rest = direction - J.T @ _least(J.T * ~is_fixed[:, np.newaxis], ~is_fixed * direction)
            wrong = np.where(is_fixed, -side * rest, side * rest) > 1e-12
            if not wrong.any():
                break
            first = int(np.argmax(wrong))
            is_fixed[first] = not is_fixed[first]
        return np.where(is_fixed, 0.0, rest)

    def _move(self, q: Array, step: Array) -> Array | None:
        """Return the posture near ``q + step`` with the end effector in place, or None."""
        # A joint outside its limits may stay there or come back.
        lower = np.minimum(self.arm.limits.position_lower, q)
        upper = np.maximum(self.arm.limits.position_upper, q)
        q = q + step
        free = np.ones(self.arm.n)
        for _ in range(30):
            free[(q < lower) | (q > upper)] = 0.0
            q = np.clip(q, lower, upper)
            miss = self.miss(q)
            if float(np.abs(miss).max()) < _ON_IT:
                return q
            back = _least(self._task.J(self._kinematics, q) * free, miss)
            if float(np.abs(back).max()) > 2 * _LONGEST_STEP:
                return None
            q = q - back
        return None

    def _vector(self, name: str, value: Array) -> Array:
        vector = np.asarray(value, dtype=float) if is_vector(value) else np.empty(0)
        if vector.shape != (self.arm.n,) or not np.isfinite(vector).all():
            raise InvalidInputError(
                f"{name}: must be {self.arm.n} finite numbers, not {short(value)}"
            )
        return vector


def _require_length(length: float) -> None:
    if not 0 < length <= 2 * np.pi:
        raise InvalidInputError(f"length: must be positive and at most 2 pi, not {length:g}")


def _least(A: Array, b: Array) -> Array:
    """Return the least-squares solution x of A x = b of least norm; A may be singular."""
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-8)[0])


_DAMPING = 1e-6
#: Lever that converts a rotation to a length, where both are one error [m].
LEVER = 0.2
# Distance from a pose that a posture may miss it by before others are tried [m].
_MISS = 1e-3


class Aim(ABC):
    """What postures are to reach; inverse kinematics of it."""

    @abstractmethod
    def error(self, q: Array, target: Array) -> Array:
        """Return the remaining error [m], angles times the lever."""

    @abstractmethod
    def J(self, q: Array) -> Array:
        """Return the Jacobian of what has these errors."""

    def reach(self, q: Array, target: Array) -> tuple[Array, float]:
        """Return the posture near ``q`` that comes as close to ``target`` as it can, as `descend`.

        Args:
            q: Posture to begin with, shape (n,) [rad].
            target: What `error` is measured from.
        """
        best, miss = self.descend(q, target)
        if miss > _MISS:
            # J may be singular in the direction of the target, e.g. for an outstretched arm: start
            # again from slightly different postures.
            aside = 0.1 * np.cos(np.arange(1, q.size + 1))
            others = (self.descend(q + step, target) for step in (aside, -aside))
            postures = [(best, miss), *others]
            best, miss = min(postures, key=lambda each: each[1])
        return best, miss

    def descend(self, q: Array, target: Array, steps: int = 200) -> tuple[Array, float]:
        """Run Levenberg's method, with steps cut to 0.2 rad to stay on the branch of ``q``.

        Returns:
            The posture, shape (n,) [rad], and by how much it misses the target [m].
        """
        damping = _DAMPING
        error = self.error(q, target)
        for _ in range(steps):
            if error @ error < 1e-20 or damping > 1e6:
                break
            step = damped_inverse(self.J(q), damping) @ error
            longest = float(np.abs(step).max())
            if longest < 1e-9:
                break
            trial = q + step * min(1.0, 0.2 / longest)
            remaining = self.error(trial, target)
            if remaining @ remaining < error @ error:
                q, error, damping = trial, remaining, max(_DAMPING, damping / 10)
            else:
                damping *= 10
        return q, float(np.linalg.norm(error))


@dataclass(frozen=True)
class PoseAim(Aim):
    """A pose to reach with E.

    Attributes:
        kinematics: Kinematics of the arm.
        rows: Axes of the position that count.
        R_WE: Orientation, shape (3, 3); None if it does not count.
    """

    kinematics: ArmKinematics
    rows: list[int]
    R_WE: Array | None

    def error(self, q: Array, target: Array) -> Array:
        """Return the remaining error [m]: first the rotation times the lever, then the position."""
        left = target - self.kinematics.p_WE(q)[self.rows]
        if self.R_WE is None:
            return np.asarray(left)
        turn = rotation_error(self.kinematics.R_WE(q), self.R_WE)
        return np.concatenate((LEVER * turn, left))

    def J(self, q: Array) -> Array:
        """Return the Jacobian with the rows of `error`."""
        J = self.kinematics.J(q)[self.rows]
        if self.R_WE is None:
            return np.asarray(J)
        return np.vstack((LEVER * self.kinematics.J_omega(q), J))


@dataclass(frozen=True)
class ObjectivesAim(Aim):
    """A list of objectives, all to be met; a target is their coordinates.

    Attributes:
        kinematics: Kinematics of the arm.
        task: The objectives.
    """

    kinematics: ArmKinematics
    task: Task

    def error(self, q: Array, target: Array) -> Array:
        """Return the remaining error [m]: 0 of a range that holds, angles times the lever."""
        x = self.task.coordinates(self.kinematics, q)
        lower, upper = self._bounds
        return np.asarray(
            self.levers * (np.clip(np.where(self._in_range, x, target), lower, upper) - x)
        )

    def J(self, q: Array) -> Array:
        """Return the Jacobian with the rows of `error`: 0 of a range that holds."""
        x = self.task.coordinates(self.kinematics, q)
        lower, upper = self._bounds
        counts = ~self._in_range | (x < lower) | (x > upper)
        return np.asarray((self.levers * counts)[:, np.newaxis] * self.task.J(self.kinematics, q))

    @cached_property
    def levers(self) -> Array:
        """What makes a length of each coordinate, shape (m,): 1, or the lever of an angle [m]."""
        return self._of_rows(lambda block: LEVER if block.turns else 1.0)

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        lower = self._of_rows(lambda block: -np.inf if block.lower is None else block.lower)
        return lower, self._of_rows(lambda block: np.inf if block.upper is None else block.upper)

    @cached_property
    def _in_range(self) -> NDArray[np.bool_]:
        return self._of_rows(lambda block: block.is_range).astype(bool)

    def _of_rows(self, of: Callable[[RowBlock], float]) -> Array:
        return np.array([of(block) for block in self.task.blocks for _ in range(block.size)])


def damped_inverse(J: Array, damping: float = _DAMPING) -> Array:
    """Return the damped pseudoinverse of a Jacobian, shape (n, m)."""
    return np.asarray(np.linalg.solve(J @ J.T + damping * np.eye(J.shape[0]), J).T)
