"""Memory that a pacer and a law share: every cycle, one way, and the next command, the other way.

It is a file in memory without a name, which two processes map, so nothing is left when both have
ended, however they end. One process writes each part of it, and nobody waits:

- *cycles* are records in a ring, of which the pacer writes one in each cycle and then their count;
- *commands* are for the cycles to come, as far as they are known, in a smaller ring. Each has a
  sequence number before and after it. They differ while it is written, and a reader that finds them
  different has no command.

What is written is written in this order; processors of the x86 family keep that order for others.
Plain numbers alone are used here: the pacer's loop has no NumPy.

Coming before other programs, where the system lets one, and before what Python does besides.
"""

from __future__ import annotations

import gc
import mmap
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_uint64
from struct import Struct
from typing import Any, NamedTuple

#: Joints of the robot.
JOINTS = 7
#: Cycles that are kept, more than a minute of them.
RING = 2**16
#: Commands that may be told ahead.
AHEAD = 128

#: What the pacer does: it comes up, tells what it hears, moves the robot, or has ended.
STARTING, LISTENING, MOVING, ENDED = range(4)
#: What it is asked to do: listen, take the robot over and move it, bring it to rest, hand it back,
#: or have the law that it was given move it.
LISTEN, MOVE, REST, END, RUN = range(5)
#: Who made a command: nobody, as at the beginning; the law; or the pacer by a step of the stop.
NOBODY, LAW, STOP = range(3)

_COUNT, _DOING, _ASKED, _FILE = 0, 8, 16, 24
_TEXT, _TEXT_SIZE = 64, 960
#: Bytes of a `SharedMemory` that tell what is done, asked for and wrong.
HEADER = _COMMAND = 1024
#: Cycle that a command goes on from, q, v, a, largest accelerations and jerks; a sequence number
#: stands before and after them.
_FIELDS = f"Q{5 * JOINTS}d"
_SLOT_SIZE = Struct(f"=Q{_FIELDS}Q").size
#: See `CycleRecord`.
RECORD = Struct(f"=QQQ4d{6 * JOINTS}d")
_CYCLES = _COMMAND + AHEAD * _SLOT_SIZE
SIZE = _CYCLES + RING * RECORD.size


def write_word(memory: mmap.mmap | bytearray, at: int, value: int) -> None:
    """Write a number of eight bytes at once.

    `Struct.pack_into` sets them to zero before, and writes byte by byte, which others may read.
    """
    c_uint64.from_buffer(memory, at).value = value


def read_word(memory: mmap.mmap, at: int) -> int:
    """Return a number of eight bytes, read at once."""
    return c_uint64.from_buffer(memory, at).value


class CycleRecord(NamedTuple):
    """One cycle, as the pacer saw it.

    Attributes:
        number: Its number.
        source: Who made the command.
        passed: Cycles that the robot's clock has gone by since the one before; more than one
            where it has lost some.
        time: The robot's clock [s].
        heard: Clock of this machine when the state was read [s].
        answered: Clock of this machine when the command was sent [s].
        success: Share of the last 100 commands that the robot says it has taken.
        numbers: Positions and velocities measured, positions that the robot says it holds, and
            positions, velocities and accelerations commanded, 7 each [rad, rad/s, rad/s^2].
    """

    number: int
    source: int
    passed: int
    time: float
    heard: float
    answered: float
    success: float
    numbers: tuple[float, ...]

    def part(self, which: int) -> tuple[float, ...]:
        """Return seven of the numbers."""
        return self.numbers[which * JOINTS : (which + 1) * JOINTS]


class LawCommand(NamedTuple):
    """A command of the law.

    Attributes:
        base: Number of the cycle whose commanded motion it goes on from.
        position, velocity, acceleration: The motion at the end of the next cycle.
        most: Largest accelerations of the stop [rad/s^2].
        jerk: Largest jerks of the stop [rad/s^3]; None for none.
    """

    base: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    most: tuple[float, ...]
    jerk: tuple[float, ...] | None


class SharedSlot:
    """A record that one process writes and others read: whole, or not at all.

    Args:
        memory: The memory that both share.
        at: Where it begins there.
        fields: Its fields, in the format of `struct`.

    Attributes:
        at: Where it begins.
        size: Bytes that it takes.
    """

    def __init__(self, memory: mmap.mmap, at: int, fields: str) -> None:
        self._memory, self.at = memory, at
        self._record = Struct(f"=Q{fields}Q")
        self.size = self._record.size
        self._last = at + self.size - 8
        self._number = 0

    @property
    def written(self) -> int:
        """How often it has been written, with what is being written now."""
        return read_word(self._memory, self.at)

    def write(self, *fields: float | bytes) -> None:
        """Write it in place of an older one."""
        self._number = number = self._number + 1
        write_word(self._memory, self.at, number)
        self._record.pack_into(self._memory, self.at, number, *fields, number - 1)
        write_word(self._memory, self._last, number)

    def read(self) -> Sequence[Any] | None:
        """Return its fields; None if it is being written, or has not been yet."""
        first, *fields, last = self._record.unpack_from(self._memory, self.at)
        if first != last or not first or first != read_word(self._memory, self.at):
            return None
        return fields


