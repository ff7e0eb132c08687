"""Self-motion: the postures an arm can reach while its end effector stays in place."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.arguments import is_vector
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from .arm import Arm
from .rotation import rotation_error
from .task import named_task

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
        task: Part of the end effector's pose that is held: a key of `drake_rnn.robot.task.TASKS`.

    Raises:
        InvalidInputError: If there is no such task, or ``start`` is not n finite numbers.
    """

    def __init__(self, arm: Arm, start: Array, task: str = "xyz") -> None:
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
        turned = rotation_error(self._R_WE, self._kinematics.R_WE(q))
        return np.concatenate((turned, position))

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
        q = self._approached(self.start.copy(), target)
        # A joint to which the end effector leaves little freedom needs the higher pressure.
        for pressure in (10.0, 100.0):
            outside = np.clip(q, limits.position_lower, limits.position_upper) - q
            if outside.any():
                inside = self._approached(q, q + pressure * outside)
                q = self._approached(inside, target)
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
        q, gone = self.start, 0.0
        for _ in range(_MOST_STEPS):
            step = self._along(q, direction)
            longest = float(np.abs(step).max())
            if longest < 1e-6:
                break
            # Go until the first joint has moved by the length; go back if one has moved farther.
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
        """Return the part of ``direction`` that holds E and takes no joint beyond a limit."""
        limits = self.arm.limits
        at_upper, at_lower = q > limits.position_upper - _AT, q < limits.position_lower + _AT
        side = at_upper.astype(float) - at_lower
        J = self._task.J(self._kinematics, q)
        held = np.zeros(self.arm.n, dtype=bool)
        # Murty's principal pivoting, one joint at a time, ends at the step nearest to direction.
        for _ in range(50):
            rest = direction - J.T @ _least(J.T * ~held[:, np.newaxis], ~held * direction)
            wrong = np.where(held, -side * rest, side * rest) > 1e-12
            if not wrong.any():
                break
            first = int(np.argmax(wrong))
            held[first] = not held[first]
        return np.where(held, 0.0, rest)

    def _moved(self, q: Array, step: Array) -> Array | None:
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
