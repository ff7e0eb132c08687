"""A shield, which may run in a process of its own, and the memory by which others reach it.

The source, in this process or in any other program, writes chunks into a ring of a shared memory.
The shield's process reads them, and writes the newest command and its state. `ShieldMemory` states
the layout in bytes, which is documented for programs in other languages:
`docs/shield_memory.md`. So what is read there is checked as what comes by `Shield.follow`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from struct import Struct
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..compiled.builds import Steps
from ..drive.call_times import CallTimes
from ..drive.command_memory import CommandMemory
from ..drive.own_process import (
    CommandWriter,
    GuardCommand,
    InOwnProcess,
    OwnProcess,
    Send,
    check_process,
    checked_timing,
)
from ..drive.shared_cycles import HEADER, SharedSlot
from ..errors import InvalidInputError
from ..inputs.fields import Array, with_own_errors
from ..inputs.messages import require_type
from ..laws.guard import LastStep
from ..robot.arm import Arm
from ..robot.clearance.capsules import Displacements
from ..robot.limits import JointLimits
from .chunks import NAMES, Chunk, Counts, Kind, Timing, read_chunk
from .pose_filter import STATES
from .report import Sample, ShieldRecord, record_of
from .shield import ShieldSettings, ShieldStatus, StreamShield

#: Targets that a chunk may have; chunks that the ring holds.
ROWS, RING = 256, 4
#: Kinds of targets by their numbers in the memory.
KINDS: tuple[Kind, ...] = ("positions", "velocities", "poses", "twists")
#: Clocks that times of a chunk are on, by their numbers: the machine's monotonic one, or another.
MONOTONIC, OTHER = 0, 1
#: Limits of which the memory tells the joints that are at them, in this order.
LIMITS = ("velocity", "acceleration", "jerk")
# Time between two writings of the way that is left [s].
_WAY_TOLD = 0.03
# Bytes of the text that says why a chunk was refused.
_REASON = 248
# Pairs that block the arm, of which the memory tells at most.
_PAIRS = 4
# Chunks that are read in one period at most.
_AT_ONCE = 2
# Share of a limit at which it counts as reached.
_AT_LIMIT = 1.0 - 1e-6
# Place of the counts in the status; the names of those there, and of those of a filter of poses.
_COUNTS = 8 + len(LIMITS)
_NAMES = [each.name for each in fields(Counts)]
_OF_CHUNKS, _OF_POSES = _NAMES[:9], _NAMES[9:]
# Place of the pairs that block the arm in `ShieldMemory.inner`.
_BLOCKING = 4 + len(_OF_POSES)


@dataclass(frozen=True)
class ShieldSizes:
    """Sizes of a shield's memory.

    Attributes:
        joints: Joints of the arm.
        obstacles: Obstacles that may move.
        state: Numbers of the state of the law that commands.
        names: Names of the joints, and then of these obstacles, in order.
    """

    joints: int
    obstacles: int
    state: int
    names: tuple[str, ...] = ()

    @property
    def text(self) -> bytes:
        """The names as they stand in the memory: each in UTF-8 with a zero byte, in cells of 8."""
        text = b"".join(name.encode(errors="replace") + b"\0" for name in self.names)
        return text.ljust(-8 * (-len(text) // 8), b"\0")

    @property
    def columns(self) -> int:
        """Numbers of a row of a chunk: a time and a target of any kind."""
        return 1 + max(self.joints, 7)


class ShieldMemory(CommandMemory):
    """What a shield's process shares with its source, and with whoever reads commands.

    All numbers are of 8 bytes, in the order of bytes of the machine. A record begins and ends with
    a sequence number, see `SharedSlot`.

    Args:
        file: File descriptor of the memory.
        sizes: Its sizes.

    Attributes:
        status: Number of the command that it belongs to; ``behind``, ``off_path``, ``delay``,
            ``blocked_for``; late stops, late samples, samples without a certified stop; joints at
            each of `LIMITS`, by bits; and the first numbers of `Counts`. It is written once a
            command was sent.
        places: A number, and how far obstacles have gone.
        refusal: How many chunks were refused, and why the last one was.
        chunks: The ring: number, time sent, clock, kind, rows, and these, each a time and a target.
        names: `ShieldSizes.text`, written once before the first command.
        inner: What this package alone reads: overruns, commands withdrawn, the number of the last
            chunk that the arm has arrived at, the place of what is told of tracking among `STATES`,
            the other numbers of `Counts`, pairs that block the arm, joint velocities that are
            wanted, the last target, and the state of the law before and after.
        way: Likewise, at most every 0.03 s: time, kind, rows, joint positions that are wanted, and
            what is left of the way then, of at most `ROWS` rows; 0 rows without one.
    """

    def __init__(self, file: int, sizes: ShieldSizes) -> None:
        size = self.size_of(sizes)
        super().__init__(file, size, sizes.joints, rows=ROWS, obstacles=sizes.obstacles)
        self.sizes = sizes
        at, slots = self.end, []
        for text in self.records(sizes):
            slots.append(SharedSlot(self._memory, at, text))
            at += slots[-1].size
        self.status, self.places, self.refusal, *rest = slots
        *self.chunks, self.names, self.inner, self.way = rest

    @staticmethod
    def records(sizes: ShieldSizes) -> list[str]:
        """Return the fields of its records behind the commands, in the format of `struct`."""
        n, counts = sizes.joints, len(_OF_CHUNKS)
        status = f"Q4d{3 + len(LIMITS) + counts}Q"
        chunk = f"QdQQQ{8 * ROWS * sizes.columns}s"
        inner = f"{_BLOCKING + _PAIRS + 2 * n + 2 * sizes.state}d"
        places, refusal = f"Q{3 * sizes.obstacles}d", f"Q{_REASON}s"
        way = f"dQQ{n}d{8 * ROWS * sizes.columns}s"
        names = f"{len(sizes.text)}s"
        return [status, places, refusal, *[chunk] * RING, names, inner, way]

    @classmethod
    def size_of(cls, sizes: ShieldSizes) -> int:
        """Return its size in bytes."""
        own = sum(Struct(f"=Q{text}Q").size for text in cls.records(sizes))
        return HEADER + cls.command_bytes(sizes.joints) + own

    def give_chunk(self, kind: Kind, chunk: Chunk, clock: int = MONOTONIC) -> None:
        """Write a chunk.

        Args:
            kind: What its targets are.
            chunk: The chunk.
            clock: What its times are on.
        """
        data = np.zeros((len(chunk.times), self.sizes.columns))
        data[:, 0], data[:, 1 : 1 + chunk.values.shape[1]] = chunk.times, chunk.values
        number = self.count + 1
        head = number, time.monotonic(), clock, KINDS.index(kind), len(data)
        self.chunks[number % RING].write(*head, data.tobytes())
        self.count = number

    def tell_way(self, t: float, wanted: Array, kind: Kind, ahead: Chunk | None) -> None:
        """Write what is left of the way.

        Args:
            t: Time now [s].
            wanted: Joint positions that are wanted now, shape (n,) [rad].
            kind: What the way's targets are.
            ahead: What is left of it; None without one.
        """
        rows = np.zeros((0, self.sizes.columns))
        if ahead is not None:
            times, values = ahead.times[:ROWS], ahead.values[:ROWS]
            rows = np.zeros((len(times), self.sizes.columns))
            rows[:, 0], rows[:, 1 : 1 + values.shape[1]] = times, values
        self.way.write(t, KINDS.index(kind), len(rows), *wanted.tolist(), rows.tobytes())


@with_own_errors
class Shield(InOwnProcess[ShieldMemory], StreamShield):
    """Follows joint positions, velocities, poses or twists with certified commands.

    Targets come when they come, by `follow_positions` and its like; `command` is called every
    period. A new chunk replaces what is left of the last one, whatever kind that was. Joint
    positions and poses are held at the end of a chunk.

    With ``process`` the shield runs in a process of its own, which makes all calls of `command`,
    one each period, on the clock of `time.monotonic`. What is followed is handed to it at once;
    `latest` and the properties tell what is commanded now. `close`, or the end of a ``with`` block,
    has the arm come to rest and ends the process. It does so as well when this process ends,
    however that happens.

    Args:
        arm: The arm.
        period: Time between two calls of `command` [s].
        settings: How it follows its source.
        start: Posture that the robot rests in, shape (n,) [rad]; by default the arm's home. It may
            be up to 0.2 rad outside the position limits: the arm is then brought back first.
        limits: Limits of the joints; by default the arm's. Give those of acceleration and jerk
            where the arm has none.
        obstacles: Obstacles as in a document, each a mapping with ``kind`` and what belongs to it;
            with ``name`` and ``speed`` one that may move, see `StreamShield.command`.
        collisions: Whether the arm is kept clear of itself and of ``obstacles``.
        on_blocked: Called with the status, see `StreamShield`; with ``process`` it is called there,
            once the command was sent, and must be known by name in a module.
        process: Whether the shield runs in a process of its own: False, True, or a function that
            this process calls with each `GuardCommand` at once, so as to send it to the robot. The
            function must be known by name in a module, so that it can be sent there.

    Raises:
        InvalidInputError: If an argument is not as described, or the start is not free.
        RobotError: If the process does not come up.
    """

    def __init__(  # noqa: PLR0913  entry point: one argument per part of what it is told
        self,
        arm: Arm,
        period: float,
        settings: ShieldSettings | None = None,
        *,
        start: Array | None = None,
        limits: JointLimits | None = None,
        obstacles: Sequence[Any] = (),
        collisions: bool = True,
        on_blocked: Callable[[ShieldStatus], object] | None = None,
        process: bool | Send = False,
    ) -> None:
        send = check_process(process)
        require_type("settings", settings, ShieldSettings, type(None))
        settings = ShieldSettings() if settings is None else settings
        if process and settings.record:
            raise InvalidInputError("settings.record: must be left out with process")
        late, tolerance = checked_timing(settings.late, settings.tolerance, period, process)
        if process and tolerance is None:
            tolerance = period
        settings = replace(settings, late=late, tolerance=tolerance)
        world: dict[str, Any] = {"limits": limits, "obstacles": obstacles, "collisions": collisions}
        world["on_blocked"] = on_blocked
        super().__init__(arm, period, settings, start=start, **world)
        self._process: OwnProcess[ShieldMemory] | None = None
        if process:
            names = (*arm.joints, *self.moving_obstacles)
            sizes = ShieldSizes(arm.n, self._guard.moving, self._guard.state.size, names)
            own = arm, self.period, settings, self._guard.position, world, self._steps
            task = _ShieldTask(*own, send, sizes, dict(arm.memo))
            self._process = OwnProcess(task)

    @property
    def path(self) -> str:
        """File by which other programs reach the memory while the shield's process runs.

        Raises:
            InvalidInputError: If the shield has no process of its own.
        """
        return self._own_process("path").path

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        """See `StreamShield.command`; for a shield that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "command: is called by the shield's own process; read position or latest(), or "
                "give a function as process"
            )
        return self._command(t, p_WO)

    def resume(
        self, q: Array, v: Array | None = None, a: Array | None = None, t: float | None = None
    ) -> None:
        """See `StreamShield.resume`; for a shield that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "resume: is not for a shield with a process of its own; close it, and make another "
                "where the arm is"
            )
        super().resume(q, v, a, t)

    def change_limits(self, limits: JointLimits) -> None:
        """See `StreamShield.change_limits`; for a shield that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "change_limits: is not for a shield with a process of its own; close it, and make "
                "another where the arm is"
            )
        super().change_limits(limits)

    def rest(self) -> None:
        """Have the arm come to rest within its bounds, until a target comes."""
        if self._process is None:
            super().rest()
        else:
            self.follow_velocities(np.zeros(self.arm.n))

    def place_obstacles(self, p_WO: Displacements) -> None:
        """Tell the shield's process how far obstacles that may move have gone.

        The arm stands until it is told for the first time.

        Args:
            p_WO: As in `StreamShield.command`; it may be a period old when it is seen, so the
                ``error`` of an obstacle must allow what it moves in that time.

        Raises:
            InvalidInputError: If it has another shape.
            RobotError: If the process has failed, or has ended.
        """
        process = self._own_process("place_obstacles")
        places = self._guard.checked_places(p_WO)
        with process.lock:
            process.check_open()
            slot = process.memory.places
            before = slot.read()
            number = 1 if before is None else before[0] + 1
            slot.write(number, *places.ravel().tolist())
        self.p_WO = places

    def latest(self) -> GuardCommand:
        """Return what the shield's process commands now: its newest command, or the stop after it.

        After `close` it is the last command, at rest. A program that drives a robot has a
        `CommandReader`.

        Raises:
            InvalidInputError: If the shield has no process of its own.
            RobotError: If the process has failed, or has ended by itself.
        """
        return self._own_process("latest").latest()

    @property
    def position(self) -> Array:
        """See `StreamShield.position`."""
        return super().position if self._process is None else self.latest().position

    @property
    def velocity(self) -> Array:
        """See `StreamShield.velocity`."""
        return super().velocity if self._process is None else self.latest().velocity

    @property
    def counts(self) -> Counts:
        """See `StreamShield.counts`."""
        if self._process is None:
            return super().counts
        return Counts(*self._status()[_COUNTS:], *map(int, self._inner()[4:_BLOCKING]))

    @property
    def uncertified(self) -> int:
        """See `StreamShield.uncertified`."""
        return super().uncertified if self._process is None else int(self._status()[7])

    @property
    def overruns(self) -> int:
        """See `StreamShield.overruns`."""
        return super().overruns if self._process is None else int(self._inner()[0])

    @property
    def withdrawn(self) -> int:
        """See `drake_rnn.Guard.withdrawn`."""
        self._own_process("withdrawn")
        return int(self._inner()[1])

    def _inner(self) -> Sequence[Any]:
        """Return the fields of the newest `ShieldMemory.inner`."""
        process = self._own_process("overruns")
        return process.read(process.memory.inner)

    @property
    def late_stops(self) -> int:
        """See `drake_rnn.Guard.late_stops`."""
        return super().late_stops if self._process is None else int(self._status()[5])

    @property
    def late_samples(self) -> int:
        """See `drake_rnn.Guard.late_samples`."""
        return super().late_samples if self._process is None else int(self._status()[6])

    @property
    def newest(self) -> GuardCommand:
        """The last command, with the certified stop that follows it; see `latest`."""
        return super().newest if self._process is None else self.latest()

    @property
    def refusal(self) -> str:
        """Why the last chunk of another program was refused; empty if none was."""
        memory = self._own_process("refusal").memory
        record = memory.refusal.read()
        return "" if record is None else record[1].split(b"\0", 1)[0].decode(errors="replace")

    @property
    def status(self) -> ShieldStatus:
        """See `StreamShield.status`."""
        if self._process is None:
            return super().status
        _, behind, off_path, delay, blocked, *_ = self._status()
        silent, (_, _, arrived, state, *_) = self.latest().target_age, self._inner()
        told = self._limits_at_work(), blocked, silent, int(arrived)
        return ShieldStatus(behind, off_path, delay, *told, tracking=STATES[int(state)])

    @property
    def time(self) -> float:
        """See `StreamShield.time`; with a process, on its clock."""
        return super().time if self._process is None else self.latest().time

    @property
    def last_step(self) -> LastStep:
        """See `StreamShield.last_step`."""
        if self._process is not None:
            # Of the state of the shield in the process, so as to tell what is at work there.
            n, inner = self.arm.n, np.array(self._inner()[_BLOCKING + _PAIRS :])
            self._wanted, target = inner[: 2 * n].reshape(2, n)
            before, after = inner[2 * n :].reshape(2, -1)
            places = self._process.memory.places.read() if self._guard.moving else None
            p_WO = None if places is None else np.array(places[1:]).reshape(-1, 3)
            self._guard.adopt(before, after, target, p_WO)
        return super().last_step

    @property
    def last_record(self) -> ShieldRecord:
        """See `StreamShield.last_record`; with a process, what is wanted may be 0.03 s old."""
        if self._process is None:
            return super().last_record
        t, which, rows, *wanted, data = self._process.read(self._process.memory.way)
        self._kind, columns = KINDS[which], self._process.memory.sizes.columns
        step, newest = self.last_step, self.latest()
        off_path, delay = self._status()[2:4]
        motion = np.array(wanted), self._wanted.copy(), newest.position
        sample = Sample(newest.time, *motion, off_path, delay, step)
        numbers = np.frombuffer(data, count=rows * columns).reshape(rows, columns)
        ahead = Chunk(numbers[:, 0], numbers[:, 1 : 1 + self._width(self._kind)])
        ways = ((t, self._kind, ahead),) if rows else ()
        return record_of([sample], self.period, self.arm.joints, self.clearance, ways)

    def _status(self) -> Sequence[Any]:
        """Return the fields of the newest `ShieldMemory.status`."""
        process = self._own_process("status")
        return process.read(process.memory.status)

    def _now(self, t: float | None) -> float:
        if self._process is None:
            return super()._now(t)
        if t is not None:
            raise InvalidInputError("t: must be left out with process, which has a clock")
        return time.monotonic()

    def _accept(self, kind: Kind, chunk: Chunk, now: float) -> int:
        """Take targets; with a process, hand them to it: `counts` tell what became of them."""
        if self._process is None:
            return super()._accept(kind, chunk, now)
        if len(chunk.times) > ROWS:
            raise InvalidInputError(
                f"{NAMES[kind]}: has {len(chunk.times)} targets; with process at most {ROWS}"
            )
        # Of two threads, one gives its chunk after the other.
        with self._process.lock:
            self._process.check_open()
            self._process.memory.give_chunk(kind, chunk)
            self._kind, self._last, number = kind, now, self._process.memory.count
        if kind == "poses":
            self._poses = chunk.values[:, :3]
        return number

    def _pairs_of_blockage(self) -> tuple[int, ...]:
        if self._process is None:
            return super()._pairs_of_blockage()
        pairs = self._inner()[_BLOCKING : _BLOCKING + _PAIRS]
        return tuple(int(number) for number in pairs if number >= 0.0)

    def _reach_limits(self) -> tuple[str, ...]:
        if self._process is None:
            return super()._reach_limits()
        is_of_tool = self._kind in ("poses", "twists")
        return ("reach",) if is_of_tool and self._status()[4] > 0.0 else ()

    @property
    def _is_led(self) -> bool:
        return super()._is_led if self._process is None else self._last > -np.inf


