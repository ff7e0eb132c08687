"""A robot that follows its commands exactly, in a time of its own: for a look at what is sent."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from .connection import RobotStatus


class FollowingRobot:
    """A `drake_rnn.drive.connection.Connection` to nothing.

    Args:
        position: Posture in which it stands, shape (n,) [rad].
        period: Time of a cycle [s].
    """

    def __init__(self, position: Array, period: float = 5e-3) -> None:
        self.period = period
        self._cycle = 0
        self._position, self._velocity = position, np.zeros_like(position)

    def now(self) -> float:
        """Return its time [s]."""
        return self._cycle * self.period

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the next status at once."""
        self._cycle += 1
        return RobotStatus(self.now(), self._position, self._velocity, self._position)

    def send(self, position: Array, time: float) -> None:
        """Be where it is told to be."""
        self._velocity = (position - self._position) / self.period
        self._position = position

    def others(self) -> int:
        """Return that nobody else commands it."""
        return 0
