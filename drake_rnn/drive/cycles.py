"""The cycles of a robot, counted by its own clock, also where messages are lost or late.

- Why a robot is to be stopped: each watch looks at one thing, and says what is wrong with it.
- What was heard and sent in each cycle.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import JointLimits
from .robots import Connection, DriveSettings, Motion, RobotStatus

# Share by which rounding may take a command beyond a speed.
_ROUNDING = 1e-6


class StopError(Exception):
    """A reason to stop the robot.

    Attributes:
        watch: Name of the watch that found it.
        reason: What it found.
    """

    def __init__(self, watch: str, reason: str) -> None:
        super().__init__(f"{watch}: {reason}")
        self.watch, self.reason = watch, reason


class Watches:
    """The watches on one robot.

    Args:
        names: Names of the joints.
        measured: Limits of what is measured.
        commanded: Limits of what is commanded.
        lag: Largest distance of a joint from its command [rad].
        jump: Largest jump of a measured joint beyond what its largest speed explains [rad].
    """

    def __init__(
        self,
        names: Sequence[str],
        measured: JointLimits,
        commanded: JointLimits,
        lag: float,
        jump: float,
    ) -> None:
        self._names = names
        self._measured, self._commanded = measured, commanded
        self._lag, self._jump = lag, jump

    def sound(self, status: RobotStatus) -> None:
        """Raise a StopError for what is no status, or a measurement that is not a number."""
        if complaint := status.complaint(len(self._names)):
            raise StopError("status", complaint)
        for what, values, unit in (
            ("position", status.position, "rad"),
            ("velocity", status.velocity, "rad/s"),
        ):
            if not np.isfinite(values).all():
                joint = int(np.argmin(np.isfinite(values)))
                raise StopError(
                    "status", f"{what} of {self._names[joint]} is {values[joint]} {unit}"
                )

    def within(self, status: RobotStatus) -> None:
        """Raise a StopError for a joint beyond the limits of what is measured."""
        if self._measured.violation(status.position).any():
            raise StopError("limits", self._measured.complaint(status.position, 0.0, self._names))
        joint = int(np.argmax(np.abs(status.velocity) / self._measured.velocity))
        speed, most = abs(status.velocity[joint]), self._measured.velocity[joint]
        if speed > most:
            raise StopError(
                "limits", f"{self._names[joint]} moves at {speed:.4g} rad/s; it may {most:.4g}"
            )

    def follows(self, status: RobotStatus, commanded: Array) -> None:
        """Raise a StopError for a joint far from its command, shape (n,) [rad]."""
        joint, off = _largest(status.position - commanded)
        if off > self._lag:
            raise StopError(
                "lag", f"{self._names[joint]} is {off:.4g} rad from its command; {self._lag:g} may"
            )

    def continues(self, status: RobotStatus, before: RobotStatus) -> None:
        """Raise a StopError for a joint that has jumped since another status."""
        time = abs(status.time - before.time)
        distance = np.abs(status.position - before.position)
        joint, off = _largest(np.maximum(distance - time * self._measured.velocity, 0.0))
        if off > self._jump:
            raise StopError(
                "jump",
                f"{self._names[joint]} has moved by {distance[joint]:.4g} rad in {time:.4g} s",
            )

    def may_be_sent(
        self, position: Array, before: Array, time: float, motion: Motion | None = None
    ) -> None:
        """Raise a StopError for a command beyond the limits, which is then not sent.

        A robot that has lost cycles has held its acceleration in them, and may have become faster
        than its limits: it is slowed down then, which is no reason to stop.

        Args:
            position: The command, shape (n,) [rad].
            before: The command before, shape (n,) [rad].
            time: Time from that to this one [s].
            motion: What a robot that loses cycles has been commanded until then; None for another.
        """
        if not np.isfinite(position).all():
            raise StopError("command", f"the law commands {position.tolist()} rad")
        limits = self._commanded
        if (limits.violation(position) > _ROUNDING).any():
            raise StopError("command", limits.complaint(position, 0.0, self._names))
        fastest = limits.velocity
        if motion is not None:
            # As it goes on, and as it would with its acceleration held once more.
            speeds = np.abs([motion.velocity, motion.velocity + time * motion.acceleration])
            fastest = np.maximum(fastest, speeds.max(axis=0))
        joint = int(np.argmax(np.abs(position - before) / fastest))
        step, most = abs(position[joint] - before[joint]), time * fastest[joint]
        if step > most * (1.0 + _ROUNDING) + 1e-9:
            raise StopError(
                "command",
                f"{self._names[joint]} is to move by {step:.4g} rad in {time:.4g} s; it may by "
                f"{most:.4g} rad",
            )

    def may_be_stopped(self, motion: Motion) -> None:
        """Raise a StopError for a commanded motion that no stop can begin with."""
        for what, values, unit in (
            ("velocity", motion.velocity, "rad/s"),
            ("acceleration", motion.acceleration, "rad/s^2"),
        ):
            if not np.isfinite(values).all():
                joint = int(np.argmin(np.isfinite(values)))
                raise StopError(
                    "command",
                    f"the law commands {self._names[joint]} a {what} of {values[joint]} {unit}",
                )


def _largest(values: Array) -> tuple[int, float]:
    """Return the joint with the largest magnitude, and that."""
    joint = int(np.argmax(np.abs(values)))
    return joint, float(abs(values[joint]))


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
    def statuses(self) -> Sequence[RobotStatus]:
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
                elapsed_time = self._note_passed_time(status)
                if elapsed_time > _EARLY * period:
                    self.late += round(elapsed_time / period) - 1
                    self._account(status)
                    self.unanswered = elapsed_time
                    return Cycle(self._time, elapsed_time, status, earlier)
                until = max(until, min(self._due_time(), began + self._settings.silence))
            # It cannot be read, or its cycle is accounted for, but not yet looked at.
            earlier.append(replace(status, earlier=()))
            del earlier[:-_MOST]
        self._time += period
        self._require_heard()
        self.lost, self._came = self.lost + 1, self._connection.now()
        return Cycle(self._time, period, None, earlier)

    def _note_passed_time(self, status: RobotStatus) -> float:
        """Return how far a status has moved the robot's clock on [s], and note that it has come."""
        now = self._heard = self._connection.now()
        elapsed_time = self._require_near(status)
        advance = status.time - now - self._ahead
        if advance > self._settings.late + _FAST * (now - self._since):
            raise StopError(
                "clock",
                f"the robot's clock has gone {advance:.3g} s further than this side's in "
                f"{now - self._since:.4g} s",
            )
        if status.time > self._clock:
            self._paces.append((now - self._went) / (status.time - self._clock))
            self._clock, self._went = status.time, now
        return elapsed_time

    def _require_near(self, status: RobotStatus) -> float:
        """Return how far a status is from where the robot's clock is accounted for [s].

        Raises:
            StopError: If that is further than it may be; the clock is taken over.
        """
        elapsed_time, here = status.time - self._time, self._connection.now() - self._came
        if not abs(elapsed_time) <= self._settings.late:
            self._account(status)
            raise StopError(
                "clock",
                f"the robot's clock went by {elapsed_time:.4g} s in a cycle, ours by {here:.3g} s; "
                f"{self._settings.late:g} s are allowed",
            )
        return elapsed_time

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
        if (elapsed_time := self.unanswered) is not None:
            return Cycle(self._time, elapsed_time, None)
        until = self._deadline()
        while (status := self._next_or_none(until)) is not None:
            if status.complaint(self._joints):
                continue
            elapsed_time = status.time - self._time
            if abs(elapsed_time) > self._settings.late:
                apart = self._connection.now() - self._came
                self._account(status, came=apart >= _APART * period)
                if apart >= _APART * period:
                    return Cycle(self._time, period, status)
            elif elapsed_time > _EARLY * period:
                self._account(status)
                return Cycle(self._time, elapsed_time, status)
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
        return max(self._due_time(), now + _LEAST * period)

    def _due_time(self) -> float:
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

    def note_command(self) -> None:
        """Note that a command has been sent in the cycle."""
        self.unanswered = None


