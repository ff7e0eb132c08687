"""What a shield's process does each period: it reads what is wanted, commands, and tells of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol
from warnings import catch_warnings

import numpy as np
from numpy.typing import NDArray

from ..drive.call_times import CallTimes
from ..drive.own_process import CommandWriter, GuardCommand, Send
from ..errors import InvalidInputError, UnprotectedWarning
from ..inputs.fields import Array
from ..laws.guard import StreamGuard
from ..robot.arm import Arm
from ..robot.clearance.capsules import Displacements
from ..robot.limits import JointLimits
from .chunks import NAMES, Timing, read_chunk
from .memory import (
    KINDS,
    LIMITS,
    OTHER,
    RING,
    ROWS,
    ArmDetails,
    ArmRecords,
    ArmStatus,
    ShieldMemory,
    ShieldSizes,
    Work,
    limits_of,
    reason_of,
)
from .pose_filter import STATES
from .shield import StreamShield

# Time between two writings of the way that is left [s].
_WAY_TOLD = 0.03
# Chunks of a source that are read in one period at most.
_AT_ONCE = 2
# Share of a limit at which it counts as reached.
_AT_LIMIT = 1.0 - 1e-6


class ServedStream(StreamShield):
    """Targets of an arm that are read from a memory, and what became of them, written there."""

    # What it shares, which of its chunks were read, and what is to be noted of the last command.
    _shared: ArmRecords
    _seen = 0
    _due_note: tuple[Any, ...] = ()
    # When the way that is left was written last [s].
    _way_told = -np.inf
    # When the next command is due, and the target that is followed then.
    _ready: tuple[float, Array | None] | None = None

    def serve(self, memory: ShieldMemory, which: int = 0) -> None:
        """Read targets from the records of an arm from now on, and write there what is told."""
        self._shared = memory.arms[which]
        # Now, and not at the first pose.
        _ = self._tool

    @property
    def silent_for(self) -> float:
        """Time since the last target that is followed [s]; infinite before one."""
        return self._t - self._last

    def stand(self, now: float) -> None:
        """Note a time at which there is no command yet [s]."""
        self._t = now

    def rest(self) -> None:
        """See `StreamShield.rest`."""
        self._ready = None
        super().rest()

    def _note(self, *arguments: Any) -> None:
        # It can wait.
        self._due_note = arguments

    def _target(self, now: float, q: Array) -> Array | None:
        ready, self._ready = self._ready, None
        if ready is not None and abs(now - ready[0]) <= self._guard.tolerance:
            return ready[1]
        return super()._target(now, q)

    def look_ahead(self, now: float) -> None:
        """Follow chunks that have come, though few at once, and look for the next target."""
        count = self._shared.count
        first = max(self._seen + 1, count - RING + 1)
        self.counts.lost += first - self._seen - 1
        self._seen = min(count, first + _AT_ONCE - 1)
        for number in range(first, self._seen + 1):
            try:
                self._take_chunk(number, now)
            except InvalidInputError as error:
                self.counts.refused += 1
                self._shared.refusal.write(self.counts.refused, reason_of(error))
        # Where the arm is then, and when, is known but for how late the call will be.
        due = now + self.period
        self._ready = due, super()._target(due, self.position)

    def _take_chunk(self, number: int, now: float) -> None:
        record = self._shared.chunks[number % RING].read()
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
        kind, targets = KINDS[which], self._shared.targets(data, rows)
        width = self._width(kind)
        timing = Timing(now, times=targets[:, 0], sent=sent if clock == OTHER else None)
        chunk = read_chunk(NAMES[kind], targets[:, 1 : 1 + width], width, timing, self._clock)
        self._check_targets(kind, chunk.values)
        if self._accept(kind, chunk, now):
            # As its source has numbered it, of which some may be lost.
            self._followed = number

    def tell(self, number: int) -> None:
        """Write what there is to say of the command of a number."""
        if self._due_note:
            super()._note(*self._due_note)
        counts, tracking = vars(self.counts), self._tracking
        late = self.late_stops, self.late_samples
        lag = self._error, *self._lag(), self._blockage.time
        state = 0 if tracking is None else STATES.index(tracking.state)
        pairs = self._pairs_of_blockage()
        own = self.silent_for, self._arrived, state
        self._shared.details.write(*ArmDetails(*own, counts, pairs, self._wanted).record)
        status = ArmStatus(number, *lag, *late, self.uncertified, self._at_limit(), counts)
        self._shared.status.write(*status.record)
        if self.time - self._way_told >= _WAY_TOLD:
            self._way_told, t = self.time, self.time
            ahead = self._way.ahead(t) if self._is_led else None
            wanted = self._wanted_position(t, self.position)
            self._shared.tell_way(t, wanted, self._kind, ahead)

    def _at_limit(self) -> tuple[int, ...]:
        """Return the joints at each of `LIMITS`, by bits."""
        rate, (a_before, a) = 1.0 / self.period, self._guard.accelerations
        reached = self._guard.velocity, a, rate * (a - a_before)
        bounds = map(self.limits.toward, LIMITS, reached)
        return tuple(
            0 if bound is None else _bits(np.abs(value) >= _AT_LIMIT * bound)
            for value, bound in zip(reached, bounds, strict=True)
        )


def _bits(flags: NDArray[np.bool_]) -> int:
    """Return a number with a bit for each joint, the first one the lowest."""
    return sum(1 << int(k) for k in flags.nonzero()[0])


class ServedShield(ServedStream):
    """A shield of one arm in its process."""

    def _note_call(self, begin: float, t: float | None) -> None:
        # Whoever calls notes it, with what is done besides.
        pass


class Served(Protocol):
    """A shield in its process, of one arm or of two."""

    period: float
    _guard: StreamGuard
    _times: CallTimes

    @property
    def streams(self) -> Sequence[Any]:
        """The `ServedStream` of each arm."""

    def serve(self, memory: ShieldMemory) -> None:
        """Read from a memory what is wanted, from now on."""

    def command(self, t: float, p_WO: Displacements | None) -> Array:
        """See `StreamShield.command`."""

    def change_limits(self, limits: JointLimits) -> None:
        """See `StreamShield.change_limits`."""

    def rest(self) -> None:
        """See `StreamShield.rest`."""


class ShieldCommander:
    """What gives the commands of a shield in its process.

    Args:
        memory: What it shares.
        shield: The shield.
    """

    def __init__(self, memory: ShieldMemory, shield: Served) -> None:
        self._memory, self._shield, self._guard = memory, shield, shield._guard
        self._streams: Sequence[ServedStream] = shield.streams
        self.period, self.tolerance = shield.period, self._guard.tolerance
        self.times = shield._times
        memory.names.write(memory.sizes.text)
        self._writer = CommandWriter(memory, self._guard)
        self._number = self._place_number = 0
        # Numbers of the limits that were asked for, of those accepted last, and of those in force.
        self._limits_asked = self._limits_accepted = self._limits_in_force = 0
        self._not_measured = np.full((self._guard.moving, 3), np.nan)
        shield.serve(memory)

    @property
    def velocity(self) -> Array:
        """See `Commander.velocity`."""
        return self._guard.velocity

    def next_call(self, now: float) -> float:
        """See `Commander.next_call`."""
        if self._number:
            return self._guard.next_call(now)
        return max(now, self._streams[0].time + self.period)

    def give(self, now: float, *, is_last: bool) -> GuardCommand | None:
        """See `Commander.give`."""
        if is_last:
            self._shield.rest()
        places = self._places()
        if places is None:
            for stream in self._streams:
                stream.stand(now)
            return self._writer.stand(now, self._silent_for)
        self._shield.command(now, places if self._guard.moving else None)
        command = self._writer.write(now, self._silent_for)
        if command is not None:
            self._number = command.number
        return command

    @property
    def _silent_for(self) -> float:
        return min(stream.silent_for for stream in self._streams)

    def prepare(self, now: float) -> None:
        """Tell of the command, and take what has come, though few chunks at once."""
        for stream in self._streams:
            stream.tell(self._number)
        guard, sizes = self._guard, self._memory.sizes
        if not guard.limits_pending:
            self._limits_in_force = self._limits_accepted
        step = guard.last_step
        counts = self.times.overruns, self._writer.withdrawn, self._limits_in_force
        work = Work(*counts, step.u["target"], step.x, guard.state)
        self._memory.work.write(*work.record(sizes))
        self._take_limits()
        for stream in self._streams:
            stream.look_ahead(now)

    def _take_limits(self) -> None:
        """Keep limits that have come, from the next command on or as soon as the motion allows."""
        slot = self._memory.limits
        if slot.written == self._limits_asked or (record := slot.read()) is None:
            return
        self._limits_asked, numbers = record[0], record[1:]
        reason = b""
        try:
            self._shield.change_limits(limits_of(numbers))
            self._limits_accepted = self._limits_asked
        except InvalidInputError as error:
            reason = reason_of(error)
        self._memory.answer.write(self._limits_asked, reason)

    def _places(self) -> Array | None:
        """Return places of obstacles, NaN for what is not new; None before the first ones."""
        moving = self._guard.moving
        record = self._memory.places.read() if moving else None
        if record is not None and record[0] != self._place_number:
            self._place_number = record[0]
            return np.array(record[1:]).reshape(-1, 3)
        return self._not_measured if self._place_number or not moving else None


@dataclass(frozen=True)
class ShieldTask:
    """What a shield's process is to do.

    Attributes:
        make: Makes the shield; known by name in a module.
        arm: Its arm.
        options: Its further arguments, by name.
        period: Its period [s].
        send: What is called with each command.
        sizes: Sizes of the memory.
        memo: What is known of the arm's shapes, see `Arm.memo`.
    """

    make: Callable[..., Served]
    arm: Arm
    options: dict[str, Any]
    period: float
    send: Send | None
    sizes: ShieldSizes
    memo: dict[object, Any]

    owner: ClassVar[str] = "shield"

    @property
    def size(self) -> int:
        """See `Task.size`."""
        return ShieldMemory.size_of(self.sizes)

    def parts(self) -> dict[str, object]:
        """See `Task.parts`."""
        world = dict(self.options)
        calls = {"on_blocked": world.pop("on_blocked"), "process": self.send}
        return {"arm": self.arm, "obstacles": world, **calls}

    def memory(self, file: int) -> ShieldMemory:
        """See `Task.memory`."""
        return ShieldMemory(file, self.sizes)

    def commander(self, memory: ShieldMemory) -> ShieldCommander:
        """See `Task.commander`."""
        self.arm.memo.update(self.memo)
        with catch_warnings(action="ignore", category=UnprotectedWarning):
            # It was told where the process was started.
            shield = self.make(self.arm, self.period, **self.options)
        return ShieldCommander(memory, shield)
