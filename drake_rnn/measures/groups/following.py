"""How closely an arm follows what its motors are told."""

from __future__ import annotations

import numpy as np

from ..motion import Motion
from ..running import Largest
from .group import Found


class FollowingMetrics:
    """Distances of the arm from the command to its motors.

    Attributes:
        worst: Distance [rad], number of the joint and time [s] where a joint is farthest from it;
            None for an arm without motors.
    """

    worst: tuple[float, int, float] | None = None

    def __init__(self) -> None:
        self._off, self._away = Largest(), Largest()

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.position_commanded is not None:
            off = np.abs(motion.position - motion.position_commanded)
            step, joint = np.unravel_index(int(np.argmax(off)), off.shape)
            if self.worst is None or off[step, joint] > self.worst[0]:
                self.worst = float(off[step, joint]), int(joint), float(motion.time[step])
            self._off.add(off)
        if motion.p_WE_commanded is not None:
            self._away.add(np.linalg.norm(motion.p_WE - motion.p_WE_commanded, axis=1))

    def found(self) -> Found:
        """Return the metrics, by name."""
        return {
            "command_error_max_rad": self._off.value,
            "command_error_max_m": self._away.value,
        }