#: What a drive does in a cycle.
Phase = Literal["listen", "approach", "run", "stop"]
PHASES: tuple[Phase, ...] = get_args(Phase)


@dataclass
class Log:
    """The cycles of a drive, in the order in which they were carried out.

    Attributes:
        joints: Number of joints.
        times: Robot's clock in each cycle [s].
        hosts: Clock of this side when the command was sent [s].
        phases: What was done.
        measured: Measured positions, shape (n,) each [rad]; NaN where no status came in time.
        velocities: Measured velocities, shape (n,) each [rad/s]; likewise.
        sent: Commanded positions, shape (n,) each [rad]; NaN where nothing was sent.
    """

    joints: int
    times: list[float] = field(default_factory=list)
    hosts: list[float] = field(default_factory=list)
    phases: list[int] = field(default_factory=list)
    measured: list[Array] = field(default_factory=list)
    velocities: list[Array] = field(default_factory=list)
    sent: list[Array] = field(default_factory=list)

    def add(self, phase: Phase, cycle: Cycle, command: Array | None, host: float) -> None:
        """Add a cycle; without a command if nothing was sent in it."""
        nothing = np.full(self.joints, np.nan)
        status = cycle.status
        self.times.append(cycle.time)
        self.hosts.append(host)
        self.phases.append(PHASES.index(phase))
        self.measured.append(nothing if status is None else status.position)
        self.velocities.append(nothing if status is None else status.velocity)
        self.sent.append(nothing if command is None else command)

    def arrays(self) -> dict[str, Array]:
        """Return all cycles as arrays, by name, as a file has them."""
        n = self.joints
        return {
            "time": np.array(self.times),
            "host_time": np.array(self.hosts),
            "phase": np.array([PHASES[phase] for phase in self.phases]),
            "position_measured": np.reshape(self.measured, (-1, n)),
            "velocity_measured": np.reshape(self.velocities, (-1, n)),
            "position_sent": np.reshape(self.sent, (-1, n)),
        }

    def of(self, phase: Phase) -> dict[str, Array]:
        """Return the cycles of a phase as arrays, by name."""
        arrays = self.arrays()
        mask = arrays["phase"] == phase
        return {name: values[mask] for name, values in arrays.items()}
