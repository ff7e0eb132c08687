"""What answers an FR3 in each of its cycles, a thousand times a second, whatever else happens.

In each cycle the command is that of the law, if it goes on from what was commanded in the cycle
before, and otherwise the first step of the fastest stop. That step *is* the point that is known to
lie in the box of a law which leaves itself this stop: a late law costs steps of a stop, and never a
bound. The law goes on from what was commanded.

Where the robot has lost cycles, it has held its acceleration meanwhile: v += h a, q += h v in each.
What was commanded is advanced likewise before a step of the stop follows. A robot drops a command
that comes late. So a command that is not ready in time is not sent: that its cycle is lost is then
certain, and the motion goes on from the one before. Where this process stood still *while* it sent,
it is the robot that tells: in the positions that it holds in the first state after that. Until then
nothing is answered.

A law that is compiled to C is called here, in the cycle itself, and is never late. Whatever it does
ends at its call: a fault, a step without end, or numbers that are none cost steps of a stop. The
process beside this one only watches then; if it does not, for a while, the robot is stopped.

This runs in a process of its own, without NumPy: ``python -m drake_rnn.drive.pacer``.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import json
import mmap
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite, nan
from pathlib import Path
from select import select
from signal import Signals
from struct import Struct
from time import monotonic
from typing import Any, NamedTuple, Protocol

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
    RUN,
    STOP,
    LawCommand,
    SharedCycles,
    prioritize,
    read_word,
    write_word,
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
# Of the positions that a robot holds, which it may tell with single precision [rad].
_HELD = 1e-6
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


#: What a call of a law in C returns in place of zero, unless it is the number of a signal.
NOT_FINITE, TOO_LONG, NO_GUARD = -1, -2, -3
#: Time that a step in C may take in a cycle [s], and steps in a row that may take longer.
LONGEST, _LONG_STEPS = 5e-4, 5
#: Numbers that a law in C is given besides its path and obstacles: 7 positions, velocities and
#: accelerations that were commanded, positions and velocities measured; the time in which it has
#: commanded nothing; and whether it goes on from a motion that is not its own.
GIVEN = 5 * JOINTS + 2
# Cycles that nobody has looked at from which on it is asked whether the other process has ended.
_UNSEEN = 3
#: States of a law in C that are kept, about as many seconds as thousands.
STATES = 2**12
# A law's memory: the size of its description, cycles that have been looked at, the numbers of the
# cycles in which it began and after which it had ended, both plus one, why it has failed, and its
# description.
_LENGTH, _LOOKED, _FIRST, _OVER = 0, 8, 16, 24
_WHY, _WHY_SIZE, _ABOUT = 64, 960, 1024


def fault_text(code: int, longest: float) -> str:
    """Return why a call of a law in C has not ended well, by what it has returned."""
    if code == NOT_FINITE:
        return "its step in C is not finite"
    if code == TOO_LONG:
        return f"its step in C takes longer than {longest:g} s"
    if code == NO_GUARD:
        return "its step in C cannot be guarded"
    return f"its step in C was ended by {Signals(code).name}"


def law_bytes(about: Mapping[str, Any], table: bytes) -> bytes:
    """Return the memory of a law in C, see `LawMemory`.

    Args:
        about: Its description:

            - ``library``, ``guard``: files of its step and of what guards it;
            - ``start``: its state, and ``v`` and ``a``, where velocities and accelerations begin in
              it, the latter None if it has none;
            - ``numbers``: those of obstacles, which it is given behind the `GIVEN`;
            - ``period`` [s], ``samples``, and ``columns`` of the table;
            - ``most`` and ``jerk``: what its stop keeps; ``lower``, ``upper`` and ``fastest``: what
              a command keeps; ``names`` of the joints;
            - ``patience``: cycles for which nobody has to look.
        table: Doubles: time and path, a row for each sample.
    """
    text = json.dumps(about).encode()
    begin = _ABOUT + -(-len(text) // 8) * 8
    ring = STATES * 8 * (1 + len(about["start"]))
    memory = bytearray(begin + len(table) + ring)
    write_word(memory, _LENGTH, len(text))
    memory[_ABOUT : _ABOUT + len(text)] = text
    memory[begin : begin + len(table)] = table
    return bytes(memory)


class LawMemory:
    """What a pacer and its law's process share of a law in C.

    Args:
        file: File descriptor of what `law_bytes` has returned.

    Attributes:
        memory: The memory.
        about: The law's description.
        table: Where its table begins.
    """

    def __init__(self, file: int) -> None:
        self.memory = mmap.mmap(file, 0)
        length = self._word(_LENGTH)
        self.about: dict[str, Any] = json.loads(self.memory[_ABOUT : _ABOUT + length])
        self.table = _ABOUT + -(-length // 8) * 8
        columns, samples = self.about["columns"], self.about["samples"]
        self._ring = self.table + 8 * columns * samples
        self._row = Struct(f"=Q{len(self.about['start'])}d")

    def _word(self, at: int) -> int:
        return read_word(self.memory, at)

    @property
    def look_count(self) -> int:
        """Number of cycles that the law's process has looked at."""
        return self._word(_LOOKED)

    @look_count.setter
    def look_count(self, value: int) -> None:
        write_word(self.memory, _LOOKED, value)

    @property
    def first(self) -> int | None:
        """Number of the cycle of the first sample; None before it."""
        return self._word(_FIRST) - 1 if self._word(_FIRST) else None

    @first.setter
    def first(self, value: int) -> None:
        write_word(self.memory, _FIRST, value + 1)

    @property
    def over(self) -> int | None:
        """Number of the cycle after that of the last sample; None before it."""
        return self._word(_OVER) - 1 if self._word(_OVER) else None

    @over.setter
    def over(self, value: int) -> None:
        write_word(self.memory, _OVER, value + 1)

    @property
    def why(self) -> str:
        """Why the law commands nothing any more, behind the watch that says so; empty if it does.

        It is such as ``law: its step in C is not finite``.
        """
        return self.memory[_WHY : _WHY + _WHY_SIZE].split(b"\0", 1)[0].decode(errors="replace")

    @why.setter
    def why(self, text: str) -> None:
        data = text.encode()[: _WHY_SIZE - 1]
        self.memory[_WHY : _WHY + len(data) + 1] = data + b"\0"

    def write(self, cycle: int, sample: int, state: Sequence[float]) -> None:
        """Write the number of a sample that was made in a cycle, and the law's state after it."""
        at = self._ring + (cycle % STATES) * self._row.size
        self._row.pack_into(self.memory, at, sample, *state)

    def read(self, cycle: int) -> tuple[int, tuple[float, ...]]:
        """Return the same of a cycle, if it is one of the last ones in which a sample was made."""
        at = self._ring + (cycle % STATES) * self._row.size
        sample, *state = self._row.unpack_from(self.memory, at)
        return sample, tuple(state)


