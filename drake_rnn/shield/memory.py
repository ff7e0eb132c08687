"""The memory that a shield's process shares with its sources, and with whoever reads commands.

The source, in the process that has started it or in any other program, writes chunks into a ring.
The shield's process reads them, and writes the newest command and its state. The layout in bytes is
documented for programs in other languages: `docs/shield_memory.md`.
"""

from __future__ import annotations

import mmap
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from ..drive.command_memory import CommandMemory
from ..drive.shared_cycles import HEADER, SharedSlot, read_word, write_word
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.limits import FIELD_UNITS, JointLimits
from .chunks import Chunk, Counts, Kind

#: Targets that a chunk may have; chunks that the ring holds.
ROWS, RING = 256, 4
#: Kinds of targets by their numbers in the memory.
KINDS: tuple[Kind, ...] = ("positions", "velocities", "poses", "twists")
#: Clocks that times of a chunk are on, by their numbers: the machine's monotonic one, or another.
MONOTONIC, OTHER = 0, 1
#: Limits of which the memory tells the joints that are at them, in this order.
LIMITS = ("velocity", "acceleration", "jerk")
# Bytes of the text that says why something was refused.
_REASON = 248
# Pairs that block the arm, of which the memory tells at most.
_PAIRS = 4
# Names of the counts in the status; the others are those of a filter of poses.
_NAMES = [each.name for each in fields(Counts)]
_OF_CHUNKS, _OF_POSES = _NAMES[:9], _NAMES[9:]
# Parts that the state of a law has besides for each joint, if its acceleration or jerk is bounded.
_BOUNDED = 3


