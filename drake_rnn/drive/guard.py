"""A guard between a source of joint targets and a robot, as a plain object without a diagram.

It may run in a process of its own, see `drake_rnn.drive.own_process`. One record of the memory is
the newest target and another the newest command, with the state of the law.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, ClassVar

import numpy as np

from ..compiled.builds import Steps
from ..errors import InvalidInputError
from ..inputs.fields import Array, with_own_errors
from ..inputs.messages import replace_unchecked, require_type
from ..laws import Law
from ..laws.guard import LastStep, Late, StreamGuard
from ..robot.clearance.capsules import Displacements
from ..robot.limits import JointLimits
from .call_times import CallTimes
from .command_memory import CommandMemory
from .own_process import (
    CommandWriter,
    InOwnProcess,
    OwnProcess,
    Send,
    check_process,
    checked_timing,
)
from .own_process import (
    GuardCommand as GuardCommand,
)
from .shared_cycles import HEADER, SharedSlot


@with_own_errors
class Guard(InOwnProcess["_GuardMemory"], StreamGuard):
    """Turns joint targets, whenever they come, into commands within every bound.

    It runs a `JointStream` outside of any diagram, for a loop of one's own. As a system of a
    diagram the same law runs in a `SampledController`, with the input port ``target``.

    Each command is reached a period after its call, at a constant velocity. The robot then waits
    there for the next command. A call that comes late by up to ``tolerance`` goes on with the
    velocity. One that comes later finds the arm at rest at the last command: the robot has stopped
    it there, and the guard goes on from rest. With ``late="stop"`` the robot goes on along the stop
    that was certified with the last command, `newest`, and so does the guard: no bound is broken.
    Whatever the delay is, obstacles may have moved during all of it at their largest speed. All
    this needs the time ``t`` of each call. Without it, each call counts as exactly one period after
    the one before.

    With ``process`` the guard runs in a process of its own, which makes all calls, one each period,
    on the clock of `time.monotonic`. `target` hands it a target and returns at once; `latest` and
    the properties tell what is commanded now. `close`, or the end of a ``with`` block, has the arm
    come to rest and ends the process. It does so as well when this process ends, however that
    happens. If no target comes, the arm comes to rest after the law's ``timeout``.

    Args:
        law: What is kept, and how targets are followed; a `JointStream`.
        period: Time between two calls of `command` [s].
        start: Posture that the robot rests in, shape (n,) [rad]; by default the law's ``home``.
        p_WO: How far the obstacles that may move have gone from where they are stated, as measured
            now, in rows or by name, see `StreamGuard.command`; None to begin with the measurement
            of the first command. With ``process`` it must be given if there are any.
        t: Time now, on a clock that never goes back [s]; None if it is not known, and with
            ``process``.
        tolerance: Time by which a call may come late, or early, while the robot keeps its velocity
            [s]; at most a period, by default half of it. Obstacles count as moving on for so long
            during each stop. Commands that go on along a stop are made so long before they hold,
            those of a process by default a period.
        late: What the robot does that gets no command in time: ``hold``, it stands at the last one,
            or ``stop``, it goes on along the certified stop. By default ``stop`` with
            ``process=True``, for a `CommandReader`; else ``hold``, as robots do by themselves.
        compiled: Whether the steps of the law are compiled. By default they are made in C as soon
            as a process beside this one has built it, if there are a C compiler and JAX, and by
            NumPy until then; what was built before makes them from the first one on. True waits for
            the compiler, or for JAX where there is none; False has NumPy make them. They differ by
            rounding.
        process: Whether the guard runs in a process of its own: False, True, or a function that
            this process calls with each `GuardCommand` at once, so as to send it to the robot. The
            function must be known by name in a module, so that it can be sent there.

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or be compiled, or the robot
            starts beyond its limits or too near to something, or an argument is not as described.
        RobotError: If the process does not come up.
    """

    def __init__(  # noqa: PLR0913  entry point: one argument per part of what it is told
        self,
        law: Law,
        period: float,
        start: Array | None = None,
        p_WO: Displacements | None = None,
        t: float | None = None,
        tolerance: float | None = None,
        *,
        late: Late | None = None,
        compiled: bool | None = None,
        process: bool | Send = False,
    ) -> None:
        require_type("compiled", compiled, bool, type(None))
        send = check_process(process)
        late, tolerance = checked_timing(late, tolerance, period, process)
        if process and t is not None:
            raise InvalidInputError("t: must be left out with process, which has a clock")
        self._process: OwnProcess[_GuardMemory] | None = None
        t = time.monotonic() if process else t
        self._steps = steps = Steps(compiled)
        self._times = CallTimes("guard", period, lambda: steps.text)
        super().__init__(law, period, start, p_WO, t, tolerance, late=late, bind=steps.bind)
        if not process:
            return
        if not self._has_begun:
            raise InvalidInputError("p_WO: must be given with process, as obstacles may move")
        sizes = self._shape[0], self._moving, self._x.size
        places = self.checked_places(p_WO) if self._moving else None
        task = _GuardTask(
            law, self.period, self.position, places, t, self.tolerance, late, steps, send, sizes
        )
        self._process = OwnProcess(task)

    @property
    def steps(self) -> str:
        """How the steps of the law are made, in a line, such as ``C (gcc), from the cache``."""
        return self._steps.text

    def command(
        self,
        target: Array | None = None,
        p_WO: Displacements | None = None,
        t: float | None = None,
    ) -> Array:
        """See `StreamGuard.command`; for a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "command: is called by the guard's own process; give target(...), and read "
                "position or latest()"
            )
        begin = time.perf_counter()
        q = super().command(target, p_WO, t)
        self._times.note(begin, t)
        return q

    @property
    def overruns(self) -> int:
        """How many calls of `command` took longer than the period."""
        return self._times.overruns if self._process is None else int(self._counted()[2])

    def resume(self, q: Array, v: Array, a: Array, t: float | None = None) -> None:
        """See `StreamGuard.resume`; for a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError("resume: must be left out with process; make another guard")
        super().resume(q, v, a, t)

    def change_limits(self, limits: JointLimits) -> None:
        """See `StreamGuard.change_limits`; for a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "change_limits: must be left out with process; make another guard"
            )
        require_type("limits", limits, JointLimits)
        steps = self._steps.anew()
        self.change_law(replace_unchecked(self.law, limits=limits), steps.bind)
        self._steps = steps

    def target(self, target: Array | None = None, p_WO: Displacements | None = None) -> None:
        """Give the guard's process a target, or places of obstacles; return at once.

        Args:
            target: As in `command`. A later one takes its place, also if none was followed.
            p_WO: As in `StreamGuard.command`, or None if nothing was measured. It may be a period
                old when it is seen, in which an obstacle may have gone on: its ``error`` must allow
                that.

        Raises:
            InvalidInputError: If an argument has another shape or is no number; nothing is given.
            RobotError: If the process has failed, or has ended.
        """
        process = self._own_process("target")
        places = np.full((self._moving, 3), nan) if p_WO is None else self.checked_places(p_WO)
        # Of two threads, one gives its target after the other.
        with process.lock:
            self._read(target)
            process.check_open()
            memory = process.memory
            memory.count += 1
            memory.target.write(memory.count, *self._target.tolist(), *places.ravel().tolist())

    @property
    def path(self) -> str:
        """File by which a `CommandReader` reaches the commands while the guard's process runs.

        Raises:
            InvalidInputError: If the guard has no process of its own.
        """
        return self._own_process("path").path

    def latest(self) -> GuardCommand:
        """Return what the guard's process commands now: its newest command, or the stop after it.

        After `close` it is the last command, at rest.

        Raises:
            InvalidInputError: If the guard has no process of its own.
            RobotError: If the process has failed, or has ended by itself.
        """
        return self._own_process("latest").latest()

    @property
    def state(self) -> Array:
        """See `StreamGuard.state`."""
        return super().state if self._process is None else np.array(self._counted()[4:])

    @property
    def position(self) -> Array:
        """See `StreamGuard.position`."""
        return super().position if self._process is None else self.latest().position

    @property
    def velocity(self) -> Array:
        """See `StreamGuard.velocity`."""
        return super().velocity if self._process is None else self.latest().velocity

    @property
    def last_step(self) -> LastStep:
        """See `StreamGuard.last_step`; of a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError("last_step: is known to the guard's own process alone")
        return super().last_step

    @property
    def late_stops(self) -> int:
        """See `StreamGuard.late_stops`."""
        return self._late_stops if self._process is None else int(self._counted()[0])

    @property
    def late_samples(self) -> int:
        """See `StreamGuard.late_samples`."""
        return self._late_samples if self._process is None else int(self._counted()[1])

    @property
    def withdrawn(self) -> int:
        """How many commands of a process came too late, so that nobody follows them."""
        self._own_process("withdrawn")
        return int(self._counted()[3])

    def _counted(self) -> Sequence[Any]:
        """Return what `_GuardMemory.state` has of the process's last command."""
        process = self._own_process("state")
        return process.read(process.memory.state)


