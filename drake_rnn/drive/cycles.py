"""The cycles of a robot, counted by its own clock, also where messages are lost or late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .connection import Connection, RobotStatus
from .settings import DriveSettings
from .watches import StopError

# Cycles to wait for a status until one is taken for lost; for the next one after that, one cycle.
_PATIENCE = 1.5
# Cycles by which a status may differ from where its cycle is expected.
_EARLY = 0.5


@dataclass(frozen=True)
class Cycle:
    """A cycle that is due.

    Attributes:
        time: The robot's clock, as far as it is accounted for [s].
        passed: Time since the cycle before [s].
        status: What the robot has told; None if nothing came in time.
        earlier: What it has told since the cycle before besides, the oldest first.
    """

    time: float
    passed: float
    status: RobotStatus | None
    earlier: Sequence[RobotStatus] = ()

    @property
    def told(self) -> Sequence[RobotStatus]:
        """All that the robot has told since the cycle before, the newest last."""
        return self.earlier if self.status is None else (*self.earlier, self.status)


class Cycles:
    """The cycles of a connection.

    The robot's clock says how much time has passed. If a status does not come in time, a period is
    taken to have passed: a command is due then all the same, because the robot holds the one
    before. If that status comes later, or statuses overtake each other, its cycle has been
    accounted for, and no time passes.

    Args:
        connection: The connection.
        settings: When the robot is silent, or its clock jumps.

    Attributes:
        lost: Number of cycles without a status in time.
        late: Number of cycles that had passed when this side came to them.
        heard: Time of this side's clock when a status came last [s].
        unanswered: Time that has passed in a cycle without a command yet [s]; None in none.
    """

    def __init__(self, connection: Connection, settings: DriveSettings) -> None:
        self._connection, self._settings = connection, settings
        self._time: float | None = None
        self._missed = False
        self.lost, self.late = 0, 0
        self.unanswered: float | None = None
        self.heard = connection.now()

    def begin(self, status: RobotStatus) -> None:
        """Account for the robot's clock up to a status, whatever was before."""
        self._time, self.heard = status.time, self._connection.now()

    def due(self) -> Cycle:
        """Wait for the next cycle and return it.

        Raises:
            StopError: If the robot is silent, its clock jumps, or this side is late.
        """
        assert self._time is not None
        period = self._connection.period
        self.unanswered = period
        earlier: list[RobotStatus] = []
        while (status := self._next()) is not None:
            earlier += status.earlier
            self.heard = self._connection.now()
            passed = status.time - self._time
            if abs(passed) > self._settings.late:
                self._time = status.time
                raise StopError("clock", f"the robot's clock went by {passed:.4g} s in a cycle")
            if passed > _EARLY * period:
                self.late += round(passed / period) - 1
                self._time, self.unanswered = status.time, passed
                return Cycle(self._time, passed, status, earlier)
            # Its cycle is accounted for, but not yet looked at.
            earlier.append(status)
        self._time += period
        if failure := self._connection.failure:
            raise StopError("robot", failure)
        silent = self._connection.now() - self.heard
        if silent > self._settings.silence or self._connection.paced:
            raise StopError("silence", f"no status for {silent:.3g} s")
        self.lost += 1
        return Cycle(self._time, period, None, earlier)

    def whatever_comes(self) -> Cycle:
        """Return the cycle that is unanswered, or else wait for the next, and raise nothing.

        The robot's clock is believed as far as it goes by no more than it may.
        """
        assert self._time is not None
        period = self._connection.period
        if (passed := self.unanswered) is not None:
            return Cycle(self._time, passed, None)
        while (status := self._next()) is not None:
            passed = status.time - self._time
            if _EARLY * period < passed <= self._settings.late:
                self._time = status.time
                return Cycle(self._time, passed, status)
            if abs(passed) > self._settings.late:
                self._time = status.time
                return Cycle(self._time, period, status)
        self._time += period
        return Cycle(self._time, period, None)

    def _next(self) -> RobotStatus | None:
        period = self._connection.period
        patience = period if self._missed else _PATIENCE * period
        # Nobody waits for a command where the robot is answered all the same.
        if self._connection.paced:
            patience = self._settings.silence
        status = self._connection.next(patience)
        self._missed = status is None
        return status

    def answered(self) -> None:
        """Note that a command has been sent in the cycle."""
        self.unanswered = None
