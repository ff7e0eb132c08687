r"""Where joints pass that accelerate for a period, and then stop as fast as their jerk allows.

The stop is that of `drake_rnn.robot.jerk_stop`: steps of the acceleration, some periods of the
largest deceleration, one that is less, and steps back to zero. A joint that moves away from where
it accelerates to turns once on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..inputs.fields import Array
from .jerk_stop import Course, course


@dataclass(frozen=True, eq=False)
class HeldJerkStop:
    """The fastest stop of n joints that have a velocity and an acceleration.

    Attributes:
        v: Velocities held until now, shape (n,) [rad/s].
        acceleration: Bounds, shape (n,) [rad/s^2].
        jerk: Bounds, shape (n,) [rad/s^3].
        period: Time for which a velocity is held [s].
    """

    v: Array
    acceleration: Array
    jerk: Array
    period: float

    def samples(self, b: Array) -> float:
        """Return after how many samples all joints rest that accelerate at b, shape (n,), first."""
        return float(self._course(b).samples.max()) + 1.0

    def way(self, b: Array) -> Array:
        """Return how far each joint gets from where it is at most, shape (n,) [rad]."""
        stop = self._course(b)
        begun = self.period * (self.v + self.period * b)
        turned, ended = stop.ends
        ways = np.maximum(np.abs(begun + turned), np.abs(begun + ended))
        return np.asarray(np.maximum(np.abs(begun), ways))

    def moved(self, b: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad].

        Args:
            b: Accelerations in the first of them, shape (n,) [rad/s^2].
            k: Numbers of samples, at least 0, shape (s,) or (s, n); velocities are held.
        """
        k = k[:, None] if k.ndim == 1 else k
        whole = np.floor(k)
        begun, part = self._after(b, whole), k - whole
        if not part.any():
            return begun
        return np.asarray(begun + part * (self._after(b, whole + 1.0) - begun))

    def _after(self, b: Array, k: Array) -> Array:
        """Return how far the joints have gone after whole numbers of samples, shape (s, n)."""
        first = np.minimum(k, 1.0) * self.period * (self.v + self.period * b)
        return np.asarray(first + self._course(b).moved(np.maximum(k - 1.0, 0.0)))

    def gone(self, b: Array, k: Array) -> tuple[Array, Array]:
        """Return what `moved` does, and the way of each joint until then, there and back.

        Args:
            b: Accelerations in the first sample, shape (n,) [rad/s^2].
            k: Numbers of samples, at least 0, shape (s,).

        Returns:
            Both of shape (s, n) [rad].
        """
        k = np.repeat(k[:, None], b.size, axis=1)
        both = np.concatenate((k, np.minimum(k, 1.0 + self._course(b).turn)))
        moved, turned = np.split(self.moved(b, both), 2)
        return moved, np.abs(turned) + np.abs(moved - turned)

    def _course(self, b: Array) -> Course:
        # It is asked for the same few again and again, and each takes as long as all the rest.
        key = b.tobytes()
        if key not in self._known:
            w = self.v + self.period * b
            self._known[key] = course(w, b, self.acceleration, self.jerk, self.period)
        return self._known[key]

    @cached_property
    def _known(self) -> dict[bytes, Course]:
        return {}