class _GuardMemory(CommandMemory):
    """What a guard's process shares with the one that has started it.

    Args:
        file: File descriptor of the memory.
        sizes: Numbers of joints, of obstacles that may move, and of the law's state.

    Attributes:
        target: Number, positions and places of obstacles.
        state: Late stops, late samples, overruns, commands withdrawn, and the state of the law, of
            the newest command.
    """

    def __init__(self, file: int, sizes: tuple[int, int, int]) -> None:
        joints, obstacles, state = sizes
        super().__init__(file, self.size_of(sizes), joints, obstacles=obstacles)
        self.target = SharedSlot(self._memory, self.end, f"Q{joints + 3 * obstacles}d")
        self.state = SharedSlot(self._memory, self.end + self.target.size, f"{4 + state}d")

    @classmethod
    def size_of(cls, sizes: tuple[int, int, int]) -> int:
        """Return its size in bytes."""
        joints, obstacles, state = sizes
        own = 8 * (joints + 3 * obstacles + state + 16)
        return HEADER + cls.command_bytes(joints) + own


@dataclass(frozen=True)
class _GuardTask:
    """What a guard's process is to do: arguments of a `Guard`, with the step that has been built.

    Attributes:
        sizes: See `_GuardMemory`.
    """

    law: Any
    period: float
    start: Array
    p_WO: Array | None
    t: float | None
    tolerance: float
    late: Late
    steps: Steps
    send: Send | None
    sizes: tuple[int, int, int]

    owner: ClassVar[str] = "guard"

    @property
    def size(self) -> int:
        return _GuardMemory.size_of(self.sizes)

    def parts(self) -> dict[str, object]:
        return {"law": self.law, "process": self.send}

    def memory(self, file: int) -> _GuardMemory:
        return _GuardMemory(file, self.sizes)

    def commander(self, memory: _GuardMemory) -> _GuardCommander:
        places = self.start, self.p_WO
        how: dict[str, Any] = {"late": self.late, "bind": self.steps.bind}
        guard = StreamGuard(self.law, self.period, *places, self.t, self.tolerance, **how)
        return _GuardCommander(guard, memory, self.sizes, self.steps)