class _Point(NamedTuple):
    """Where a law is.

    Attributes:
        sample: Number of the sample that is due.
        due: Number of the sample after the last that was made.
        state: Its state after that one.
        motion: What was commanded then; None before the first.
    """

    sample: int
    due: int
    state: Sequence[float]
    motion: MotionCommand | None


class PacedLaw:
    """A law in C, one sample of which is made in each cycle.

    Args:
        file: See `LawMemory`.

    Attributes:
        point: Where it is; None before the first sample.
        patience: Cycles for which nobody has to look at the robot.
    """

    def __init__(self, file: int) -> None:
        self.memory = LawMemory(file)
        about = self._about = self.memory.about
        self._step = ctypes.PyDLL(about["library"]).law_sample
        self._call = ctypes.PyDLL(about["guard"]).guarded_step
        self._call.argtypes = (*(ctypes.c_void_p,) * 5, ctypes.c_long)
        size = len(about["start"])
        self._state = (ctypes.c_double * size)(*about["start"])
        numbers = about["numbers"]
        self._given = (ctypes.c_double * (GIVEN + len(numbers)))(*(0.0,) * GIVEN, *numbers)
        self._after = (ctypes.c_double * (size + JOINTS))()
        arrays = (self._step, self._state, self._given)
        self._args = [ctypes.cast(each, ctypes.c_void_p) for each in arrays]
        view = ctypes.c_char.from_buffer(self.memory.memory, self.memory.table)
        self._table, self._row_size = ctypes.addressof(view), 8 * about["columns"]
        self._pack = Struct(f"={GIVEN}d").pack_into
        self._speed = slice(about["v"], about["v"] + JOINTS)
        self._long_steps, self.patience = 0, about["patience"]
        self.point: _Point | None = None
        for _ in range(3):
            # What is done for the first time takes longest.
            self._made(0)

    def _made(self, sample: int) -> int:
        """Make a sample, and return what its call has."""
        row = self._table + sample * self._row_size
        code: int = self._call(*self._args, row, self._after, int(1e6 * LONGEST))
        return code

    def pass_cycles(self, count: int, cycle: int) -> None:
        """Go on by the cycles that have passed, to one with a number; the first one begins."""
        if self.point is None:
            self.memory.first = cycle
            self.point = _Point(0, 0, self._about["start"], None)
        else:
            self.point = self.point._replace(sample=self.point.sample + count)
        if self.point.sample >= self._about["samples"] and self.memory.over is None:
            self.memory.over = cycle

    def command(self, motion: MotionCommand, state: State) -> LawCommand | None:
        """Return the command that goes on from a motion; None if there is none."""
        point, about = self.point, self._about
        assert point is not None
        if point.sample >= about["samples"] or self.memory.why:
            return None
        own = point.motion is motion and point.sample == point.due
        elapsed = about["period"] * (point.sample - point.due)
        self._state[:] = list(point.state)
        numbers = (*motion.position, *motion.velocity, *motion.acceleration, *state.q, *state.dq)
        self._pack(self._given, 0, *numbers, elapsed, 0.0 if own else 1.0)
        if not self._is_well(self._made(point.sample)):
            return None
        h, v = about["period"], self._after[self._speed]
        q = [x + h * speed for x, speed in zip(motion.position, v, strict=True)]
        if (at := about["a"]) is None:
            a = [(new - old) / h for new, old in zip(v, motion.velocity, strict=True)]
        else:
            a = self._after[at : at + JOINTS]
        if objection := self._objection(q, motion):
            self.memory.why = f"command: {objection}"
            return None
        return LawCommand(0, tuple(q), tuple(v), tuple(a), about["most"], about["jerk"])

    def _is_well(self, code: int) -> bool:
        """Return whether a step has ended well; tell why it has not, unless it was only late."""
        if code == 0:
            self._long_steps = 0
            return True
        text = fault_text(code, LONGEST)
        if code == TOO_LONG:
            self._long_steps += 1
            if self._long_steps < _LONG_STEPS:
                return False
            text += f", {_LONG_STEPS} times in a row"
        self.memory.why = f"law: {text}"
        return False

    def _objection(self, position: Sequence[float], motion: MotionCommand) -> str:
        """Return why a command may not be sent, as `Watches.may_be_sent` does; empty if it may."""
        about, h = self._about, self._about["period"]
        for i, q in enumerate(position):
            lower, upper, name = about["lower"][i], about["upper"][i], about["names"][i]
            if not lower - _ROUNDING <= q <= upper + _ROUNDING:
                return f"{name} is at {q:.6g} rad; it may be {lower:.6g} to {upper:.6g}"
            v, a = motion.velocity[i], motion.acceleration[i]
            # One that lost cycles have made faster is slowed down, which is no reason to stop.
            most = h * max(about["fastest"][i], abs(v), abs(v + h * a))
            if not abs(step := q - motion.position[i]) <= most * (1.0 + _ROUNDING) + _SAME:
                return (
                    f"{name} is to move by {abs(step):.4g} rad in {h:g} s; it may by {most:.4g} rad"
                )
        return ""

    def keep(self, motion: MotionCommand, cycle: int) -> None:
        """Go on from the command that was returned last, which was taken."""
        assert self.point is not None
        sample, state = self.point.sample, self._after[: len(self._state)]
        self.point = _Point(sample, sample + 1, state, motion)
        self.memory.write(cycle, sample, state)


