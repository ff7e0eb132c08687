"""The cycles of a robot, counted by its own clock, also where messages are lost or late."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .connection import Connection, RobotStatus
from .settings import DriveSettings
from .watches import StopError

# Cycles after the last status, by the robot's clock, at which the next one is taken for lost.
_PATIENCE = 1.5
# Cycles of this side in one of the robot's, up to which a slow robot is waited for, and statuses
# that have to come slowly before.
_SLOWEST, _SLOW = 6.0, 3
# Cycles for which the next status is waited for at least, where this side is late itself.
_LEAST = 0.5
# Cycles by which a status may differ from where its cycle is expected.
_EARLY = 0.5
# Share of a cycle, by this side's clock, between two cycles of a stop in which clocks jump.
_APART = 0.75
# Share by which the robot's clock may go faster than this side's.
_FAST = 0.01
# Statuses of one cycle that are looked at; of more, the oldest are not.
_MOST = 256


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
    accounted for, and no time passes. A robot whose clock goes slowly, as a simulated one on a busy
    machine, is waited for: the time at which its next status is due is told by its last ones.

    Args:
        connection: The connection.
        settings: When the robot is silent, or its clock jumps.
        joints: Number of joints that a status must have.

    Attributes:
        lost: Number of cycles without a status in time.
        late: Number of cycles that had passed when this side came to them.
        unanswered: Time that has passed in a cycle without a command yet [s]; None in none.
    """

    def __init__(self, connection: Connection, settings: DriveSettings, joints: int) -> None:
        self._connection, self._settings, self._joints = connection, settings, joints
        self.lost, self.late = 0, 0
        self.unanswered: float | None = None
        # The robot's clock: as far as it is accounted for, and where it was last.
        self._time = self._clock = np.nan
        # Time of this side's clock in that of the robot's, between the last statuses.
        self._paces = deque([1.0] * _SLOW, maxlen=_SLOW)
        # This side's clock when a status came, when the robot's clock went on, and at a cycle.
        self._heard = self._went = self._came = connection.now()
        # How far the robot's clock is ahead of this side's, and since when.
        self._ahead, self._since = np.nan, self._heard

    def begin(self, status: RobotStatus) -> None:
        """Account for the robot's clock up to a status that has just come."""
        self._account(status)
        self._heard = self._since = self._came
        self._ahead = status.time - self._since

    def due(self) -> Cycle:
        """Wait for the next cycle and return it.

        Raises:
            StopError: If the robot is silent, its clock jumps or stands, or this side is late.
        """
        period = self._connection.period
        self.unanswered = period
        earlier: list[RobotStatus] = []
        began, until = self._connection.now(), self._deadline()
        while (status := self._next(until)) is not None:
            for each in status.earlier:
                if not each.complaint(self._joints):
                    self._require_near(each)
            earlier += status.earlier
            if not status.complaint(self._joints):
                passed = self._passed(status)
                if passed > _EARLY * period:
                    self.late += round(passed / period) - 1
                    self._account(status)
                    self.unanswered = passed
                    return Cycle(self._time, passed, status, earlier)
                until = max(until, min(self._expected(), began + self._settings.silence))
            # It cannot be read, or its cycle is accounted for, but not yet looked at.
            earlier.append(replace(status, earlier=()))
            del earlier[:-_MOST]
        self._time += period
        self._require_heard()
        self.lost, self._came = self.lost + 1, self._connection.now()
        return Cycle(self._time, period, None, earlier)

    def _passed(self, status: RobotStatus) -> float:
        """Return how far a status has moved the robot's clock on [s], and note that it has come."""
        now = self._heard = self._connection.now()
        passed = self._require_near(status)
        gained = status.time - now - self._ahead
        if gained > self._settings.late + _FAST * (now - self._since):
            raise StopError(
                "clock",
                f"the robot's clock has gone {gained:.3g} s further than this side's in "
                f"{now - self._since:.4g} s",
            )
        if status.time > self._clock:
            self._paces.append((now - self._went) / (status.time - self._clock))
            self._clock, self._went = status.time, now
        return passed

    def _require_near(self, status: RobotStatus) -> float:
        """Return how far a status is from where the robot's clock is accounted for [s].

        Raises:
            StopError: If that is further than it may be; the clock is taken over.
        """
        passed, here = status.time - self._time, self._connection.now() - self._came
        if not abs(passed) <= self._settings.late:
            self._account(status)
            raise StopError(
                "clock",
                f"the robot's clock went by {passed:.4g} s in a cycle, ours by {here:.3g} s; "
                f"{self._settings.late:g} s are allowed",
            )
        return passed

    def _require_heard(self) -> None:
        """Raise a StopError if the robot takes no commands, is silent, or its clock stands."""
        if failure := self._connection.failure:
            raise StopError("robot", failure)
        now, most = self._connection.now(), self._settings.silence
        silent, stood = now - self._heard, now - self._went
        # Where the robot is answered all the same, the whole time has been waited for.
        if silent > most or (self._connection.paced and silent > 0.5 * most):
            raise StopError("silence", f"no status for {silent:.3g} s")
        if stood > most or self._connection.paced:
            raise StopError(
                "clock",
                f"the robot's clock has stood at {self._clock:.6g} s for {stood:.3g} s, though it "
                "tells statuses",
            )

    def whatever_comes(self) -> Cycle:
        """Return the cycle that is unanswered, or else wait for the next, and raise nothing.

        The robot's clock is believed as far as it goes by no more than it may.
        """
        period = self._connection.period
        if (passed := self.unanswered) is not None:
            return Cycle(self._time, passed, None)
        until = self._deadline()
        while (status := self._next_or_none(until)) is not None:
            if status.complaint(self._joints):
                continue
            passed = status.time - self._time
            if abs(passed) > self._settings.late:
                apart = self._connection.now() - self._came
                self._account(status, came=apart >= _APART * period)
                if apart >= _APART * period:
                    return Cycle(self._time, period, status)
            elif passed > _EARLY * period:
                self._account(status)
                return Cycle(self._time, passed, status)
        self._time += period
        self._came = self._connection.now()
        return Cycle(self._time, period, None)

    def _account(self, status: RobotStatus, *, came: bool = True) -> None:
        """Take over the robot's clock, in a new cycle or in none."""
        self._time = self._clock = status.time
        self._went = self._connection.now()
        self._came = self._went if came else self._came

    def _deadline(self) -> float:
        """Return this side's time at which the next status is taken for lost [s]."""
        now, period = self._connection.now(), self._connection.period
        # Nobody waits for a command where the robot is answered all the same.
        if self._connection.paced:
            return now + self._settings.silence
        return max(self._expected(), now + _LEAST * period)

    def _expected(self) -> float:
        """Return when a status that is not accounted for should have come, told by the last."""
        pace = min(max(min(self._paces), 1.0), _SLOWEST)
        due = self._time - self._clock + _PATIENCE * self._connection.period
        return self._went + pace * due

    def _next(self, until: float) -> RobotStatus | None:
        left = until - self._connection.now()
        return self._connection.next(left) if left > 0.0 else None

    def _next_or_none(self, until: float) -> RobotStatus | None:
        """Return what `_next` does; nothing, a cycle later, where the connection fails."""
        try:
            return self._next(until)
        except (Exception, SystemExit):  # whatever it is, the robot is to come to rest
            time.sleep(self._connection.period)
            return None

    def answered(self) -> None:
        """Note that a command has been sent in the cycle."""
        self.unanswered = None
