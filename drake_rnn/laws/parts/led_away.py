"""Joints that make way before they have to: away from what is near, as far as a task leaves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays.algebra import clipped
from ...inputs.fields import Array


@dataclass(frozen=True)
class LedAway:
    """How joints prefer to go away from what is near, along the slope of its distance.

    Attributes:
        weight: Weight with which they do of what they touch [rad^2/(m s)]; less of what is farther
            away, as the square of the way into the zone.
        zone: Distance below which they do [m].
    """

    weight: float
    zone: float

    def preferred(self, gaps: Array, slopes: Array) -> Array:
        """Return the velocities that they prefer, shape (n,) [rad/s].

        Args:
            gaps: Distances of what they make way for, shape (r,) [m].
            slopes: Derivatives of these with respect to the joints, shape (r, n) [m/rad].
        """
        into = clipped(1.0 - gaps / self.zone, 0.0, 1.0)
        return np.asarray(self.weight * (into * into) @ slopes)
