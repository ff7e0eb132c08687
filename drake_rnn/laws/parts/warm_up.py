"""Warming up: joint by joint through a small pulse, so that a learning law sees every direction.

Not in any paper: an excitation that ends before the task begins, and keeps every bound, where
injected noise breaks the one on acceleration for as long as it lasts.
"""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array, Positive, validated


@validated
class WarmUp:
    """One joint after the other moves forth and back and is at rest where it was.

    Args:
        pulse: Time that each joint takes [s].
        acceleration: Of the moving joint: up for a quarter of its time, down for half of
            it, up for the last quarter [rad/s^2].
        rho: Of the learning while it lasts [rad^2/s].
    """

    pulse: Positive = 0.2
    acceleration: Positive = 0.5
    rho: Positive = 1e-6

    def duration(self, size: int) -> float:
        """Until ``size`` joints have moved [s]."""
        return size * self.pulse

    def joint_velocity(self, t: float, size: int) -> Array:
        """Velocity of every joint at time ``t``, shape (size,) [rad/s]."""
        v = np.zeros(size)
        joint, share = self._place(t)
        if 0 <= joint < size:
            # A triangle wave through 0, 1, 0, -1, 0.
            height = 1.0 - abs(4.0 * ((share + 0.25) % 1.0) - 2.0)
            v[joint] = height * self.acceleration * self.pulse / 4.0
        return v

    def joint_acceleration(self, t: float, size: int) -> Array:
        """Its rate, shape (size,) [rad/s^2]."""
        v_dot = np.zeros(size)
        joint, share = self._place(t)
        if 0 <= joint < size:
            rising = share < 0.25 or share >= 0.75
            v_dot[joint] = self.acceleration if rising else -self.acceleration
        return v_dot

    def _place(self, t: float) -> tuple[int, float]:
        """Number of the moving joint, and the share of its time that has passed."""
        joint = int((t + 1e-9 * self.pulse) // self.pulse)
        return joint, max(t / self.pulse - joint, 0.0)