class _Late(NamedTuple):
    """An answer whose sending took so long that the robot may have dropped it.

    Attributes:
        end: When it had been sent [s].
        state, words, arrival: What it answered, and what is written of it.
        point: What was commanded then, and where the law in C was, if it has been taken.
    """

    end: float
    state: State
    words: tuple[int, int]
    arrival: float
    point: tuple[MotionCommand, _Point | None]


class Pacing:
    """The loop of a pacer.

    Args:
        robot: The robot.
        cycles: What it shares with the law.
        wake: Called when a cycle has been written.
        is_alone: Whether nobody is left who could ask for anything.
        now: Clock of this machine [s].
        law_file: Descriptor of the file of a law in C, which is empty if there is none.
    """

    def __init__(
        self,
        robot: PacedRobot,
        cycles: SharedCycles,
        wake: Callable[[], None],
        is_alone: Callable[[], bool],
        now: Callable[[], float] = monotonic,
        law_file: int | None = None,
    ) -> None:
        self._robot, self._shared = robot, cycles
        self._wake, self._is_alone, self._now = wake, is_alone, now
        self._law_file = law_file
        self._law: PacedLaw | None = None

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
        self._law = _law_in(self._law_file)
        robot.begin()
        last, since, silence, late, rest_time = state, inf, inf, None, -STILL
        answer_time, at = -inf, inf
        while True:
            state = _timed(robot.read(), last.time + PERIOD)
            arrival = self._now()
            send_time = _send_time(state, last, arrival, since, silence)
            last, since, silence = state, arrival, inf
            if late is not None and send_time < late.end:
                # It was told before the answer can have come.
                since, silence = send_time, self._now()
                continue
            if late is not None and self._settle(pacer, late, state, answer_time):
                answer_time, at = late.state.time, late.arrival
                rest_time = rest_time + 1 if pacer.rests else 0
            late = None
            cycles = (
                1 if answer_time < 0.0 else _passed_cycles(state.time - answer_time, arrival - at)
            )
            before = self._point(pacer)
            source = self._advance(pacer, state, cycles, rest_time < 0)
            if (now := self._now()) - send_time > LATE:
                self._return(pacer, before)
                since, silence = send_time, now
                continue
            rests = rest_time + 1 if pacer.rests else 0
            is_last = rests > STILL and self._is_done()
            robot.answer(pacer.motion.position, is_last)
            time_of_answer = self._now()
            if time_of_answer - send_time > DROPPED and not is_last:
                # It stood still while it sent: the robot has probably dropped this.
                point = self._point(pacer)
                late = _Late(time_of_answer, state, (source, cycles), arrival, point)
                self._return(pacer, before)
                continue
            answer_time, at, rest_time = state.time, arrival, rests
            self._write(state, pacer, (source, cycles), arrival, time_of_answer)
            if rest_time == 0:
                memory.doing = MOVING
            if is_last:
                return

    def _settle(self, pacer: Pacer, late: _Late, state: State, answer_time: float) -> bool:
        """Go on from a late answer if a state tells that the robot has taken it; tell whether."""

        def distance(motion: MotionCommand, since: float) -> float:
            advanced = Pacer(motion.position)
            advanced.motion = motion
            advanced.lose(_passed_cycles(state.time - since, inf) - 1)
            pairs = zip(state.held, advanced.motion.position, strict=True)
            return max(abs(x - y) for x, y in pairs)

        taken = distance(late.point[0], late.state.time)
        dropped = distance(pacer.motion, max(answer_time, late.state.time - PERIOD))
        if not taken < min(_HELD, dropped):
            return False
        self._return(pacer, late.point)
        self._write(late.state, pacer, late.words, late.arrival, late.end)
        return True

    def _is_done(self) -> bool:
        return self._shared.request == END or self._is_alone()

    def _point(self, pacer: Pacer) -> tuple[MotionCommand, _Point | None]:
        """Return what was commanded last, and where the law in C is."""
        return pacer.motion, None if self._law is None else self._law.point

    def _return(self, pacer: Pacer, point: tuple[MotionCommand, _Point | None]) -> None:
        """Return to where `_point` was: the robot has taken nothing since."""
        pacer.motion = point[0]
        if self._law is not None:
            self._law.point = point[1]

    def _advance(self, pacer: Pacer, state: State, cycle_count: int, still: bool) -> int:
        """Advance what is commanded by the cycles that have passed; return who made it."""
        cycles = self._shared
        if still:
            return NOBODY
        if self._law is not None and cycles.request == RUN:
            return self._run_law(self._law, pacer, state, cycle_count)
        is_due = cycle_count == 1 and cycles.request == MOVE
        command = cycles.command_after(cycles.count - 1) if is_due else None
        pacer.lose(cycle_count - 1)
        if command is not None and pacer.take(command):
            return LAW
        pacer.stop()
        return STOP

    def _run_law(self, law: PacedLaw, pacer: Pacer, state: State, cycle_count: int) -> int:
        """Advance what is commanded by the law in C; return who made it."""
        cycle, command = self._shared.count, None
        law.pass_cycles(cycle_count, cycle)
        pacer.lose(cycle_count - 1)
        if cycle_count == 1 and self._is_watched(law, cycle) and not _complaint(state):
            command = law.command(pacer.motion, state)
        if command is not None and pacer.take(command):
            law.keep(pacer.motion, cycle)
            return LAW
        pacer.stop()
        return STOP

    def _is_watched(self, law: PacedLaw, cycle: int) -> bool:
        """Return whether the other process looks at the robot."""
        unseen = cycle - law.memory.look_count
        return unseen <= _UNSEEN or not (unseen > law.patience or self._is_alone())

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