@dataclass(frozen=True)
class ShieldSizes:
    """Sizes of a shield's memory.

    Attributes:
        joints: Joints of all its arms.
        obstacles: Obstacles that may move.
        state: Numbers of the state of the law that commands.
        names: Names of the joints, and then of these obstacles, in order.
        arms: Joints of each of two arms; empty for one arm.
    """

    joints: int
    obstacles: int
    state: int
    names: tuple[str, ...] = ()
    arms: tuple[int, ...] = ()

    @property
    def text(self) -> bytes:
        """The names as they stand in the memory: each in UTF-8 with a zero byte, in cells of 8."""
        text = b"".join(name.encode(errors="replace") + b"\0" for name in self.names)
        return text.ljust(-8 * (-len(text) // 8), b"\0")

    @property
    def columns(self) -> int:
        """Numbers of a row of a chunk: a time and a target of any kind."""
        return 1 + max(self.joints, 7)

    @property
    def of_arms(self) -> tuple[int, ...]:
        """Joints of each arm."""
        return self.arms or (self.joints,)

    @property
    def most_state(self) -> int:
        """Numbers of the largest state, with other limits."""
        return self.state + _BOUNDED * self.joints


class ArmStatus(NamedTuple):
    """What a shield's process tells of an arm with each command, see `docs/shield_memory.md`."""

    number: int
    behind: float
    off_path: float
    delay: float
    blocked_for: float
    late_stops: int
    late_samples: int
    uncertified: int
    at_limit: tuple[int, ...]
    counts: Mapping[str, int]

    @classmethod
    def of(cls, record: Sequence[Any]) -> ArmStatus:
        """Return that of a record."""
        last = 8 + len(LIMITS)
        counts = dict(zip(_OF_CHUNKS, record[last:], strict=True))
        return cls._make((*record[:8], tuple(record[8:last]), counts))

    @property
    def record(self) -> list[float]:
        """Its numbers in the order of the memory."""
        counts = (self.counts[name] for name in _OF_CHUNKS)
        return [*self[:8], *self.at_limit, *counts]


class ArmDetails(NamedTuple):
    """What it tells of an arm besides, which this package alone reads.

    Attributes:
        silent_for: Time since the last target that is followed [s]; infinite before one.
        arrived: Number of the last chunk that the arm has arrived at.
        tracking: Place of what is told of tracking among the `STATES` of a filter of poses.
        counts: Counts of such a filter, by name.
        pairs: Pairs that block the arm.
        wanted: Joint velocities that are wanted, shape (n,) [rad/s].
    """

    silent_for: float
    arrived: int
    tracking: int
    counts: Mapping[str, int]
    pairs: tuple[int, ...]
    wanted: Array

    @classmethod
    def text(cls, joints: int) -> str:
        """Return its fields in the format of `struct`."""
        return f"{3 + len(_OF_POSES) + _PAIRS + joints}d"

    @classmethod
    def of(cls, record: Sequence[float]) -> ArmDetails:
        """Return those of a record."""
        first = 3 + len(_OF_POSES)
        counts = dict(zip(_OF_POSES, map(int, record[3:first]), strict=True))
        pairs = tuple(int(k) for k in record[first : first + _PAIRS] if k >= 0.0)
        wanted = np.array(record[first + _PAIRS :])
        return cls(record[0], int(record[1]), int(record[2]), counts, pairs, wanted)

    @property
    def record(self) -> list[float]:
        """Its numbers in the order of the memory."""
        counts = (self.counts[name] for name in _OF_POSES)
        pairs = [*self.pairs[:_PAIRS], *[-1] * (_PAIRS - len(self.pairs))]
        return [*self[:3], *counts, *pairs, *self.wanted.tolist()]


class Work(NamedTuple):
    """What it tells of the law of all arms, which this package alone reads.

    Attributes:
        overruns: Calls that took longer than the period.
        withdrawn: Commands that came too late.
        limits: Number of the limits in force, 0 for the first ones.
        target: The last target, shape (n,) [rad].
        before, after: State of the law before and after its last step.
    """

    overruns: int
    withdrawn: int
    limits: int
    target: Array
    before: Array
    after: Array

    @classmethod
    def text(cls, sizes: ShieldSizes) -> str:
        """Return its fields in the format of `struct`."""
        return f"{3 + sizes.joints + 1 + 2 * sizes.most_state}d"

    @classmethod
    def of(cls, record: Sequence[float], joints: int) -> Work:
        """Return that of a record, of so many joints."""
        numbers, size = np.array(record[4:]), int(record[3])
        target, states = numbers[:joints], numbers[joints : joints + 2 * size]
        head = int(record[0]), int(record[1]), int(record[2])
        return cls(*head, target, *states.reshape(2, size))

    def record(self, sizes: ShieldSizes) -> list[float]:
        """Return its numbers in the order of the memory."""
        head = self.overruns, self.withdrawn, self.limits, self.before.size
        numbers = np.concatenate((self.target, self.before, self.after)).tolist()
        unused = [0.0] * (2 * (sizes.most_state - self.before.size))
        return [*head, *numbers, *unused]


@dataclass(frozen=True)
class ArmRecords:
    """What a shield's process shares with the source of one arm.

    Attributes:
        memory, count_at: Where the number of chunks stands that have been written.
        columns: Numbers of a row of a chunk.
        status: `ArmStatus`, written once a command was sent.
        refusal: How many chunks were refused, and why the last one was.
        chunks: The ring: number, time sent, clock, kind, rows, and these, each a time and a target.
        details: `ArmDetails`.
        way: At most every 0.03 s: time, kind, rows, joint positions that are wanted, and what is
            left of the way then, of at most `ROWS` rows; 0 rows without one.
    """

    memory: mmap.mmap
    count_at: int
    columns: int
    status: SharedSlot
    refusal: SharedSlot
    chunks: Sequence[SharedSlot]
    details: SharedSlot
    way: SharedSlot

    @property
    def count(self) -> int:
        """How many chunks have been written."""
        return read_word(self.memory, self.count_at)

    def give_chunk(self, kind: Kind, chunk: Chunk, clock: int = MONOTONIC) -> int:
        """Write a chunk, and return its number.

        Args:
            kind: What its targets are.
            chunk: The chunk.
            clock: What its times are on.
        """
        data = self._rows(chunk)
        number = self.count + 1
        head = number, time.monotonic(), clock, KINDS.index(kind), len(data)
        self.chunks[number % RING].write(*head, data.tobytes())
        write_word(self.memory, self.count_at, number)
        return number

    def targets(self, data: bytes, rows: int) -> Array:
        """Return rows of a time and a target each, shape (rows, columns)."""
        numbers = np.frombuffer(data, count=rows * self.columns)
        return numbers.reshape(rows, self.columns)

    def tell_way(self, t: float, wanted: Array, kind: Kind, ahead: Chunk | None) -> None:
        """Write what is left of the way.

        Args:
            t: Time now [s].
            wanted: Joint positions that are wanted now, shape (n,) [rad].
            kind: What the way's targets are.
            ahead: What is left of it; None without one.
        """
        rows = np.zeros((0, self.columns)) if ahead is None else self._rows(ahead)
        self.way.write(t, KINDS.index(kind), len(rows), *wanted.tolist(), rows.tobytes())

    def _rows(self, chunk: Chunk) -> Array:
        """Return a chunk as rows of the memory."""
        times, values = chunk.times[:ROWS], chunk.values[:ROWS]
        rows = np.zeros((len(times), self.columns))
        rows[:, 0], rows[:, 1 : 1 + values.shape[1]] = times, values
        return rows


class ShieldMemory(CommandMemory):
    """What a shield's process shares with its sources, and with whoever reads commands.

    All numbers are of 8 bytes, in the order of bytes of the machine. A record begins and ends with
    a sequence number, see `SharedSlot`.

    Args:
        file: File descriptor of the memory.
        sizes: Its sizes.

    Attributes:
        arms: `ArmRecords` of each arm.
        places: A number, and how far obstacles have gone.
        names: `ShieldSizes.text`, written once before the first command.
        yields: Which of two arms gives way, 1 or 2; 0 for neither.
        limits: A number, and limits that are to be kept from now on, see `limit_numbers`.
        answer: That number, and why these limits were refused; empty if they were not.
        work: `Work`.
    """

    def __init__(self, file: int, sizes: ShieldSizes) -> None:
        size = self.size_of(sizes)
        super().__init__(file, size, sizes.joints, rows=ROWS, obstacles=sizes.obstacles)
        self.sizes, self._at = sizes, self.end
        slots = iter([self._slot(text) for text in self.records(sizes)])

        def chunks() -> list[SharedSlot]:
            return [next(slots) for _ in range(RING)]

        # The count of the first arm's chunks is in the header.
        first = 0, sizes.columns, next(slots)
        self.places = next(slots)
        arms = [(*first, next(slots), chunks())]
        self.names = next(slots)
        for _ in sizes.arms[1:]:
            count_at = next(slots).at + 8
            arms.append((count_at, sizes.columns, next(slots), next(slots), chunks()))
        self.yields, self.limits, self.answer, self.work = (next(slots) for _ in range(4))
        self.arms = [ArmRecords(self._memory, *arm, next(slots), next(slots)) for arm in arms]

    def _slot(self, text: str) -> SharedSlot:
        slot = SharedSlot(self._memory, self._at, text)
        self._at += slot.size
        return slot

    @staticmethod
    def records(sizes: ShieldSizes) -> list[str]:
        """Return the fields of its records behind the commands, in the format of `struct`."""
        n, rows = sizes.joints, 8 * ROWS * sizes.columns
        status, refusal = f"Q4d{3 + len(LIMITS) + len(_OF_CHUNKS)}Q", f"Q{_REASON}s"
        chunks = [f"QdQQQ{rows}s"] * RING
        records = [status, f"Q{3 * sizes.obstacles}d", refusal, *chunks, f"{len(sizes.text)}s"]
        for _ in sizes.arms[1:]:
            records += ["Q", status, refusal, *chunks]
        records += ["Q", f"Q{len(FIELD_UNITS) * n}d", f"Q{_REASON}s", Work.text(sizes)]
        for joints in sizes.of_arms:
            records += [ArmDetails.text(joints), f"dQQ{joints}d{rows}s"]
        return records

    @classmethod
    def size_of(cls, sizes: ShieldSizes) -> int:
        """Return its size in bytes."""
        own = sum(Struct(f"=Q{text}Q").size for text in cls.records(sizes))
        return HEADER + cls.command_bytes(sizes.joints) + own


def reason_of(error: InvalidInputError) -> bytes:
    """Return why something was refused, as it stands in the memory."""
    return str(error).encode()[: _REASON - 1]


def reason_text(data: bytes) -> str:
    """Return what `reason_of` has made."""
    return data.split(b"\0", 1)[0].decode(errors="replace")


def limit_numbers(limits: JointLimits) -> list[float]:
    """Return limits as numbers: each field in the order of `FIELD_UNITS`, NaN for what is none."""
    none = np.full(limits.size, np.nan)
    bounds = (limits.bounds[name] for name in FIELD_UNITS)
    return np.concatenate([none if bound is None else bound for bound in bounds]).tolist()


def limits_of(numbers: Sequence[float]) -> JointLimits:
    """Return the limits that `limit_numbers` has made numbers of.

    Raises:
        InvalidInputError: If they are none.
    """
    rows = np.array(numbers).reshape(len(FIELD_UNITS), -1)
    given = zip(FIELD_UNITS, rows, strict=True)
    return JointLimits(**{name: row for name, row in given if not np.isnan(row).all()})
