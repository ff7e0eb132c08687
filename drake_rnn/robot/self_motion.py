"""The postures an arm can move through while its end effector stays where it is."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .arm import Arm
from .rotation import rotation_error
from .task import named_task

# Postures count as on the manifold when the end effector is this close [m, rad].
_ON_IT = 1e-12
# A joint counts as at a limit when it is this close [rad].
_AT = 1e-6
_LONGEST_STEP = 0.1  # of a joint [rad]
_MOST_STEPS = 1500


class SelfMotion:
    """The self-motion manifold of an arm, as far as it is connected to one posture.

    Args:
        arm: The arm.
        start: The posture, shape (n,) [rad].
        task: What of the end effector stays: a key of `drake_rnn.task.TASKS`.

    Raises:
        InvalidInputError: If there is no such task, or ``start`` is not a posture.
    """

    def __init__(self, arm: Arm, start: Array, task: str = "xyz") -> None:
        self._task = named_task(task)
        self._kinematics = arm.kinematics()
        self.arm = arm
        self.start = self._vector("start", start).copy()
        self._p_WE = self._kinematics.p_WE(self.start)
        self._R_WE = self._kinematics.R_WE(self.start)

    @property
    def free_dimensions(self) -> int:
        """Directions in which the joints can move at the start while the end effector stays."""
        J = self._task.J(self._kinematics, self.start)
        return self.arm.n - int(np.linalg.matrix_rank(J, tol=1e-6))

    def miss(self, q: Array) -> Array:
        """How far ``q`` takes the end effector off its place, shape (size of the task,) [rad, m].

        Where the orientation belongs to the task, a rotation vector comes first.
        """
        position = self._task.position(self._kinematics.p_WE(q) - self._p_WE)
        if not self._task.with_orientation:
            return position
        turned = rotation_error(self._R_WE, self._kinematics.R_WE(q))
        return np.concatenate((turned, position))

    def distance(self, q: Array) -> float:
        """How far ``q`` takes the end effector off its position [m]."""
        return float(np.linalg.norm(self.miss(q)[-len(self._task.axes) :]))

    def angle(self, q: Array) -> float:
        """How far ``q`` turns the end effector, if its orientation belongs to the task [rad]."""
        return float(np.linalg.norm(self.miss(q)[:3])) if self._task.with_orientation else 0.0

    def towards(self, target: Array) -> Array:
        """Where the self-motion ends that goes as straight towards ``target`` as it can.

        Every step brings the joints nearer to ``target`` and keeps them within their limits.
        That is how a law of state adjustment moves, whose bounds on the velocity are slack.
        As there, a joint that starts outside its limits comes back, wherever the target lies.

        Returns:
            ``target``, if the self-motion leads there; else the nearest posture on its way,
            shape (n,) [rad].

        Raises:
            InvalidInputError: If ``target`` is not a posture.
        """
        target = self._vector("target", target)
        limits = self.arm.limits
        q = self._approached(self.start.copy(), target)
        # As hard as it takes a joint that the end effector leaves little freedom.
        for pressure in (10.0, 100.0):
            outside = np.clip(q, limits.position_lower, limits.position_upper) - q
            if outside.any():
                inside = self._approached(q, q + pressure * outside)
                q = self._approached(inside, target)
        return q

    def walk(self, direction: Array, length: float) -> Array:
        """The posture that is reached by keeping to ``direction`` as well as possible.

        Args:
            direction: Of the joints, shape (n,).
            length: How far to go: the distance of the joint that moves farthest, at most a
                turn [rad].

        Returns:
            Shape (n,) [rad]; the end effector where it was, no joint farther outside its
            limits than at the start.

        Raises:
            InvalidInputError: If the self-motion ends before.
        """
        direction = self._vector("direction", direction)
        _require_length(length)
        q, gone = self.start, 0.0
        for _ in range(_MOST_STEPS):
            step = self._along(q, direction)
            longest = float(np.abs(step).max())
            if longest < 1e-6:
                break
            # Until the first joint has gone the length; back if one has gone farther.
            left = length - np.sign(step) * (q - self.start)
            shares = left[step != 0] / np.abs(step[step != 0])
            tried = self._moved(q, min(shares.min(), _LONGEST_STEP / 5 / longest) * step)
            if tried is None:
                break
            far = float(np.abs(tried - self.start).max())
            if abs(length - far) < 1e-9:
                return tried
            if abs(length - far) > abs(length - gone) - 1e-9:
                break
            q, gone = tried, far
        raise InvalidInputError(
            f"length: the self-motion of {self.arm.name} ends {gone:.3g} rad from the start in "
            f"this direction, before {length:g} rad"
        )

    def somewhere(self, length: float, seed: int = 0) -> Array:
        """A target that state adjustment reaches: a walk of ``length`` [rad] at random.

        Returns:
            Shape (n,) [rad]; within the limits.

        Raises:
            InvalidInputError: If there is none in 20 random directions.
        """
        _require_length(length)
        if seed < 0:
            raise InvalidInputError(f"seed: must be 0 or more, not {seed}")
        rng = np.random.default_rng(seed)
        last = f"the self-motion of {self.arm.name} leads there, but not straight"
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

    def _approached(self, q: Array, target: Array) -> Array:
        reach = _LONGEST_STEP
        for _ in range(_MOST_STEPS):
            step = self._along(q, target - q)
            longest = float(np.abs(step).max())
            # Where the manifold shrinks to a point, no step is short enough.
            if longest < 1e-10 or reach < _AT / 10:
                break
            tried = self._moved(q, min(1.0, reach / longest) * step)
            if tried is None or np.linalg.norm(target - tried) >= np.linalg.norm(target - q):
                reach = min(reach, longest) / 2.0
            else:
                q, reach = tried, min(2.0 * reach, _LONGEST_STEP)
        return q

    def _along(self, q: Array, direction: Array) -> Array:
        """The part of ``direction`` that leaves the end effector, and no joint beyond a limit."""
        limits = self.arm.limits
        at_upper, at_lower = q > limits.position_upper - _AT, q < limits.position_lower + _AT
        side = at_upper.astype(float) - at_lower
        J = self._task.J(self._kinematics, q)
        held = np.zeros(self.arm.n, dtype=bool)
        # One joint at a time: Murty's principal pivoting, which ends at the nearest step.
        for _ in range(50):
            rest = direction - J.T @ _least(J.T * ~held[:, np.newaxis], ~held * direction)
            wrong = np.where(held, -side * rest, side * rest) > 1e-12
            if not wrong.any():
                break
            first = int(np.argmax(wrong))
            held[first] = not held[first]
        return np.where(held, 0.0, rest)

    def _moved(self, q: Array, step: Array) -> Array | None:
        """The posture next to ``q + step`` with the end effector in its place, if one is found."""
        # From outside its limits a joint may come back.
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
        try:
            vector = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            vector = np.empty(0)
        if vector.shape != (self.arm.n,) or not np.isfinite(vector).all():
            raise InvalidInputError(f"{name}: must be {self.arm.n} finite numbers, not {value!r}")
        return vector


def _require_length(length: float) -> None:
    if not 0 < length <= 2 * np.pi:
        raise InvalidInputError(f"length: must be positive and at most 2 pi, not {length:g}")


def _least(A: Array, b: Array) -> Array:
    """The shortest of the x that bring A x nearest to b; A may be singular."""
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-8)[0])
