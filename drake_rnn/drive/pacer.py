"""What answers an FR3 in each of its cycles, a thousand times a second, whatever else happens.

In each cycle the command is that of the law, if it goes on from what was commanded in the cycle
before, and otherwise the first step of the fastest stop. That step *is* the point that is known to
lie in the box of a law which leaves itself this stop: a late law costs steps of a stop, and never a
bound. The law goes on from what was commanded.

Where the robot has lost cycles, it has held its acceleration meanwhile: v += h a, q += h v in each.
What was commanded is advanced likewise before a step of the stop follows. A robot drops a command
that comes late, and nobody tells whether one did. So a command that is not ready in time is not
sent: that its cycle is lost is then certain, and the motion goes on from the one before.

This runs in a process of its own, without NumPy: ``python -m drake_rnn.drive.pacer``.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from collections.abc import Callable, Sequence
from math import inf, isfinite, nan
from pathlib import Path
from select import select
from time import monotonic
from typing import NamedTuple, Protocol

from ..inputs.packages import import_name
from ..robot.joint_stop import stop_step
from .shared_cycles import (
    END,
    ENDED,
    JOINTS,
    LAW,
    LISTEN,
    LISTENING,
    MOVE,
    MOVING,
    NOBODY,
    PACER,
    REST,
    STOP,
    LawCommand,
    SharedCycles,
    prioritize,
)

#: Cycle of the robot [s].
PERIOD = 1e-3
#: Cycles of standstill that a motion begins and ends with, before which the robot's checks of
#: differences are not sure to have a history.
STILL = 25
#: Age of a state from which on it is not answered, and at which an answer has come too late [s].
LATE, DROPPED = 7e-4, PERIOD
#: Time of a read from which on it is this process that has waited [s].
_WAIT_TIME = 1e-4
# Time by which more may have passed by the robot's clock than here, as long as a robot waits until
# it gives up; beyond that, the clock has jumped, and no cycle was lost [s].
_AHEAD = 0.02
# Cycles that it is gone on for where they were lost; the robot has given up long before.
_LOSABLE = 1000
# Of what the law is told, by rounding: shares of the bounds, and of a position [rad].
_ROUNDING, _SAME = 1e-6, 1e-9
# Joint positions and velocities of a state that is none.
_NONE = (nan,) * JOINTS


class State(NamedTuple):
    """What the robot tells in a cycle.

    Attributes:
        time: Its clock [s].
        q, dq: Measured positions and velocities, 7 each [rad, rad/s].
        held: Positions that it holds, 7 [rad].
        success: Share of the last 100 commands that it has taken.
    """

    time: float
    q: Sequence[float]
    dq: Sequence[float]
    held: Sequence[float]
    success: float


class PacedRobot(Protocol):
    """A robot that is read and answered once in each cycle."""

    def look(self) -> State:
        """Return the next state while nothing moves the robot."""

    def begin(self) -> None:
        """Begin a motion."""

    def read(self) -> State:
        """Return the next state within the motion."""

    def answer(self, position: Sequence[float], is_last: bool) -> None:
        """Send the positions for a cycle, 7 [rad]; the last ones end the motion."""


class MotionCommand(NamedTuple):
    """A motion that is commanded, with 7 numbers each [rad, rad/s, rad/s^2].

    Attributes:
        position, velocity, acceleration: The motion at the end of a cycle.
    """

    position: Sequence[float]
    velocity: Sequence[float]
    acceleration: Sequence[float]


class Pacer:
    """The motion that is commanded, cycle by cycle.

    Args:
        position: Positions to begin at, 7 [rad].
        period: Time of a cycle [s].

    Attributes:
        motion: What was commanded last.
    """

    def __init__(self, position: Sequence[float], period: float = PERIOD) -> None:
        self.motion = MotionCommand(tuple(position), (0.0,) * JOINTS, (0.0,) * JOINTS)
        self._period = period
        self._most: Sequence[float] = (1.0,) * JOINTS
        self._jerk: Sequence[float] | None = (1.0,) * JOINTS

    @property
    def rests(self) -> bool:
        """Whether nothing moves."""
        return not (any(self.motion.velocity) or any(self.motion.acceleration))

    def lose(self, cycles: int) -> None:
        """Go on as the robot has in cycles that it has lost."""
        for _ in range(cycles):
            q, v, a = self.motion
            v = self._add(v, a)
            self.motion = MotionCommand(self._add(q, v), v, a)

    def _add(self, x: Sequence[float], rate: Sequence[float]) -> list[float]:
        return [y + self._period * change for y, change in zip(x, rate, strict=True)]

    def take(self, command: LawCommand) -> bool:
        """Take a command if it goes on from the motion within its own bounds; tell whether."""
        h, jerk, before = self._period, command.jerk, self.motion
        for i in range(JOINTS):
            q, v, a = command.position[i], command.velocity[i], command.acceleration[i]
            if not abs(q - before.position[i] - h * v) <= _SAME:
                return False
            room = command.most[i] * (1.0 + _ROUNDING)
            if not (abs(v - before.velocity[i]) <= h * room and abs(a) <= room):
                return False
            if jerk is None:
                continue
            if not jerk[i] > 0.0:
                return False
            if not abs(a - before.acceleration[i]) <= h * jerk[i] * (1.0 + _ROUNDING):
                return False
            if not abs(v - before.velocity[i] - h * a) <= _SAME:
                return False
        self.motion = MotionCommand(command.position, command.velocity, command.acceleration)
        self._most, self._jerk = command.most, jerk
        return True

    def stop(self) -> None:
        """Make a step of the fastest stop within the bounds of the last command that was taken."""
        q, v, a = self.motion
        v, a = stop_step(v, a, self._most, self._jerk, self._period)
        self.motion = MotionCommand(self._add(q, v), v, a)


class Pacing:
    """The loop of a pacer.

    Args:
        robot: The robot.
        cycles: What it shares with the law.
        wake: Called when a cycle has been written.
        is_alone: Whether nobody is left who could ask for anything.
        now: Clock of this machine [s].
    """

    def __init__(
        self,
        robot: PacedRobot,
        cycles: SharedCycles,
        wake: Callable[[], None],
        is_alone: Callable[[], bool],
        now: Callable[[], float] = monotonic,
    ) -> None:
        self._robot, self._shared = robot, cycles
        self._wake, self._is_alone, self._now = wake, is_alone, now

    def run(self) -> None:
        """Listen, and move the robot once it is asked for, until it has been handed back."""
        cycles = self._shared
        cycles.doing = LISTENING
        state = self._check_state()
        while cycles.request == LISTEN and not self._is_alone():
            state = self._check_state()
            now = self._now()
            self._write(state, Pacer(state.held), (NOBODY, 1), now, now)
        if cycles.request in (MOVE, REST):
            self._move(state)

    def _check_state(self) -> State:
        """Return the next state of a robot that nothing moves; one that is none ends this."""
        state = self._robot.look()
        if why := _complaint(state):
            raise ValueError(f"a state {why}")
        return state

    def _move(self, state: State) -> None:
        """Command the robot until it rests and is to be handed back."""
        pacer, memory, robot = Pacer(state.held), self._shared, self._robot
        robot.begin()
        last, since, answer_time, at, rest_time = state, inf, -inf, inf, -STILL
        silence = inf
        while True:
            state = robot.read()
            arrival = self._now()
            if not isfinite(state.time):
                state = state._replace(time=last.time + PERIOD)
            # It may have waited for this process: it was sent by the robot's clock. But if this
            # process has waited for it, after one without an answer, the robot's clock is slow; and
            # if that goes back, it tells nothing.
            send_time = min(arrival, since + state.time - last.time)
            if arrival - silence > _WAIT_TIME or state.time < last.time:
                send_time = arrival
            last, since, silence = state, arrival, inf
            cycles = (
                1 if answer_time < 0.0 else _passed_cycles(state.time - answer_time, arrival - at)
            )
            before = pacer.motion
            source = self._advance(pacer, cycles, rest_time < 0)
            if (now := self._now()) - send_time > LATE:
                pacer.motion, since, silence = before, send_time, now
                continue
            rests = rest_time + 1 if pacer.rests else 0
            is_last = rests > STILL and self._is_done()
            robot.answer(pacer.motion.position, is_last)
            time_of_answer = self._now()
            if time_of_answer - send_time > DROPPED and not is_last:
                # It stood still while it sent: the robot has dropped this.
                pacer.motion = before
                continue
            answer_time, at, rest_time = state.time, arrival, rests
            self._write(state, pacer, (source, cycles), arrival, time_of_answer)
            if rest_time == 0:
                memory.doing = MOVING
            if is_last:
                return

    def _is_done(self) -> bool:
        return self._shared.request == END or self._is_alone()

    def _advance(self, pacer: Pacer, cycle_count: int, still: bool) -> int:
        """Advance what is commanded by the cycles that have passed; return who made it."""
        cycles = self._shared
        if still:
            return NOBODY
        is_due = cycle_count == 1 and cycles.request == MOVE
        command = cycles.command_after(cycles.count - 1) if is_due else None
        pacer.lose(cycle_count - 1)
        if command is not None and pacer.take(command):
            return LAW
        pacer.stop()
        return STOP

    def _write(
        self, state: State, pacer: Pacer, words: tuple[int, int], arrival: float, reply: float
    ) -> None:
        times = (state.time, arrival, reply, state.success)
        q, v, a = pacer.motion
        if _complaint(state):
            # The law sees what is no number, and has the robot brought to rest.
            times, state = (*times[:3], nan), state._replace(q=_NONE, dq=_NONE, held=_NONE)
        self._shared.add(words, times, (*state.q, *state.dq, *state.held, *q, *v, *a))
        self._wake()


def _passed_cycles(robot: float, here: float) -> int:
    """Return the cycles that have passed, by the robot's clock and by that of this process [s]."""
    if robot > here + _AHEAD:
        return 1
    return min(max(round(robot / PERIOD), 1), _LOSABLE)


