"""Warm-up: one small pulse per joint, so that a learning law sees every direction.

Not in any paper: the excitation ends before the task begins and keeps every bound, while injected
noise violates the acceleration bound for as long as it lasts.
"""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array, Positive, Time, Weight, validated


@validated
class WarmUp:
    """A motion in which one joint after another moves forth and back to where it was.

    Args:
        pulse: Duration of each joint's pulse [s].
        acceleration: Acceleration of the moving joint: positive for the first quarter of its
            pulse, negative for the next half, positive for the last quarter [rad/s^2].
        rho: Time constant of the learning during the warm-up [rad^2/s].
    """

    pulse: Time = 0.2
    acceleration: Positive = 0.5
    rho: Weight = 1e-6

    def duration(self, size: int) -> float:
        """Return the duration of the warm-up of ``size`` joints [s]."""
        return size * self.pulse

    def joint_velocity(self, t: float, size: int) -> Array:
        """Return the velocity of every joint at time ``t``, shape (size,) [rad/s]."""
        v = np.zeros(size)
        joint, share = self._place(t)
        if 0 <= joint < size:
            # A triangle wave through 0, 1, 0, -1, 0.
            height = 1.0 - abs(4.0 * ((share + 0.25) % 1.0) - 2.0)
            v[joint] = height * self.acceleration * self.pulse / 4.0
        return v

    def joint_acceleration(self, t: float, size: int) -> Array:
        """Return the acceleration of every joint at time ``t``, shape (size,) [rad/s^2]."""
        v_dot = np.zeros(size)
        joint, share = self._place(t)
        if 0 <= joint < size:
            rising = share < 0.25 or share >= 0.75
            v_dot[joint] = self.acceleration if rising else -self.acceleration
        return v_dot

    def _place(self, t: float) -> tuple[int, float]:
        """Return the number of the moving joint and the fraction of its pulse that has passed."""
        joint = int((t + 1e-9 * self.pulse) // self.pulse)
        return joint, max(t / self.pulse - joint, 0.0)
