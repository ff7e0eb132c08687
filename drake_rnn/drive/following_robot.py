"""A robot that follows its commands exactly, in a time of its own: for a look at what is sent."""

from __future__ import annotations

import numpy as np

from ..inputs.arguments import checked, number, vector
from ..inputs.fields import Array
from .connection import Command, Connection, RobotStatus


class FollowingRobot(Connection):
    """A connection to nothing.

    Args:
        position: Posture in which it stands, shape (n,) [rad].
        period: Time of a cycle [s].
    """

    @checked(position=vector, period=number(above=0.0))
    def __init__(self, position: Array, period: float = 5e-3) -> None:
        self._period = period
        self._cycle = 0
        self._position = np.array(position, dtype=float)
        self._velocity = np.zeros_like(self._position)

    @property
    def period(self) -> float:
        """See `Connection.period`."""
        return self._period

    def now(self) -> float:
        """Return its time [s]."""
        return self._cycle * self._period

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the next status at once."""
        self._cycle += 1
        return RobotStatus(self.now(), self._position, self._velocity, self._position)

    def send(self, command: Command) -> None:
        """Be where it is told to be."""
        position = command.motion.position
        self._velocity = (position - self._position) / self._period
        self._position = position
