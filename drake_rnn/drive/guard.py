"""A guard between a source of joint targets and a robot, as a plain object without a diagram.

It may run in a process of its own, see `drake_rnn.drive.own_process`. One record of the memory is
the newest target and another the newest command, with the state of the law.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from math import nan
from typing import Any, ClassVar

import numpy as np

from ..compiled.library import BuiltStep, built_step, law_step
from ..errors import InvalidInputError
from ..inputs.fields import Array, with_own_errors
from ..inputs.messages import require_type
from ..laws import Law, SampledReading
from ..laws.call_checks import without_checks
from ..laws.guard import LastStep, StepInPlace, StreamGuard
from .own_process import (
    CommandMemory,
    InOwnProcess,
    OwnProcess,
    Send,
    check_process,
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
    it there, and the guard goes on from rest. Whatever the delay is, obstacles may have moved
    during all of it at their largest speed. All this needs the time ``t`` of each call. Without
    it, each call counts as exactly one period after the one before.

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
            now, see `command`; None to begin with the measurement of the first command. With
            ``process`` it must be given if there are any.
        t: Time now, on a clock that never goes back [s]; None if it is not known, and with
            ``process``.
        tolerance: Time by which a call may come late, or early, while the robot keeps its velocity
            [s]; at most a period, by default half of it. Obstacles count as moving on for so long
            during each stop.
        compiled: Whether the steps of the law are compiled: to C where a C compiler is found, else
            by JAX. They differ from those of NumPy by rounding.
        process: Whether the guard runs in a process of its own: False, True, or a function that
            this process calls with each `GuardCommand` at once, so as to send it to the robot. The
            function must be known by name in a module, so that it can be sent there.

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or be compiled, or the robot
            starts beyond its limits or too near to something, or an argument is not as described.
        RobotError: If the process does not come up.
    """

    def __init__(
        self,
        law: Law,
        period: float,
        start: Array | None = None,
        p_WO: Array | None = None,
        t: float | None = None,
        tolerance: float | None = None,
        *,
        compiled: bool = False,
        process: bool | Send = False,
    ) -> None:
        require_type("compiled", compiled, bool)
        send = check_process(process)
        if process and t is not None:
            raise InvalidInputError("t: must be left out with process, which has a clock")
        self._process: OwnProcess[_GuardMemory] | None = None
        t = time.monotonic() if process else t
        steps = Steps(compiled)
        super().__init__(law, period, start, p_WO, t, tolerance, bind=steps.bind)
        if not process:
            return
        if not self._has_begun:
            raise InvalidInputError("p_WO: must be given with process, as obstacles may move")
        sizes = self._shape[0], self._moving, self._x.size
        task = _GuardTask(
            law, self.period, self.position, p_WO, t, self.tolerance, steps, send, sizes
        )
        self._process = OwnProcess(task)

    def command(
        self, target: Array | None = None, p_WO: Array | None = None, t: float | None = None
    ) -> Array:
        """See `StreamGuard.command`; for a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError(
                "command: is called by the guard's own process; give target(...), and read "
                "position or latest()"
            )
        return super().command(target, p_WO, t)

    def resume(self, q: Array, v: Array, a: Array, t: float | None = None) -> None:
        """See `StreamGuard.resume`; for a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError("resume: must be left out with process; make another guard")
        super().resume(q, v, a, t)

    def target(self, target: Array | None = None, p_WO: Array | None = None) -> None:
        """Give the guard's process a target, or places of obstacles; return at once.

        Args:
            target: As in `command`. A later one takes its place, also if none was followed.
            p_WO: As in `command`, or None if nothing was measured. It may be a period old when it
                is seen, in which an obstacle may have gone on: its ``error`` must allow that.

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

    def latest(self) -> GuardCommand:
        """Return the newest command of the guard's process.

        After `close` it is the last one, at rest.

        Raises:
            InvalidInputError: If the guard has no process of its own.
            RobotError: If the process has failed, or has ended by itself.
        """
        number, when, _, *state = self._own_process("latest").command()
        parts = self._reading.state.by_name(np.array(state))
        age = parts["since"].item()
        return GuardCommand(number, when, parts["commanded"], parts["v"], age)

    @property
    def state(self) -> Array:
        """See `StreamGuard.state`."""
        return super().state if self._process is None else np.array(self._process.command()[3:])

    @property
    def position(self) -> Array:
        """See `StreamGuard.position`."""
        return super().position if self._process is None else self.part("commanded")

    @property
    def velocity(self) -> Array:
        """See `StreamGuard.velocity`."""
        return super().velocity if self._process is None else self.part("v")

    @property
    def last_step(self) -> LastStep:
        """See `StreamGuard.last_step`; of a guard that is called by this process."""
        if self._process is not None:
            raise InvalidInputError("last_step: is known to the guard's own process alone")
        return super().last_step

    @property
    def late_stops(self) -> int:
        """See `StreamGuard.late_stops`."""
        return self._late_stops if self._process is None else int(self._process.command()[2])


@dataclass(frozen=True)
class Steps:
    """How the steps of laws are made, here and in a process that it is sent to.

    Attributes:
        compiled: Whether they are compiled.
        built: Steps that have been built in C, by the class of the reading; None of one that is
            left to JAX.
    """

    compiled: bool
    built: dict[str, BuiltStep | None] = field(default_factory=dict)

    def bind(self, reading: SampledReading, period: float) -> StepInPlace:
        """Return the step of a reading at a period [s]."""
        if not self.compiled:
            return StepInPlace.by(without_checks(reading.step), reading, period)
        name = type(reading).__name__
        if name not in self.built:
            self.built[name] = built_step(reading, period)
        built = self.built[name]
        if built is not None:
            return built.in_place()
        return StepInPlace.by(law_step(reading, period), reading, period)


class _GuardMemory(CommandMemory):
    """What a guard's process shares with the one that has started it.

    Args:
        file: File descriptor of the memory.
        sizes: Numbers of joints, of obstacles that may move, and of the law's state.

    Attributes:
        target: Number, positions and places of obstacles.
        command: Number, time, late stops, and the state of the law.
    """

    def __init__(self, file: int, sizes: tuple[int, int, int]) -> None:
        joints, obstacles, state = sizes
        fields = f"Q{joints + 3 * obstacles}d", f"Qd{state + 1}d"
        super().__init__(file, self.size_of(sizes))
        self.target = SharedSlot(self._memory, HEADER, fields[0])
        self.command = SharedSlot(self._memory, HEADER + self.target.size, fields[1])

    @staticmethod
    def size_of(sizes: tuple[int, int, int]) -> int:
        """Return its size in bytes."""
        joints, obstacles, state = sizes
        return HEADER + 8 * (joints + 3 * obstacles + state + 16)


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
        guard = StreamGuard(
            self.law, self.period, *places, self.t, self.tolerance, bind=self.steps.bind
        )
        return _GuardCommander(guard, memory, self.sizes)


class _GuardCommander:
    """What a guard's process does each period.

    Args:
        guard: The guard.
        memory: What it shares.
        sizes: See `_GuardMemory`.
    """

    def __init__(
        self, guard: StreamGuard, memory: _GuardMemory, sizes: tuple[int, int, int]
    ) -> None:
        self._guard, self._memory, self._seen = guard, memory, 0
        self.period, self.tolerance = guard.period, guard.tolerance
        self._joints, self._moving, _ = sizes
        self._not_measured = np.full((self._moving, 3), nan) if self._moving else None

    @property
    def velocity(self) -> Array:
        return self._guard.velocity

    def give(self, number: int, now: float, *, is_last: bool) -> GuardCommand:
        guard = self._guard
        target, places = self._newest()
        if is_last:
            target = None
            guard.rest()
        guard.command(target, places, now)
        self._memory.command.write(number, now, guard.late_stops, *guard.state.tolist())
        age = guard.part("since").item()
        return GuardCommand(number, now, guard.position, guard.velocity, age)

    def prepare(self, now: float) -> None:
        pass

    def _newest(self) -> tuple[Array | None, Array | None]:
        """Return a target and places of obstacles that are new; NaN for what is not."""
        fields = self._memory.target.read()
        if fields is None or fields[0] == self._seen:
            return None, self._not_measured
        self._seen, numbers = fields[0], np.array(fields[1:])
        places = numbers[self._joints :].reshape(-1, 3)
        return numbers[: self._joints], places if self._moving else None