def _complaint(state: State) -> str:
    """Return why it is no state of the robot; empty if it is one."""
    for name, values in (("q", state.q), ("dq", state.dq), ("held", state.held)):
        if len(values) != JOINTS:
            return f"has {len(values)} numbers {name}; the robot has {JOINTS} joints"
        if not isfinite(sum(values)):
            return f"has {name} that is no number: {list(values)}"
    return "" if isfinite(state.time) else f"has the time {state.time} s"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a pacer for the process that has started it, whose end closes the standard input."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", help="class of the robot, as module:name")
    parser.add_argument("address", help="its address")
    parser.add_argument("file", type=int, help="descriptor of the shared memory")
    parser.add_argument("event", type=int, help="descriptor of the event of a cycle")
    parser.add_argument("--record", type=Path, help="file for all cycles if the law is killed")
    options = parser.parse_args(arguments)
    cycles = SharedCycles(options.file)

    def is_alone() -> bool:
        return bool(select((sys.stdin,), (), (), 0.0)[0])

    def wake() -> None:
        os.eventfd_write(options.event, 1)

    try:
        robot: PacedRobot = import_name(options.robot)(options.address)
        prioritize(PACER)
        gc.collect()
        gc.freeze()
        gc.disable()
        Pacing(robot, cycles, wake, is_alone).run()
    except Exception as error:  # whatever ends it is told to the law
        cycles.failure = f"{type(error).__name__}: {error}"
    cycles.doing = ENDED
    wake()
    if options.record is not None and is_alone():
        options.record.write_bytes(cycles.raw(0, cycles.count))
    return 1 if cycles.failure else 0


if __name__ == "__main__":
    sys.exit(main())
