"""What a robot tells and is told, whatever its messages are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..inputs.fields import Array


@dataclass(frozen=True, eq=False)
class RobotStatus:
    """What a robot tells in a cycle.

    Attributes:
        time: Its own clock [s].
        position: Measured joint positions, shape (n,) [rad].
        velocity: Estimated joint velocities, shape (n,) [rad/s].
        commanded: Positions that it holds as its command, shape (n,) [rad].
    """

    time: float
    position: Array
    velocity: Array
    commanded: Array


class Connection(Protocol):
    """A connection to a robot that takes a command of joint positions in each cycle."""

    @property
    def period(self) -> float:
        """Time of a cycle [s]."""

    def now(self) -> float:
        """Return the time of this side's clock, which never jumps [s]."""

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the newest status that has not been returned yet; None if none comes.

        Args:
            timeout: Time to wait for it [s].
        """

    def send(self, position: Array, time: float) -> None:
        """Send a command.

        Args:
            position: Joint positions, shape (n,) [rad].
            time: Time of the robot's clock that the command is for [s].
        """

    def others(self) -> int:
        """Return how many commands of other programs have been seen."""