@dataclass(frozen=True)
class _ShieldTask:
    """What a shield's process is to do: arguments of a `Shield`, with steps that have been built.

    Attributes:
        world: Limits, obstacles, whether collisions are avoided, and what is called where the arm
            is blocked.
        memo: What is known of the arm's shapes, see `Arm.memo`.
    """

    arm: Arm
    period: float
    settings: ShieldSettings
    start: Array
    world: dict[str, Any]
    steps: Steps
    send: Send | None
    sizes: ShieldSizes
    memo: dict[object, Any]

    owner: ClassVar[str] = "shield"

    @property
    def size(self) -> int:
        return ShieldMemory.size_of(self.sizes)

    def parts(self) -> dict[str, object]:
        world = dict(self.world)
        calls = {"on_blocked": world.pop("on_blocked"), "process": self.send}
        return {"arm": self.arm, "obstacles": world, **calls}

    def memory(self, file: int) -> ShieldMemory:
        return ShieldMemory(file, self.sizes)

    def commander(self, memory: ShieldMemory) -> _ServedShield:
        return _ServedShield(memory, self)


class _ServedShield(StreamShield):
    """A shield that reads what is followed from a memory, and writes its commands there.

    Args:
        memory: The memory.
        task: Its arguments.
    """

    def __init__(self, memory: ShieldMemory, task: _ShieldTask) -> None:
        task.arm.memo.update(task.memo)
        super().__init__(
            task.arm,
            task.period,
            task.settings,
            start=task.start,
            **task.world,
            steps=task.steps,
        )
        self._memory, self._seen, self._place_number = memory, 0, 0
        memory.names.write(memory.sizes.text)
        self._number = 0
        self._due_note: tuple[Any, ...] = ()
        # When the way that is left was written last [s].
        self._way_told = -np.inf
        # When the next command is due, and the target that is followed then.
        self._ready: tuple[float, Array | None] | None = None
        self.tolerance = self._guard.tolerance
        self._writer = CommandWriter(memory, self._guard)
        self._not_measured = np.full((self._guard.moving, 3), np.nan)
        # Now, and not at the first pose.
        _ = self._tool

    @property
    def times(self) -> CallTimes:
        return self._times

    def next_call(self, now: float) -> float:
        return self._guard.next_call(now) if self._number else max(now, self.time + self.period)

    def give(self, now: float, *, is_last: bool) -> GuardCommand | None:
        if is_last:
            self.rest()
        guard, places = self._guard, self._places()
        if places is None:
            self._t = now
            return self._writer.stand(now, now - self._last)
        self.command(now, places if guard.moving else None)
        command = self._writer.write(now, now - self._last)
        if command is not None:
            self._number = command.number
        return command

    def rest(self) -> None:
        self._ready = None
        super().rest()

    def _note(self, *arguments: Any) -> None:
        # It can wait.
        self._due_note = arguments

    def _note_call(self, begin: float, t: float | None) -> None:
        # Whoever calls notes it, with what is done besides.
        pass

    def _target(self, now: float, q: Array) -> Array | None:
        ready, self._ready = self._ready, None
        if ready is not None and abs(now - ready[0]) <= self.tolerance:
            return ready[1]
        return super()._target(now, q)

    def prepare(self, now: float) -> None:
        """Tell of the command, follow chunks that have come, though few at once, and look ahead."""
        if self._due_note:
            super()._note(*self._due_note)
        self._tell()
        count = self._memory.count
        first = max(self._seen + 1, count - RING + 1)
        self.counts.lost += first - self._seen - 1
        self._seen = min(count, first + _AT_ONCE - 1)
        for number in range(first, self._seen + 1):
            try:
                self._take_chunk(number, now)
            except InvalidInputError as error:
                self.counts.refused += 1
                reason = str(error).encode()[: _REASON - 1]
                self._memory.refusal.write(self.counts.refused, reason)
        # Where the arm is then, and when, is known but for how late the call will be.
        due = now + self.period
        self._ready = due, super()._target(due, self.position)

    def _take_chunk(self, number: int, now: float) -> None:
        record = self._memory.chunks[number % RING].read()
        if record is None or record[0] != number:
            # Another one was written there meanwhile.
            self.counts.lost += 1
            return
        _, sent, clock, which, rows, data = record
        if which >= len(KINDS) or not 0 < rows <= ROWS or clock > OTHER:
            raise InvalidInputError(
                f"chunk {number}: is of kind {which}, on clock {clock}, and has {rows} rows; must "
                f"be of kind 0 to {len(KINDS) - 1}, on clock 0 or 1, with 1 to {ROWS} rows"
            )
        kind, columns = KINDS[which], self._memory.sizes.columns
        numbers = np.frombuffer(data, count=rows * columns).reshape(rows, columns)
        width = self._width(kind)
        timing = Timing(now, times=numbers[:, 0], sent=sent if clock == OTHER else None)
        chunk = read_chunk(NAMES[kind], numbers[:, 1 : 1 + width], width, timing, self._clock)
        self._check_targets(kind, chunk.values)
        if self._accept(kind, chunk, now):
            # As its source has numbered it, of which some may be lost.
            self._followed = number

    def _places(self) -> Array | None:
        """Return places of obstacles, NaN for what is not new; None before the first ones."""
        record = self._memory.places.read() if self._guard.moving else None
        if record is not None and record[0] != self._place_number:
            self._place_number = record[0]
            return np.array(record[1:]).reshape(-1, 3)
        return self._not_measured if self._place_number or not self._guard.moving else None

    def _tell(self) -> None:
        """Write what there is to say of the newest command."""
        guard, memory, rate = self._guard, self._memory, 1.0 / self.period
        a_before, a = guard.accelerations
        reached = guard.velocity, a, rate * (a - a_before)
        bounds = map(self.limits.toward, LIMITS, reached)
        masks = [
            0 if bound is None else _bits(np.abs(value) >= _AT_LIMIT * bound)
            for value, bound in zip(reached, bounds, strict=True)
        ]
        step = guard.last_step
        inner = self._wanted, step.u["target"], step.x, guard.state
        counts, tracking = vars(self.counts), self._tracking
        state = 0 if tracking is None else STATES.index(tracking.state)
        told = self._times.overruns, self._writer.withdrawn, self._arrived, state
        of_poses = (counts[name] for name in _OF_POSES)
        pairs = _padded(self._pairs_of_blockage())
        memory.inner.write(*told, *of_poses, *pairs, *np.concatenate(inner).tolist())
        late = guard.late_stops, guard.late_samples
        words = *late, self.uncertified, *masks, *(counts[name] for name in _OF_CHUNKS)
        memory.status.write(self._number, self._error, *self._lag(), self._blockage.time, *words)
        if self.time - self._way_told >= _WAY_TOLD:
            self._way_told, t = self.time, self.time
            ahead = self._way.ahead(t) if self._is_led else None
            memory.tell_way(t, self._wanted_position(t, self.position), self._kind, ahead)


def _padded(pairs: Sequence[int]) -> list[int]:
    """Return the first numbers of pairs, and -1 for none."""
    return [*pairs[:_PAIRS], *[-1] * (_PAIRS - len(pairs))]


def _bits(flags: NDArray[np.bool_]) -> int:
    """Return a number with a bit for each joint, the first one the lowest."""
    return sum(1 << int(k) for k in flags.nonzero()[0])
