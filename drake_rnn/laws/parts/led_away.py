"""Joints that make way before they have to: away from what is near, as far as a task leaves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...inputs.fields import Array
from ...robot.clearance.clearance import Near


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

    def preferred(self, near: Near, gaps: Array) -> Array:
        """Return the velocities that they prefer, shape (n,) [rad/s].

        Args:
            near: What is near at some postures; the first is where the joints are.
            gaps: Distances that pairs have there at least, shape (k, p) [m].
        """
        here = near.postures == 0
        into = np.clip(1.0 - gaps[0, near.pairs[here]] / self.zone, 0.0, 1.0)
        return np.asarray(self.weight * (into * into) @ near.slopes[here])