class _GuardCommander:
    """What a guard's process does each period.

    Args:
        guard: The guard.
        memory: What it shares.
        sizes: See `_GuardMemory`.
        steps: How its steps are made.
    """

    def __init__(
        self,
        guard: StreamGuard,
        memory: _GuardMemory,
        sizes: tuple[int, int, int],
        steps: Steps,
    ) -> None:
        self._guard, self._memory, self._seen = guard, memory, 0
        self.period, self.tolerance = guard.period, guard.tolerance
        self._writer = CommandWriter(memory, guard)
        self._joints, self._moving, _ = sizes
        self._not_measured = np.full((self._moving, 3), nan) if self._moving else None
        self.times = CallTimes("guard", guard.period, lambda: steps.text)

    @property
    def velocity(self) -> Array:
        return self._guard.velocity

    def next_call(self, now: float) -> float:
        return self._guard.next_call(now)

    def give(self, now: float, *, is_last: bool) -> GuardCommand | None:
        guard = self._guard
        target, places = self._newest()
        if is_last:
            target = None
            guard.rest()
        guard.command(target, places, now)
        return self._writer.write(now)

    def prepare(self, now: float) -> None:
        guard, overruns = self._guard, self.times.overruns
        counts = guard.late_stops, guard.late_samples, overruns, self._writer.withdrawn
        self._memory.state.write(*counts, *guard.state.tolist())

    def _newest(self) -> tuple[Array | None, Array | None]:
        """Return a target and places of obstacles that are new; NaN for what is not."""
        fields = self._memory.target.read()
        if fields is None or fields[0] == self._seen:
            return None, self._not_measured
        self._seen, numbers = fields[0], np.array(fields[1:])
        places = numbers[self._joints :].reshape(-1, 3)
        return numbers[: self._joints], places if self._moving else None
