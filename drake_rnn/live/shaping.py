"""Points that go where they are wished to be, at a bounded speed and a bounded acceleration."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..inputs.fields import Array
from .course import Course


def shaped_acceleration(away: Array, v: Array, bounds: tuple[float, float], step: float) -> Array:
    """Return the acceleration with which a point is led towards a place for one step.

    It is led straight there at the largest speed from which it can still stop in time; of the
    change of the velocity no more is made than the bound of the acceleration allows. As a ball is
    convex, a velocity within the bound stays within it.

    Args:
        away: The way to the place, shape (k,) [m].
        v: Velocity until now, shape (k,) [m/s].
        bounds: Bounds of speed and acceleration [m/s, m/s^2].
        step: Time for which the acceleration is held [s].
    """
    fastest, most = bounds
    distance = float(np.linalg.norm(away))
    # The speed from which steps of deceleration lead to rest within the distance, and not beyond.
    lost = most * step
    speed = lost * (sqrt(0.25 + 2.0 * distance / (lost * step)) - 0.5) if distance else 0.0
    speed = min(fastest, speed, distance / step)
    change = (speed / distance * away if distance else np.zeros_like(away)) - v
    size = float(np.linalg.norm(change))
    return np.asarray(change * (min(1.0, lost / size) if size else 0.0) / step)


class ShapedPoint:
    """A point that goes towards a place that may jump.

    Args:
        place: Where it is at time 0, shape (k,) [m].
        fastest: Bound of its speed [m/s].
        most: Bound of its acceleration [m/s^2].
    """

    def __init__(self, place: Array, fastest: float, most: float) -> None:
        self.course = Course(place)
        self.wish = np.array(place, dtype=float)
        self._bounds = (fastest, most)

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a time [s]."""
        step = until - self.course.until
        p, v, _ = self.course.at(self.course.until)
        # Where it will be half a step later decides: the velocity changes during the step.
        a = shaped_acceleration(self.wish - p - 0.5 * step * v, v, self._bounds, step)
        self.course.go_on(until, a)

    def stay(self) -> None:
        """Wish to be where it can stop soonest."""
        p, v, _ = self.course.at(self.course.until)
        self.wish = p + 0.5 * v * float(np.linalg.norm(v)) / self._bounds[1]
