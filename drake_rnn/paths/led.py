"""A path that goes along with another point, such as the tool of a second arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array
from ..robot.arm import Arm
from .path import Motion, PathOfAnother, PlacedPath


@dataclass(frozen=True, eq=False)
class LedPath(PathOfAnother):
    """A placed path, each point of which is displaced by how far another path has led by then.

    Attributes:
        own: The path by itself.
        leader: The path that leads it.
        arm: The arm that follows that path.
        begin: Where that arm's end effector starts, in its own base, shape (3,) [m].
        R: Orientation of the leader's base in that of the path, shape (3, 3).
    """

    own: PlacedPath
    leader: PlacedPath
    arm: Arm
    begin: Array
    R: Array

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return max(self.own.duration, self.leader.duration)

    @property
    def traversal(self) -> float:
        """See `Passage.traversal`."""
        return max(self.own.traversal, self.leader.traversal)

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        p, v, a = self.own.position(t)
        p_led, v_led, a_led = self.leader.position(t)
        return p + self.R @ (p_led - self.begin), v + self.R @ v_led, a + self.R @ a_led

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        return self.own.orientation(t)

    def _breaks(self, until: float) -> list[Array | float]:
        return [*self.own._breaks(until), *self.leader._breaks(until)]

    def beside(self, t: float, p_leader: Array) -> Array:
        """Return the point at a time where the leader is in truth, shape (3,) [m].

        Args:
            t: The time [s].
            p_leader: Where the leading end effector is, in its own base, shape (3,) [m].
        """
        return np.asarray(self.own.position(t)[0] + self.R @ (p_leader - self.begin))
