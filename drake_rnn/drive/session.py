"""A drive: listen, approach, run, stop; and a bounded stop whenever a watch finds a reason."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ..errors import RobotError, SimulationError
from ..inputs.fields import Array
from .approach import Approach
from .connection import Command, Connection, Motion, RobotStatus
from .cycles import Cycle, Cycles
from .listening import listened
from .log import Log, Phase
from .planned_approach import PlannedApproach
from .ramp_down import RampDown
from .robot_task import RobotTask
from .robots import Robot
from .settings import DriveSettings
from .watches import StopError, Watches

#: Told what happens, in a sentence.
Say = Callable[[str], None]

# Distance between what a robot holds and where it is, up to which it is started from what it holds.
_HELD = 0.01
# Cycles for which a robot at rest is told to stay, and those after which it must rest.
_STAY, _LONGEST = 40, 2000


@dataclass(frozen=True)
class Driven:
    """What came of a drive.

    Attributes:
        log: Every cycle, from the first one that was listened to.
        origin: Robot's clock at time zero of the task [s]; NaN if that was never reached.
        stopped: Why the robot was stopped before the end of its task; None if it was not.
        rested: Time from then, or from the end, until all joints were commanded to rest [s].
        lost: Cycles without a status in time.
        late: Cycles that had passed when this side came to them.
    """

    log: Log
    origin: float
    stopped: StopError | None
    rested: float
    lost: int
    late: int


class Session:
    """One drive of one robot.

    Args:
        task: What it is to do.
        robot: The robot.
        connection: Connection to it.
        settings: What is tolerated.
        say: Told what happens.
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
        self._say, self._is_told_to_stop = say, is_told_to_stop
        self._hardest = robot.commanded.require("acceleration", "coming to rest")
        self._log = Log(len(task.names))
        self._cycles = Cycles(connection, settings)
        self._watches = Watches(
            task.names, robot.measured, robot.commanded, settings.lag, settings.jump
        )
        self._origin = np.nan
        # What was told and sent last; there is a first of both before anything moves.
        self._last: RobotStatus
        self._sent: Array
        self._sent_at: float
        # What moves it, and the motion that was commanded last.
        self._moved: Approach | RobotTask
        self._motion: Motion
        self._held = 0.0

    def drive(self) -> Driven:
        """Bring the robot to the start, let it do its task, and bring it to rest.

        Raises:
            RobotError: If nothing answers, or the robot is not ready; nothing was sent then.
            InvalidInputError: If the robot stands where no way to the start begins.
        """
        try:
            return self._drive()
        finally:
            self._connection.end()

    def _drive(self) -> Driven:
        task, connection = self._task, self._connection
        status = listened(connection, task.names, self._settings, self._log)
        self._sent = _held(status)
        kind = PlannedApproach if connection.paced else Approach
        approach = kind(task, self._settings, self._sent, connection.period)
        self._moved, self._motion = approach, approach.motion()
        stopped: StopError | None = None
        with _without_collection():
            connection.begin()
            self._begin(status)
            try:
                self._go(approach)
                self._moved = task
                self._run()
            except StopError as error:
                stopped = error
                self._say(f"stopped by {stopped}")
            except BaseException:
                # Whatever it is, the robot comes to rest first.
                self._stop()
                raise
            began = connection.now()
            rested = self._stop() - began
        self._say(f"at rest {rested:.3g} s later")
        cycles = self._cycles
        return Driven(self._log, self._origin, stopped, rested, cycles.lost, cycles.late)

    def _begin(self, status: RobotStatus) -> None:
        """Begin to count cycles: what was computed since the last status has taken its time."""
        newest = self._connection.next(self._settings.contact)
        self._last = status if newest is None else newest
        try:
            self._watches.sound(self._last)
            self._watches.within(self._last)
        except StopError as error:
            raise RobotError(f"robot: {error}") from None
        self._cycles.begin(self._last)
        self._sent_at = self._connection.now()

    def _go(self, approach: Approach) -> None:
        """Bring the robot to the start, and wait until it is there."""
        way = float(np.abs(self._sent - self._task.start).max())
        self._say(f"approach: {way:.3g} rad to the start")
        begin, cycle = self._last.time, self._cycle()
        while not (approach.arrived and self._is_still(cycle.status)):
            if (since := cycle.time - begin) > self._settings.approach_time:
                raise StopError("approach", f"not at the start after {since:.3g} s")
            passed = cycle.passed
            if (motion := self._commanded(cycle)) is not None:
                approach.resume(motion, round(passed / self._connection.period))
                passed = self._connection.period
            is_working = approach.is_working
            self._send("approach", cycle, approach.advance(passed))
            if is_working:
                # The robot rests, and however long that takes is no matter.
                self._begin(self._last)
            cycle = self._cycle()
        self._origin = cycle.time
        if self._connection.paced:
            # Cycles in which the way was worked out are not late.
            self._cycles.late = 0

    def _is_still(self, status: RobotStatus | None) -> bool:
        return status is not None and not np.abs(status.velocity).max() > self._settings.still

    def _run(self) -> None:
        """Advance the task by the robot's clock until its end."""
        task = self._task
        self._say(f"run: {task.duration:g} s")
        while task.time < task.duration:
            cycle = self._cycle()
            # The robot's clock has microseconds.
            left = task.duration - (cycle.time - self._origin)
            until = task.duration if left < 1e-5 else task.duration - left
            try:
                if (motion := self._commanded(cycle)) is not None:
                    task.resume(until - task.period, motion)
                command = task.advance(until, self._last.position, self._last.velocity)
            except (SimulationError, RuntimeError) as error:
                raise StopError("law", str(error)) from error
            self._send("run", cycle, command)

    def _cycle(self) -> Cycle:
        """Return the next cycle, after every watch has looked at it."""
        if self._is_told_to_stop():
            raise StopError("interrupted", "told to stop")
        cycle = self._cycles.due()
        for told in cycle.told:
            self._watches.sound(told)
            self._watches.within(told)
            self._watches.continues(told, self._last)
        if (status := cycle.status) is not None:
            commanded = self._sent if status.motion is None else status.motion.position
            self._watches.follows(status, commanded)
            self._last = status
        return cycle

    def _commanded(self, cycle: Cycle) -> Motion | None:
        """Return what a paced connection has commanded until a cycle, and note it."""
        motion = None if cycle.status is None else cycle.status.motion
        if motion is not None:
            self._motion, self._sent = motion, motion.position
        return motion

    def _send(self, phase: Phase, cycle: Cycle, command: Array) -> None:
        motion = self._motion._replace(position=command)
        sent, passed, until = command, cycle.passed, None
        if self._connection.paced:
            # What is sent goes on from this cycle, in which the robot has been answered.
            sent, passed, until = self._sent, self._connection.period, self._motion
        if phase != "stop":
            self._watches.may_be_sent(command, self._sent, passed, until)
            self._motion, self._held = self._moved.motion(), self._moved.held
            motion = self._motion
        then = self._moved.then()
        self._connection.send(Command(cycle.time, motion, self._moved.limits, then))
        self._cycles.answered()
        self._sent, self._sent_at = command, self._connection.now()
        self._log.add(phase, cycle, sent, self._sent_at)

    def _stop(self) -> float:
        """Bring the robot to rest, whatever it tells; return when it was commanded to [s].

        After a time without commands it stands already, where it was commanded to be last.
        """
        if self._connection.paced:
            return self._rest()
        moved = self._moved
        ramp = RampDown(*self._motion, moved.limits, self._hardest, moved.period, held=self._held)
        rested, stayed = np.nan, 0
        for _ in range(_LONGEST):
            cycle = self._cycles.whatever_comes()
            stands = self._connection.now() - self._sent_at > self._settings.hold
            if ramp.rests or stands or stayed:
                stayed += 1
                command = self._sent
            else:
                command = ramp.advance(cycle.passed)
            self._send("stop", cycle, command)
            if stayed == 1:
                rested = self._sent_at
            if stayed > _STAY:
                break
        return rested

    def _rest(self) -> float:
        """Wait until a paced connection has brought the robot to rest; return when it did [s]."""
        connection = self._connection
        connection.rest()
        heard = connection.now()
        while not connection.failure and connection.now() - heard < self._settings.contact:
            self._cycles.answered()
            cycle = self._cycles.whatever_comes()
            if (motion := self._commanded(cycle)) is None:
                continue
            heard = connection.now()
            self._log.add("stop", cycle, motion.position, heard)
            if motion.rests:
                return heard
        return np.nan


def _held(status: RobotStatus) -> Array:
    """Return the posture to start from: what a robot holds, if it is there."""
    near = np.abs(status.commanded - status.position).max() <= _HELD
    return status.commanded if near else status.position


@contextmanager
def _without_collection() -> Iterator[None]:
    """Keep Python from collecting garbage, which may take longer than a cycle."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
