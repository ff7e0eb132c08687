"""The postures an arm can move through while its end effector stays where it is."""

from __future__ import annotations

import numpy as np
from pydrake.math import RotationMatrix

from .arms import Arm
from .errors import InvalidInputError
from .fields import Array
from .task import named_task

# Postures count as on the manifold when the end effector is this close [m, rad].
_ON_IT = 1e-12
_LONGEST_STEP = 0.1


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
        self.start = np.array(start, dtype=float)
        self._p_WE = self._kinematics.p_WE(self.start)
        self._R_WE = self._kinematics.R_WE(self.start)
        # From outside its limits a joint may come back.
        self._lower = np.minimum(arm.limits.position_lower, self.start)
        self._upper = np.maximum(arm.limits.position_upper, self.start)

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
        turned = rotation_vector(self._R_WE, self._kinematics.R_WE(q))
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

        Returns:
            ``target``, if the self-motion leads there; else the nearest posture on its way,
            shape (n,) [rad].
        """
        q = self.start
        for _ in range(1000):
            step = self._along(q, target - q)
            longest = float(np.abs(step).max())
            if longest < 1e-10:
                break
            share = min(1.0, _LONGEST_STEP / longest)
            before = np.linalg.norm(target - q)
            while (tried := self._back(q + share * step)) is None or (
                np.linalg.norm(target - tried) >= before
            ):
                share /= 2.0
                if share * longest < 1e-10:
                    return q
            q = tried
        return q

    def walk(self, direction: Array, length: float) -> Array:
        """The posture that is reached by keeping to ``direction`` as well as possible.

        Args:
            direction: Of the joints, shape (n,).
            length: How far to go: the distance of the joint that moves farthest [rad].

        Returns:
            Shape (n,) [rad]; within the limits, the end effector where it was.

        Raises:
            InvalidInputError: If the self-motion ends before.
        """
        direction = np.asarray(direction, dtype=float)
        if direction.shape != self.start.shape or not np.isfinite(direction).all():
            raise InvalidInputError(
                f"direction: must be {self.arm.n} finite numbers, not {direction.tolist()}"
            )
        if not (length > 0 and np.isfinite(length)):
            raise InvalidInputError(f"length: must be positive, not {length:g}")
        q, gone = self.start, 0.0
        while length - gone > 1e-9:
            step = self._along(q, direction)
            longest = float(np.abs(step).max())
            share = min(length - gone, _LONGEST_STEP / 5) / max(longest, 1e-300)
            tried = self._back(q + share * step) if longest > 1e-6 else None
            if tried is None or np.abs(tried - self.start).max() < gone + 1e-9:
                raise InvalidInputError(
                    f"length: the self-motion of {self.arm.name} ends {gone:.3g} rad from the "
                    f"start in this direction, before {length:g} rad"
                )
            q, gone = tried, float(np.abs(tried - self.start).max())
        return q

    def somewhere(self, length: float, seed: int = 0) -> Array:
        """A target that state adjustment reaches: a walk of ``length`` [rad] at random.

        Returns:
            Shape (n,) [rad].

        Raises:
            InvalidInputError: If there is none in 50 random directions.
        """
        rng = np.random.default_rng(seed)
        farthest = ""
        for _ in range(50):
            try:
                q = self.walk(rng.standard_normal(self.arm.n), length)
            except InvalidInputError as error:
                farthest = str(error)
                continue
            if np.abs(self.towards(q) - q).max() < 1e-6:
                return q
        raise InvalidInputError(f"no posture found in 50 directions; in the last: {farthest}")

    def _along(self, q: Array, direction: Array) -> Array:
        """The part of ``direction`` that leaves the end effector, and holds joints at limits."""
        free = np.ones(self.arm.n)
        J = self._task.J(self._kinematics, q)
        while True:
            step = free * direction
            J_free = J * free
            step = step - J_free.T @ _solve(J_free, J @ step)
            outward = ((step < 0) & (q <= self._lower)) | ((step > 0) & (q >= self._upper))
            outward &= free > 0
            if not outward.any():
                return step
            free[outward] = 0.0

    def _back(self, q: Array) -> Array | None:
        """The posture next to ``q`` that has the end effector in its place; None if not found."""
        free = np.ones(self.arm.n)
        for _ in range(30):
            outside = (q < self._lower) | (q > self._upper)
            free[outside] = 0.0
            q = np.clip(q, self._lower, self._upper)
            miss = self.miss(q)
            if float(np.abs(miss).max()) < _ON_IT:
                return q
            J = self._task.J(self._kinematics, q) * free
            step = J.T @ _solve(J, miss)
            if float(np.abs(step).max()) > 2 * _LONGEST_STEP:
                return None
            q = q - step
        return None


def _solve(J: Array, value: Array) -> Array:
    """(J J^T)^-1 value, damped a little for rows that depend on one another."""
    gram = J @ J.T
    return np.asarray(np.linalg.solve(gram + 1e-10 * np.eye(gram.shape[0]), value))


def rotation_vector(R_from: Array, R_to: Array) -> Array:
    """The rotation from one orientation to another, in their common frame, shape (3,) [rad]."""
    turn = RotationMatrix(R_to @ R_from.T).ToAngleAxis()
    return np.asarray(turn.angle() * turn.axis())