def _timed(state: State, time: float) -> State:
    """Return a state, with another time if its own is no number."""
    return state if isfinite(state.time) else state._replace(time=time)


def _send_time(state: State, last: State, arrival: float, since: float, silence: float) -> float:
    """Return when a state was sent, by the clock of this process [s].

    It may have waited for this process: it was sent by the robot's clock. But if this process has
    waited for it, after one without an answer, the robot's clock is slow; and if that goes back, it
    tells nothing.

    Args:
        state: The state.
        last: The one before.
        arrival: When the state came.
        since: When the one before was sent, at the latest.
        silence: When it was decided not to answer that; infinite if it was answered.
    """
    if arrival - silence > _WAIT_TIME or state.time < last.time:
        return arrival
    return min(arrival, since + state.time - last.time)


def _law_in(file: int | None) -> PacedLaw | None:
    """Return the law in C of a file, if there is one."""
    return None if file is None or not os.fstat(file).st_size else PacedLaw(file)


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
    parser.add_argument("law", type=int, help="descriptor of the file of a law in C, or empty")
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
        Pacing(robot, cycles, wake, is_alone, law_file=options.law).run()
    except Exception as error:  # whatever ends it is told to the law
        cycles.failure = f"{type(error).__name__}: {error}"
    cycles.doing = ENDED
    wake()
    if options.record is not None and is_alone():
        options.record.write_bytes(cycles.raw(0, cycles.count))
    return 1 if cycles.failure else 0


if __name__ == "__main__":
    sys.exit(main())
