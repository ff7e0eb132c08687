"""The largest distance of an arm from the command to its motors."""

from __future__ import annotations

import numpy as np

from ..motion import Motion
from .group import Found


class FollowingMetrics:
    """The largest distance of a joint from the command to its motor, and where it was.

    Attributes:
        worst: Distance [rad], number of the joint and time [s] where a joint is farthest from it;
            None for an arm without motors.
    """

    worst: tuple[float, int, float] | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of one arm."""
        if motion.position_commanded is None:
            return
        off = np.abs(motion.position - motion.position_commanded)
        step, joint = np.unravel_index(int(np.argmax(off)), off.shape)
        if self.worst is None or off[step, joint] > self.worst[0]:
            self.worst = float(off[step, joint]), int(joint), float(motion.time[step])

    def found(self) -> Found:
        """Return the metric, by name."""
        return {} if self.worst is None else {"command_error_max_rad": self.worst[0]}