class SharedMemory:
    """Memory that two processes share: what the other one does, and is asked to do.

    Args:
        file: File descriptor of the memory, of `anonymous_file`.
        size: Its size in bytes.
    """

    def __init__(self, file: int, size: int) -> None:
        self._memory = mmap.mmap(file, size)

    def _word(self, at: int) -> int:
        return read_word(self._memory, at)

    @property
    def count(self) -> int:
        """How many cycles, or messages of a source, have been written."""
        return self._word(_COUNT)

    @count.setter
    def count(self, value: int) -> None:
        write_word(self._memory, _COUNT, value)

    @property
    def descriptor(self) -> int:
        """Descriptor of the memory in the process that gives commands, 0 before it knows."""
        return self._word(_FILE)

    @descriptor.setter
    def descriptor(self, value: int) -> None:
        write_word(self._memory, _FILE, value)

    @property
    def doing(self) -> int:
        """What the pacer does."""
        return self._word(_DOING)

    @doing.setter
    def doing(self, value: int) -> None:
        write_word(self._memory, _DOING, value)

    @property
    def request(self) -> int:
        """What the pacer is asked to do."""
        return self._word(_ASKED)

    @request.setter
    def request(self, value: int) -> None:
        write_word(self._memory, _ASKED, value)

    @property
    def failure(self) -> str:
        """Why the pacer has ended before it was asked to; empty if it has not."""
        text = self._memory[_TEXT : _TEXT + _TEXT_SIZE]
        return text.split(b"\0", 1)[0].decode(errors="replace")

    @failure.setter
    def failure(self, text: str) -> None:
        data = text.encode()[: _TEXT_SIZE - 1]
        self._memory[_TEXT : _TEXT + len(data) + 1] = data + b"\0"


class SharedCycles(SharedMemory):
    """The cycles and the commands.

    Args:
        file: File descriptor of the memory, of `anonymous_file`.
    """

    def __init__(self, file: int) -> None:
        super().__init__(file, SIZE)
        self._commands = [
            SharedSlot(self._memory, _COMMAND + k * _SLOT_SIZE, _FIELDS) for k in range(AHEAD)
        ]

    def add(
        self,
        words: tuple[int, int],
        times: tuple[float, float, float, float],
        numbers: Sequence[float],
    ) -> None:
        """Write the next cycle.

        Args:
            words: Who made the command, and cycles passed.
            times: The robot's clock, when it was heard and answered, and success.
            numbers: See `CycleRecord`.
        """
        index = self.count
        at = _CYCLES + (index % RING) * RECORD.size
        RECORD.pack_into(self._memory, at, index, *words, *times, *numbers)
        write_word(self._memory, _COUNT, index + 1)

    def cycle(self, index: int) -> CycleRecord:
        """Return a cycle, of those that are still kept."""
        at = _CYCLES + (index % RING) * RECORD.size
        fields = RECORD.unpack_from(self._memory, at)
        return CycleRecord._make((*fields[:7], fields[7:]))

    def raw(self, begin: int, end: int) -> bytes:
        """Return records of cycles as bytes, of those that are still kept."""
        indices = range(max(begin, end - RING), end)
        places = (_CYCLES + (k % RING) * RECORD.size for k in indices)
        return b"".join(self._memory[at : at + RECORD.size] for at in places)

    def tell(self, command: LawCommand) -> None:
        """Write a command in place of an older one."""
        jerk = (0.0,) * JOINTS if command.jerk is None else command.jerk
        motion = (*command.position, *command.velocity, *command.acceleration)
        self._commands[command.base % AHEAD].write(command.base, *motion, *command.most, *jerk)

    def command_after(self, base: int) -> LawCommand | None:
        """Return the command that goes on from a cycle; None if there is none yet."""
        fields = self._commands[base % AHEAD].read()
        if fields is None or fields[0] != base:
            return None
        numbers = fields[1:]
        q, v, a, most, jerk = (tuple(numbers[k : k + JOINTS]) for k in range(0, 5 * JOINTS, JOINTS))
        return LawCommand(base, q, v, a, most, jerk if any(jerk) else None)


def anonymous_file(size: int = SIZE) -> int:
    """Return the descriptor of a file in memory, by default of the size of `SharedCycles`."""
    file = os.memfd_create("cycles")
    os.ftruncate(file, size)
    return file


#: Real-time priorities of the pacer, of whoever commands, and of a simulated robot; below the
#: kernel's own threads.
PACER, LAW_BESIDE, SIMULATED = 80, 40, 30

#: What a process was scheduled by: its policy and priority.
Schedule = tuple[int, int]


def prioritize(priority: int) -> Schedule | None:
    """Have this thread come before all ordinary ones; return what it was scheduled by.

    Args:
        priority: Real-time priority, 1 to 99.

    Returns:
        None if the system does not let it, see ``ulimit -r``.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return None
    return before


def restore(before: Schedule | None) -> None:
    """Schedule this thread as before."""
    if before is not None:
        policy, priority = before
        os.sched_setscheduler(0, policy, os.sched_param(priority))


@contextmanager
def raise_priority(priority: int) -> Iterator[None]:
    """Have this thread, and those that it starts, come before all ordinary ones; see `prioritize`.

    Threads that were started meanwhile keep the priority.
    """
    before = prioritize(priority)
    try:
        yield
    finally:
        restore(before)


@contextmanager
def without_collection() -> Iterator[None]:
    """Keep Python from collecting garbage, which may take longer than a cycle.

    What the caller has frozen stays frozen, and is not looked through again.
    """
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
