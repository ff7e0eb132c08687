"""A drive: listen, approach, run, stop; and a bounded stop whenever a watch finds a reason.

- Listening to a robot before anything is sent: it must be the right one, and stand still.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from queue import SimpleQueue
from threading import Thread

import numpy as np

from ..errors import RobotError, SimulationError
from ..inputs.fields import Array
from ..inputs.processes import signals_held
from ..laws.law import Signals
from .approach import Approach, PlannedApproach, RampDown, RobotTask
from .cycles import Cycle, Cycles, Log, Phase, StopError, Watches
from .robots import (
    Command,
    Connection,
    DriveSettings,
    LawSample,
    Motion,
    Robot,
    RobotStatus,
)
from .shared_cycles import without_collection

# Share of a cycle by which the cycles that were heard may differ from it.
_UNEVEN = 0.2
# Share of the cycles that are heard one by one at least, also where this side comes late.
_TYPICAL = 0.2
# Time for which nobody is asked whether the drive is to end [s].
_DEAF = 0.1
# Intervals from which the cycle is judged, if they are heard in the time of contact: a machine that
# is busy for longer than it listens hears one alone.
_JUDGED = 10
# Times of listening by this side's clock, after which the robot's clock is too slow.
_PATIENCE = 10.0


def listen(
    connection: Connection,
    names: Sequence[str],
    settings: DriveSettings,
    log: Log,
    is_told_to_stop: Callable[[], bool],
) -> RobotStatus:
    """Return the last status of a robot that has stood still for a while.

    Args:
        connection: Connection to the robot.
        names: Names of its joints.
        settings: How long that is, and what standing still means.
        log: What was heard is added to it.
        is_told_to_stop: Whether somebody wants the drive to end.

    Raises:
        RobotError: If nothing is heard; if the robot has other joints or another cycle, or moves;
            if what it tells cannot be read; or if another program commands it.
        StopError: If the drive is to end.
    """

    def awaited() -> RobotStatus:
        return _await_status(connection, len(names), settings.contact, is_told_to_stop)

    began = connection.now()
    statuses, since = [awaited()], 0.0
    while statuses[-1].time - statuses[0].time < settings.listen or (
        len(statuses) <= _JUDGED and since < settings.contact
    ):
        status = awaited()
        elapsed_time, since = status.time - statuses[-1].time, connection.now() - began
        _require_clock(elapsed_time, since, settings)
        if abs(elapsed_time) > settings.late:
            # As messages do that have waited since the connection was made.
            statuses = [status]
        elif elapsed_time > 0.0:
            log.add("listen", Cycle(status.time, elapsed_time, status), None, connection.now())
            statuses.append(status)
    # Of messages that come together only one is heard.
    typical = 0.0 if connection.paced else _TYPICAL
    cycle = float(np.quantile(np.diff([status.time for status in statuses]), typical))
    if not abs(cycle - connection.period) <= _UNEVEN * connection.period:
        raise RobotError(
            f"robot: its messages are {cycle * 1e3:.3g} ms apart; they should be "
            f"{connection.period * 1e3:g} ms"
        )
    if count := connection.others():
        raise RobotError(
            f"robot: another program commands it, {count} times in {settings.listen:g} s; end that "
            "one first"
        )
    _require_still(statuses, names, settings)
    return statuses[-1]


def _await_status(
    connection: Connection, joints: int, timeout: float, is_told_to_stop: Callable[[], bool]
) -> RobotStatus:
    until, status = connection.now() + timeout, None
    while status is None:
        if is_told_to_stop():
            raise StopError("interrupted", "told to stop before anything was sent")
        if failure := connection.failure:
            raise RobotError(f"robot: {failure}")
        if (left := until - connection.now()) <= 0.0:
            raise RobotError(f"robot: no status within {timeout:g} s; is it on, at this address?")
        status = connection.next(min(left, _DEAF))
    for each in (*status.earlier, status):
        if complaint := each.complaint(joints):
            raise RobotError(f"robot: {complaint}")
        if not (np.isfinite(each.position).all() and np.isfinite(each.velocity).all()):
            raise RobotError("robot: a status is not a number")
    return status


def _require_clock(elapsed_time: float, since: float, settings: DriveSettings) -> None:
    """Raise a RobotError for a clock that jumps, or hardly goes, after a time of listening [s]."""
    if abs(elapsed_time) > settings.late and since > settings.contact:
        raise RobotError(
            f"robot: its clock went by {elapsed_time:.4g} s between two messages; do two "
            "robots tell statuses at this address?"
        )
    if since > settings.contact + _PATIENCE * settings.listen:
        raise RobotError(
            f"robot: its clock does not go by {settings.listen:g} s in {since:.4g} s of listening"
        )


def _require_still(
    statuses: Sequence[RobotStatus], names: Sequence[str], settings: DriveSettings
) -> None:
    """Raise a RobotError if a joint moves, by its speed or by where it is."""
    positions = np.array([status.position for status in statuses])
    speeds = np.array([status.velocity for status in statuses])
    drift = np.ptp(positions, axis=0) / settings.listen
    fastest = np.maximum(np.abs(np.mean(speeds, axis=0)), drift)
    joint = int(np.argmax(fastest))
    if fastest[joint] > settings.still:
        raise RobotError(
            f"robot: {names[joint]} moves at {fastest[joint]:.3g} rad/s; it must stand still "
            "before it is driven"
        )


#: Told what happens, in a sentence.
Say = Callable[[str], None]

# Distance between what a robot holds and where it is, up to which it is started from what it holds.
_HOLD_TOLERANCE = 0.01
# Distance from there up to which it has not moved since [rad].
_MOTION_TOLERANCE = 0.02
# What ends nothing but a drive: Drake ends a process where a condition of its own fails.
_ANY = (Exception, SystemExit)
# Time that whoever is told what happens may take after the end [s].
_LAST_WORDS = 5.0
# Cycles for which a robot at rest is told to stay, and those after which it must rest.
_STAY, _LONGEST = 40, 2000


@dataclass(frozen=True)
class DriveOutcome:
    """What came of a drive.

    Attributes:
        log: Every cycle, from the first one that was listened to.
        origin: Robot's clock at time zero of the task [s]; NaN if that was never reached.
        stopped: Why the robot was stopped before the end of its task; None if it was not.
        rested: Time from then, or from the end, until all joints were commanded to rest [s]; NaN if
            they never were.
        lost: Cycles without a status in time or, of a robot that does not wait, cycles that it has
            gone by without an answer while it was moved.
        late: Cycles that had passed when this side came to them, or, of a law that the connection
            runs, cycles that were answered without it.
        samples: Samples of such a law.
        commanded: See `Connection.commanded`.
    """

    log: Log
    origin: float
    stopped: StopError | None
    rested: float
    lost: int
    late: int
    samples: Sequence[LawSample] = ()
    commanded: Signals | None = None


class Session:
    """One drive of one robot.

    Args:
        task: What it is to do.
        robot: The robot.
        connection: Connection to it.
        settings: What is tolerated.
        say: Told what happens, by a thread of its own: whoever is slow to hear it, or fails, does
            not touch the cycles.
        is_told_to_stop: Whether somebody wants the drive to end; asked in every cycle.
    """

    def __init__(
        self,
        task: RobotTask,
        robot: Robot,
        connection: Connection,
        settings: DriveSettings,
        say: Say,
        is_told_to_stop: Callable[[], bool],
    ) -> None:
        self._task, self._connection, self._settings = task, connection, settings
        self._robot = robot
        self._say, self._is_told_to_stop = say, is_told_to_stop
        self._hardest = robot.command_limits.require("acceleration", "coming to rest")
        self._log = Log(len(task.names))
        self._cycles = Cycles(connection, settings, len(task.names))
        self._watches = Watches(
            task.names, robot.measurement_limits, robot.command_limits, settings.lag, settings.jump
        )
        self._origin = np.nan
        # Whether the connection runs the law.
        self._is_run_there = False
        # What was told and sent last; there is a first of both before anything moves.
        self._last: RobotStatus
        self._sent: Array
        self._sent_at: float
        # What moves it, and the motion that was commanded last.
        self._moved: Approach | RobotTask
        self._motion: Motion
        self._held = 0.0
        # Commands of the stop that could not be sent, and why the last could not.
        self._unsent, self._why_unsent = 0, ""

    def drive(self) -> DriveOutcome:
        """Bring the robot to the start, let it do its task, and bring it to rest.

        Raises:
            RobotError: If nothing answers, or the robot is not ready; nothing was sent then.
            InvalidInputError: If the robot stands where no way to the start begins.
        """
        with _speaking(self._say) as self._say:
            try:
                outcome = self._drive()
            finally:
                self._end()
        # The last cycles come as the connection ends.
        lost = self._connection.lost
        return outcome if lost is None else replace(outcome, lost=lost)

    def _drive(self) -> DriveOutcome:
        task, connection = self._task, self._connection
        kind = PlannedApproach if connection.paced else Approach
        # What is done for the first time takes longest: it is done now.
        Approach(task, self._settings, task.start, connection.period).advance(connection.period)
        connection.listen()
        try:
            status = listen(
                connection, task.names, self._settings, self._log, self._is_told_to_stop
            )
        except StopError as error:
            return self._came_of(error, 0.0)
        self._sent = _posture(status)
        approach = kind(task, self._settings, self._sent, connection.period)
        self._moved, self._motion = approach, approach.motion()
        way = float(np.abs(self._sent - task.start).max())
        for doubt in approach.doubts:
            self._say(f"warning: {doubt}")
        self._say(f"approach: {way:.3g} rad to the start")
        if task.law_in_c is not None:
            limits = task.limits, self._robot.command_limits
            self._is_run_there = connection.take_law(task.law_in_c, *limits, self._settings.late)
        with without_collection():
            connection.begin()
            try:
                self._begin()
                self._require_unmoved()
            except StopError as error:
                reason = error.reason if error.watch == "robot" else error
                raise RobotError(f"robot: {reason}") from None
            stop = self._moved_until(approach)
            began = connection.now()
            time_to_rest = self._stop() - began
        self._say(
            f"at rest {time_to_rest:.3g} s later"
            if time_to_rest >= 0.0
            else "not seen to come to rest"
        )
        return self._came_of(stop, time_to_rest)

    def _came_of(self, stop: StopError | None, time_to_rest: float) -> DriveOutcome:
        stop = self._with_robots_reason(stop)
        if self._unsent:
            stop = StopError(
                stop.watch if stop else "connection",
                f"{f'{stop.reason}; ' if stop else ''}{self._unsent} commands of the stop "
                f"could not be sent: {self._why_unsent}",
            )
        there = self._is_run_there
        late = self._connection.late if there else self._cycles.late
        samples = self._connection.samples() if there else ()
        counts, commanded = (self._cycles.lost, late), self._connection.commanded()
        motion = *counts, samples, commanded
        return DriveOutcome(self._log, self._origin, stop, time_to_rest, *motion)

    def _with_robots_reason(self, stop: StopError | None) -> StopError | None:
        """Return why the robot was stopped, with its own reason if it takes no more commands."""
        failure = self._connection.failure
        if not failure or (stop is not None and stop.watch == "robot"):
            return stop
        if stop is None:
            return StopError("robot", f"{failure}, as it was to come to rest")
        if stop.watch in ("silence", "clock"):
            # That follows from it.
            return StopError("robot", f"{failure}; seen here as {stop}")
        return StopError(stop.watch, f"{stop.reason}; then the robot: {failure}")

    def _moved_until(self, approach: Approach) -> StopError | None:
        """Move the robot until the end of its task, or until it is to stop; return why."""
        try:
            self._go(approach)
            self._moved = self._task
            self._say(f"run: {self._task.duration:g} s")
            self._watch() if self._is_run_there else self._run()
        except StopError as error:
            stop = error
        except (
            Exception
        ) as error:  # whatever it is, the robot comes to rest, and what it did is kept
            stop = StopError("error", _name_of(error))
            stop.__cause__ = error
        except BaseException:
            self._stop()
            raise
        else:
            return None
        self._say(f"stopped by {stop}")
        return stop

    def _end(self) -> None:
        """Hand the robot back, which rests; nothing of what it did is lost where that fails."""
        try:
            self._connection.end()
        except _ANY as error:  # whatever it is
            self._say(f"the connection did not end: {_name_of(error)}")

    def _begin(self) -> None:
        """Begin to count cycles at a status that comes now.

        The first one may have waited since this side was busy.

        Raises:
            StopError: If none comes, or the robot is not as it was.
        """
        self._heard_now()
        self._last = self._heard_now()
        self._cycles.begin(self._last)
        self._sent_at = self._connection.now()

    def _heard_now(self) -> RobotStatus:
        contact = self._settings.contact
        if (status := self._connection.next(contact)) is None:
            if failure := self._connection.failure:
                raise StopError("robot", failure)
            raise StopError("silence", f"no status within {contact:g} s")
        for each in (*status.earlier, status):
            self._watches.sound(each)
            self._watches.within(each)
        return status

    def _require_unmoved(self) -> None:
        """Raise a StopError if the robot is no longer where its way begins."""
        off = np.abs(self._last.position - self._sent)
        joint = int(np.argmax(off))
        if off[joint] > _MOTION_TOLERANCE:
            name = self._task.names[joint]
            raise StopError(
                "jump", f"{name} has moved by {off[joint]:.3g} rad since it was listened to"
            )

    def _go(self, approach: Approach) -> None:
        """Bring the robot to the start, and wait until it is there."""
        begin, cycle = self._last.time, self._cycle()
        while not (approach.has_arrived and self._is_still()):
            if (since := cycle.time - begin) > self._settings.approach_time:
                raise StopError("approach", f"not at the start after {since:.3g} s")
            elapsed_time = cycle.passed
            if (motion := self._note_commands(cycle)) is not None:
                approach.resume(motion, round(elapsed_time / self._connection.period))
                elapsed_time = self._connection.period
            is_working = approach.is_working
            self._send("approach", cycle, approach.advance(elapsed_time))
            if is_working:
                # The robot rests, and however long that takes is no matter.
                self._begin()
            cycle = self._cycle()
        self._origin = cycle.time
        if self._connection.paced:
            # Cycles in which the way was worked out are not late.
            self._cycles.late = 0

    def _is_still(self) -> bool:
        return not np.abs(self._last.velocity).max() > self._settings.still

    def _run(self) -> None:
        """Advance the task by the robot's clock until its end."""
        task = self._task
        while task.time < task.duration:
            cycle = self._cycle()
            # The robot's clock has microseconds.
            left = task.duration - (cycle.time - self._origin)
            until = task.duration if left < 1e-5 else task.duration - left
            try:
                if (motion := self._note_commands(cycle)) is not None:
                    task.resume(until - task.period, motion)
                command = task.advance(until, self._last.position, self._last.velocity)
            except (SimulationError, RuntimeError) as error:
                raise StopError("law", str(error)) from error
            except _ANY as error:  # a law may raise anything
                raise StopError("law", _name_of(error)) from error
            self._send("run", cycle, command)

    def _watch(self) -> None:
        """Watch the robot while the connection runs the law, until its end."""
        connection = self._connection
        connection.run()
        while True:
            cycle = self._cycle()
            self._note_commands(cycle)
            self._cycles.note_command()
            course = connection.course
            self._origin, self._sent_at = course.origin, connection.now()
            phase: Phase = "approach" if np.isnan(course.origin) else "run"
            self._log.add(phase, cycle, self._sent, self._sent_at)
            if course.why:
                watch, _, why = course.why.partition(": ")
                raise StopError(watch, why)
            if course.is_over:
                return

    def _cycle(self) -> Cycle:
        """Return the next cycle, after every watch has looked at it."""
        if self._is_told_to_stop():
            raise StopError("interrupted", "told to stop")
        cycle = self._cycles.due()
        if count := self._connection.others():
            raise StopError("others", f"another program commands the robot, {count} times by now")
        for each in cycle.statuses:
            self._watches.sound(each)
            self._watches.within(each)
            self._watches.continues(each, self._last)
            # One that comes after its cycle is news all the same.
            self._last = max(self._last, each, key=lambda status: status.time)
        if (status := cycle.status) is not None:
            position = self._sent if status.motion is None else status.motion.position
            self._watches.follows(status, position)
        return cycle

    def _note_commands(self, cycle: Cycle) -> Motion | None:
        """Return what a paced connection has commanded until a cycle, and note it."""
        motion = None if cycle.status is None else cycle.status.motion
        if motion is not None:
            self._motion, self._sent = motion, motion.position
        return motion

    def _send(self, phase: Phase, cycle: Cycle, command: Array) -> None:
        """Send a command of the approach or the run, after a last look at it."""
        position, elapsed_time, until = command, cycle.passed, None
        if self._connection.paced:
            # What is sent goes on from this cycle, in which the robot has been answered.
            position, elapsed_time, until = self._sent, self._connection.period, self._motion
        self._watches.may_be_sent(command, self._sent, elapsed_time, until)
        motion = self._moved.motion()
        self._watches.may_be_stopped(motion)
        self._connection.send(Command(cycle.time, motion, self._moved.limits, self._moved.then()))
        self._motion, self._held = motion, self._moved.held
        self._note_sent(phase, cycle, command, position)

    def _note_sent(self, phase: Phase, cycle: Cycle, command: Array, position: Array) -> None:
        self._cycles.note_command()
        self._sent, self._sent_at = command, self._connection.now()
        self._log.add(phase, cycle, position, self._sent_at)

    def _stop(self) -> float:
        """Bring the robot to rest, whatever it tells; return when it was commanded to [s].

        After a time without commands it stands already, where it was commanded to be last. Nothing
        in it raises, and a signal waits until the robot rests.
        """
        with signals_held():
            return self._rest() if self._connection.paced else self._ramp_down()

    def _ramp_down(self) -> float:
        moving = self._moved
        ramp = RampDown(
            *self._motion, moving.limits, self._hardest, moving.period, hold_time=self._held
        )
        rest_time, count = np.nan, 0
        for _ in range(_LONGEST):
            cycle = self._cycles.whatever_comes()
            stands = self._connection.now() - self._sent_at > self._settings.hold
            if ramp.rests or stands or count:
                count += 1
                command = self._sent
            else:
                command = ramp.advance(cycle.passed)
            self._send_of_stop(cycle, command)
            if count == 1:
                rest_time = self._sent_at
            if count > _STAY:
                break
        return rest_time

    def _send_of_stop(self, cycle: Cycle, command: Array) -> None:
        """Send a command of the stop; one that cannot be sent is counted, and the next follows."""
        motion = self._motion._replace(position=command)
        try:
            self._connection.send(Command(cycle.time, motion, self._moved.limits))
        except _ANY as error:  # whatever it is, the next one may come through
            self._unsent += 1
            self._why_unsent = _name_of(error)
        self._note_sent("stop", cycle, command, command)

    def _rest(self) -> float:
        """Wait until a paced connection has brought the robot to rest; return when it did [s]."""
        connection = self._connection
        connection.rest()
        arrival = connection.now()
        while not connection.failure and connection.now() - arrival < self._settings.contact:
            self._cycles.note_command()
            cycle = self._cycles.whatever_comes()
            if (motion := self._note_commands(cycle)) is None:
                continue
            arrival = connection.now()
            self._log.add("stop", cycle, motion.position, arrival)
            if motion.rests:
                return arrival
        return np.nan


def _posture(status: RobotStatus) -> Array:
    """Return the posture to start from: what a robot holds, if it is there."""
    near = np.abs(status.commanded - status.position).max() <= _HOLD_TOLERANCE
    return status.commanded if near else status.position


def _name_of(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


@contextmanager
def _speaking(say: Say) -> Iterator[Say]:
    """Say things in a thread, for as long as somebody hears them."""
    texts: SimpleQueue[str | None] = SimpleQueue()

    def speak() -> None:
        while (text := texts.get()) is not None:
            with suppress(Exception):
                say(text)

    thread = Thread(target=speak, daemon=True)
    thread.start()
    try:
        yield texts.put
    finally:
        texts.put(None)
        thread.join(_LAST_WORDS)
