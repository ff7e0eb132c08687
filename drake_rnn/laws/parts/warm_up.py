"""Warm-up: one small pulse per joint, so that a learning law sees every direction.

Not in any paper: the excitation ends before the task begins and keeps every bound, while injected
noise violates the acceleration bound for as long as it lasts.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from ...arrays.algebra import functions_of, larger
from ...inputs.fields import Array, Positive, Time, Weight, validated
from ...inputs.keys import Meaning, Only


@validated
class WarmUp:
    """A motion in which one joint after another moves forth and back to where it was."""

    pulse: Annotated[Time, Meaning("Duration of each joint's pulse.", unit="s")] = 0.2
    acceleration: Annotated[
        Positive,
        Meaning(
            "Acceleration of the moving joint: positive for the first quarter of its pulse, "
            "negative for the next half, positive for the last quarter.",
            unit="rad/s^2",
        ),
    ] = 0.5
    rho: Annotated[
        Weight,
        Meaning(
            "Time constant of the learning during the warm-up.",
            unit="rad^2/s",
            only=(Only("jacobian", "learned"),),
        ),
    ] = 1e-6

    def duration(self, size: int) -> float:
        """Return the duration of the warm-up of ``size`` joints [s]."""
        return size * self.pulse

    def joint_velocity(self, t: Any, size: int) -> Array:
        """Return the velocity of every joint at time ``t``, shape (..., size) [rad/s]."""
        joint, share = self._place(t)
        # A triangle wave through 0, 1, 0, -1, 0.
        height = 1.0 - abs(4.0 * ((share + 0.25) % 1.0) - 2.0)
        return self._of_one(joint, height * self.acceleration * self.pulse / 4.0, size)

    def joint_acceleration(self, t: Any, size: int) -> Array:
        """Return the acceleration of every joint at time ``t``, shape (..., size) [rad/s^2]."""
        joint, share = self._place(t)
        rising = (share < 0.25) | (share >= 0.75)
        acceleration = functions_of(joint).where(rising, self.acceleration, -self.acceleration)
        return self._of_one(joint, acceleration, size)

    def _place(self, t: Any) -> tuple[Any, Any]:
        """Return the number of the moving joint and the fraction of its pulse that has passed.

        Both have shape (), or (..., 1) for robots with pulses of their own.
        """
        joint = (t + 1e-9 * self.pulse) // self.pulse
        return joint, larger(0.0, t / self.pulse - joint)

    @staticmethod
    def _of_one(joint: Any, value: Any, size: int) -> Array:
        """Return a value for one joint, and 0 for all others."""
        return functions_of(joint, value).where(np.arange(size) == joint, value, 0.0)
