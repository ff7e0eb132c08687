"""What a robot tells and is told, whatever its messages are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple, Protocol

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import JointLimits


class Motion(NamedTuple):
    """A commanded motion at the end of a cycle.

    Attributes:
        position: Joint positions, shape (n,) [rad].
        velocity: Velocities that have led there, shape (n,) [rad/s].
        acceleration: Accelerations that have led to these, shape (n,) [rad/s^2].
    """

    position: Array
    velocity: Array
    acceleration: Array

    @property
    def rests(self) -> bool:
        """Whether nothing moves."""
        return not (self.velocity.any() or self.acceleration.any())

    def equals(self, other: Motion) -> bool:
        """Return whether all numbers are the same."""
        return all(map(np.array_equal, self, other))


@dataclass(frozen=True, eq=False)
class Command:
    """What a robot is told in a cycle.

    Attributes:
        time: Time of the robot's clock that it is for [s].
        motion: The motion; what the robot is told are the positions.
        limits: Limits of acceleration and jerk within which the joints are to come to rest if
            nobody commands any more; for a connection that sees to it.
        then: The motions of the cycles after it, as far as they are known; likewise.
    """

    time: float
    motion: Motion
    limits: JointLimits
    then: Sequence[Motion] = ()


@dataclass(frozen=True, eq=False)
class RobotStatus:
    """What a robot tells in a cycle.

    Attributes:
        time: Its own clock [s].
        position: Measured joint positions, shape (n,) [rad].
        velocity: Estimated joint velocities, shape (n,) [rad/s].
        commanded: Positions that it holds as its command, shape (n,) [rad].
        motion: What a paced connection has commanded in this cycle; None of any other.
        earlier: Older statuses that have come together with it, the oldest first.
        fault: Why the message cannot be read; the numbers mean nothing then.
    """

    time: float
    position: Array
    velocity: Array
    commanded: Array
    motion: Motion | None = None
    earlier: Sequence[RobotStatus] = ()
    fault: str = ""

    def complaint(self, joints: int) -> str:
        """Return why it is no status of a robot with so many joints; empty if it is one."""
        if self.fault:
            return self.fault
        if not isfinite(self.time):
            return f"a status has the time {self.time} s"
        for values in (self.position, self.velocity, self.commanded):
            if values.shape != (joints,):
                return f"a status has {values.size} joints; the arm has {joints}"
        return ""


class Connection(Protocol):
    """A connection to a robot that takes a command of joint positions in each cycle.

    A robot of this kind may wait for a command, as an iiwa does. One that does not, as an FR3, has
    a *paced* connection: it answers the robot itself in each cycle, by the command that was sent
    for it or, where there is none, by a step of the fastest stop. Its statuses tell what it has
    commanded, and the next command goes on from there.
    """

    #: Whether it answers the robot itself.
    paced: bool = False

    @property
    def period(self) -> float:
        """Time of a cycle [s]."""

    def now(self) -> float:
        """Return the time of this side's clock, which never jumps [s]."""

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the newest status, with all that have not been returned yet; None if none comes.

        Args:
            timeout: Time to wait for it [s].
        """

    def send(self, command: Command) -> None:
        """Send a command."""

    def others(self) -> int:
        """Return how many commands of other programs have been seen since it was made."""
        return 0

    def listen(self) -> None:
        """Begin to listen to the robot: what takes time has been done."""
        return None

    def begin(self) -> None:
        """Take the robot over, which has been listened to.

        Raises:
            RobotError: If it does not let itself be taken over.
        """
        return None

    def rest(self) -> None:
        """Have a paced connection bring the robot to rest, whatever is sent from now on."""
        return None

    def end(self) -> None:
        """Hand the robot back, which rests."""
        return None

    @property
    def failure(self) -> str:
        """Why the robot takes no more commands; empty while it does."""
        return ""
