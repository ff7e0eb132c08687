"""What a shield tells, and takes, whose commands a process of its own gives.

It asks the memory that both share: for the last step of the law, for what became of the targets of
each arm, for the newest command. Targets and limits go there as messages.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..drive.own_process import (
    GuardCommand,
    InOwnProcess,
    OwnProcess,
    Send,
    check_process,
    checked_timing,
)
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import require_type
from ..laws.guard import Bind, LastStep, StreamGuard, check_period
from ..laws.limit_change import LimitChange
from ..robot.arm import Arm
from ..robot.clearance.capsules import Displacements
from ..robot.limits import JointLimits
from .chunks import NAMES, Chunk, Counts, Kind
from .guarded_commands import GuardedCommands
from .memory import (
    KINDS,
    ROWS,
    ArmDetails,
    ArmRecords,
    ArmStatus,
    ShieldMemory,
    ShieldSizes,
    Work,
    limit_numbers,
    reason_text,
)
from .pose_filter import STATES
from .report import Sample, ShieldRecord, record_of
from .serving import Served, ShieldTask
from .shield import ShieldSettings, ShieldStatus, StreamShield


class GuardOfProcess(StreamGuard):
    """A guard that tells what that of a process does, which has the same law.

    Args:
        guard: Guard of the law, which makes no steps.
        process: The process.
    """

    def __init__(self, guard: StreamGuard, process: OwnProcess[ShieldMemory]) -> None:
        vars(self).update(vars(guard))
        self._process = process
        # Numbers of the limits in force, and of those asked for last; changes that may come.
        self._in_force = self._accepted = self._asked = 0
        self._changes: dict[int, LimitChange] = {}

    @property
    def work(self) -> Work:
        """What the process tells of the law, once this has the limits that are in force there."""
        work = Work.of(self._process.read(self._process.memory.work), self._shape[0])
        if work.limits != self._in_force:
            self._in_force = work.limits
            self._adopt(self._changes[work.limits])
            self._changes = {k: each for k, each in self._changes.items() if k > work.limits}
        return work

    def _update(self) -> None:
        """Take over the last step of the process."""
        work, places = self.work, self._process.memory.places.read()
        p_WO = None if places is None or not self._moving else np.array(places[1:]).reshape(-1, 3)
        self.adopt(work.before, work.after, work.target, p_WO)

    def change_law(self, law: Any, bind: Bind | None = None) -> None:
        """See `StreamGuard.change_law`."""
        process, change = self._process, self.change_to(law, bind)
        with process.lock:
            process.check_open()
            self._asked = number = self._asked + 1
            self._changes[number] = change
            process.memory.limits.write(number, *limit_numbers(law.limits))
            reason = process.whole(lambda: _answer(process.memory, number))
            if reason:
                del self._changes[number]
                raise InvalidInputError(reason_text(reason))
            self._accepted = number

    @property
    def limits(self) -> JointLimits:
        """See `StreamGuard.limits`."""
        _ = self.work
        return self.law.limits

    @property
    def next_limits(self) -> JointLimits:
        """See `StreamGuard.next_limits`."""
        change = self._changes.get(self._accepted)
        return self.law.limits if change is None else change.law.limits

    @property
    def limits_pending(self) -> bool:
        """See `StreamGuard.limits_pending`."""
        return self.work.limits != self._accepted

    @property
    def newest(self) -> GuardCommand:
        """See `StreamGuard.newest`."""
        return self._process.latest()

    @property
    def position(self) -> Array:
        """See `StreamGuard.position`."""
        return self._process.latest().position

    @property
    def velocity(self) -> Array:
        """See `StreamGuard.velocity`."""
        return self._process.latest().velocity

    @property
    def acceleration(self) -> Array:
        """See `StreamGuard.acceleration`."""
        return self._process.latest().acceleration

    @property
    def state(self) -> Array:
        """See `StreamGuard.state`."""
        self._update()
        return super().state

    @property
    def last_step(self) -> LastStep:
        """See `StreamGuard.last_step`."""
        self._update()
        return super().last_step

    @property
    def late_stops(self) -> int:
        """See `StreamGuard.late_stops`."""
        return self._status.late_stops

    @property
    def late_samples(self) -> int:
        """See `StreamGuard.late_samples`."""
        return self._status.late_samples

    @property
    def _status(self) -> ArmStatus:
        first = self._process.memory.arms[0]
        return ArmStatus.of(self._process.read(first.status))


def _answer(memory: ShieldMemory, number: int) -> bytes | None:
    """Return what the process says of limits of a number; None before it has."""
    record = memory.answer.read()
    return record[1].rstrip(b"\0") if record is not None and record[0] == number else None


class StreamOfProcess(StreamShield):
    """Targets that an arm follows whose commands a process may give."""

    # The process, and which of its arms this is.
    _process: OwnProcess[ShieldMemory] | None = None
    _which = 0

    def _records(self, process: OwnProcess[ShieldMemory]) -> ArmRecords:
        return process.memory.arms[self._which]

    def _told(self, process: OwnProcess[ShieldMemory]) -> ArmStatus:
        return ArmStatus.of(process.read(self._records(process).status))

    def _details(self, process: OwnProcess[ShieldMemory]) -> ArmDetails:
        return ArmDetails.of(process.read(self._records(process).details))

    def rest(self) -> None:
        """Have the arm come to rest within its bounds, until a target comes."""
        if self._process is None:
            super().rest()
        else:
            self.follow_velocities(np.zeros(self.arm.n))

    @property
    def counts(self) -> Counts:
        """See `StreamShield.counts`."""
        if self._process is None:
            return super().counts
        return Counts(**self._told(self._process).counts, **self._details(self._process).counts)

    @property
    def refusal(self) -> str:
        """Why the last chunk of another program was refused; empty if none was."""
        if self._process is None:
            raise InvalidInputError("refusal: is for a shield that was made with process=True")
        record = self._records(self._process).refusal.read()
        return "" if record is None else reason_text(record[1])

    @property
    def status(self) -> ShieldStatus:
        """See `StreamShield.status`."""
        if self._process is None:
            return super().status
        told, details = self._told(self._process), self._details(self._process)
        return ShieldStatus(
            behind=told.behind,
            off_path=told.off_path,
            delay=told.delay,
            limited_by=self._limits_at_work(),
            blocked_for=told.blocked_for,
            silent_for=details.silent_for,
            arrived=details.arrived,
            limits_pending=self._whole.limits_pending,
            tracking=STATES[details.tracking],
        )

    @property
    def time(self) -> float:
        """See `StreamShield.time`; with a process, on its clock."""
        return super().time if self._process is None else self._process.latest().time

    @property
    def last_record(self) -> ShieldRecord:
        """See `StreamShield.last_record`; with a process, what is wanted may be 0.03 s old."""
        if self._process is None:
            return super().last_record
        records = self._records(self._process)
        t, which, rows, *wanted, data = self._process.read(records.way)
        self._kind = KINDS[which]
        told, details = self._told(self._process), self._details(self._process)
        motion = np.array(wanted), details.wanted, self.position
        lag = told.off_path, told.delay
        sample = Sample(self.time, *motion, *lag, self.last_step)
        targets = records.targets(data, rows)
        ahead = Chunk(targets[:, 0], targets[:, 1 : 1 + self._width(self._kind)])
        ways = ((t, self._kind, ahead),) if rows else ()
        return record_of([sample], self.period, self.arm.joints, self.clearance, ways)

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
            number = self._records(self._process).give_chunk(kind, chunk)
            self._kind = kind
        if kind == "poses":
            self._poses = chunk.values[:, :3]
        return number

    def _pairs_of_blockage(self) -> tuple[int, ...]:
        if self._process is None:
            return super()._pairs_of_blockage()
        return self._details(self._process).pairs

    def _reach_limits(self) -> tuple[str, ...]:
        if self._process is None:
            return super()._reach_limits()
        is_of_tool = self._kind in ("poses", "twists")
        return ("reach",) if is_of_tool and self._told(self._process).blocked_for > 0.0 else ()

    @property
    def _is_led(self) -> bool:
        if self._process is None:
            return super()._is_led
        return self._details(self._process).silent_for < np.inf


class CommandsOfProcess(InOwnProcess[ShieldMemory], GuardedCommands):
    """Commands of a shield that a process may give."""

    arm: Arm
    period: float
    _process: OwnProcess[ShieldMemory] | None = None

    def _start(
        self,
        make: Callable[..., Served],
        options: dict[str, Any],
        send: Send | None,
        arms: tuple[int, ...] = (),
    ) -> None:
        """Have a process give the commands from now on.

        Args:
            make: Makes the shield there, of the arm, the period and these options.
            options: The options, by name; the start is where the arm is.
            send: What is called there with each command.
            arms: Joints of each of two arms.
        """
        arm, guard = self.arm, self._guard
        names = (*arm.joints, *self.moving_obstacles)
        sizes = ShieldSizes(arm.n, guard.moving, guard.state.size, names, arms)
        options = {**options, "start": guard.position}
        task = ShieldTask(make, arm, options, self.period, send, sizes, dict(arm.memo))
        self._process = OwnProcess(task)
        self._guard = GuardOfProcess(guard, self._process)

    @property
    def path(self) -> str:
        """File by which other programs reach the memory while the shield's process runs.

        Raises:
            InvalidInputError: If the shield has no process of its own.
        """
        return self._own_process("path").path

    def latest(self) -> GuardCommand:
        """Return what the shield's process commands now: its newest command, or the stop after it.

        After `close` it is the last command, at rest. A program that drives a robot has a
        `CommandReader`.

        Raises:
            InvalidInputError: If the shield has no process of its own.
            RobotError: If the process has failed, or has ended by itself.
        """
        return self._own_process("latest").latest()

    def place_obstacles(self, p_WO: Displacements) -> None:
        """Tell the shield's process how far obstacles that may move have gone.

        The arm stands until it is told for the first time.

        Args:
            p_WO: As in `command`; it may be a period old when it is seen, so the ``error`` of an
                obstacle must allow what it moves in that time.

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
        for stream in self.streams:
            stream.p_WO = places

    @property
    def overruns(self) -> int:
        """See `GuardedCommands.overruns`."""
        return super().overruns if self._process is None else self._work("overruns").overruns

    @property
    def withdrawn(self) -> int:
        """See `drake_rnn.Guard.withdrawn`."""
        return self._work("withdrawn").withdrawn

    def _work(self, what: str) -> Work:
        process = self._own_process(what)
        return Work.of(process.read(process.memory.work), process.memory.sizes.joints)

    def _require_own_calls(self, what: str) -> None:
        """Raise an InvalidInputError if a process makes calls of `command` and `resume`."""
        if self._process is not None:
            raise InvalidInputError(f"{what}: {_INSTEAD[what]}")


# What to do in place of calls where a process makes them.
_INSTEAD = {
    "command": "is called by the shield's own process; read position or latest(), or give a "
    "function as process",
    "resume": "is not for a shield with a process of its own; close it, and make another where the "
    "arm is",
}


def settings_of(settings: object, period: object, process: object) -> ShieldSettings:
    """Return the settings of a shield that may have a process of its own, checked.

    Args:
        settings: What is given; None for the defaults.
        period: Time between two commands [s].
        process: What is given as ``process``.
    """
    check_process(process)
    check_period("period", period)
    require_type("settings", settings, ShieldSettings, type(None))
    checked: Any = ShieldSettings() if settings is None else settings
    if process and checked.record:
        raise InvalidInputError("settings.record: must be left out with process")
    step: Any = period
    late, tolerance = checked_timing(checked.late, checked.tolerance, step, process)
    if process and tolerance is None:
        tolerance = float(step)
    timed: ShieldSettings = replace(checked, late=late, tolerance=tolerance)
    return timed
