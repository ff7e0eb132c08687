"""A guard between a source of joint targets and a robot, as a plain object without a diagram.

It may run in a process of its own, which gives a command every period by its own clock, whatever
becomes of the source: it may stall, send what is no target, or end. Both share a memory of
`drake_rnn.drive.shared_cycles`, in which one record is the newest target and another the newest
command, with the state of the law.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from multiprocessing import current_process, get_context
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd, ForkingPickler
from multiprocessing.util import Finalize
from traceback import extract_tb
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np

from ..compiled.library import BuiltStep, built_step, law_step
from ..errors import InvalidInputError, RobotError
from ..inputs.fields import Array
from ..inputs.messages import require_type, short
from ..inputs.processes import deaf_children
from ..laws import Law, SampledReading
from ..laws.guard import LastStep, StepInPlace, StreamGuard
from .shared_cycles import (
    ENDED,
    HEADER,
    LAW_BESIDE,
    MOVING,
    REST,
    STARTING,
    SharedMemory,
    SharedSlot,
    anonymous_file,
    prioritize,
    without_collection,
)

# Time that the process has to come up, and to go on while it comes to rest [s].
_STARTS, _STALLS = 120.0, 5.0
# Speeds and accelerations over a period below which the arm rests [rad/s].
_REST = 1e-9
# Share of a period that the process sleeps at least, so that others may run.
_LEAST_SLEEP = 0.05
# Of Linux: the call that has this thread woken up on time.
_SET_TIMER_SLACK = 29


class GuardCommand(NamedTuple):
    """A command of a guard in a process of its own.

    Attributes:
        number: How many there have been, with this one.
        time: When it was given, on the clock of `time.monotonic` [s].
        position: Positions to be reached a period later, shape (n,) [rad].
        velocity: Velocities on the way there, shape (n,) [rad/s].
        target_age: Time since a target came, or the guard began [s]; if it is longer than the
            law's ``timeout``, the arm comes to rest or rests.
    """

    number: int
    time: float
    position: Array
    velocity: Array
    target_age: float


class Guard(StreamGuard):
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
        process: bool | Callable[[GuardCommand], object] = False,
    ) -> None:
        require_type("compiled", compiled, bool)
        if not (isinstance(process, bool) or callable(process)):
            raise InvalidInputError(
                f"process: must be True, False or a function, not {short(process)}"
            )
        send = None if isinstance(process, bool) else process
        if process and t is not None:
            raise InvalidInputError("t: must be left out with process, which has a clock")
        self._process: _Process | None = None
        self._built: BuiltStep | None = None
        t = time.monotonic() if process else t
        bind = self._bind_compiled if compiled else None
        super().__init__(law, period, start, p_WO, t, tolerance, bind=bind)
        if not process:
            return
        if not self._has_begun:
            raise InvalidInputError("p_WO: must be given with process, as obstacles may move")
        task = _Task(
            law, self.period, self.position, p_WO, t, self.tolerance, compiled, self._built, send
        )
        self._process = _Process(task, (self._shape[0], self._moving, self._x.size))

    def _bind_compiled(self, reading: SampledReading, period: float) -> StepInPlace:
        self._built = built_step(reading, period)
        return bind_step(self._built, reading, period)

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
        places = np.full((self._moving, 3), nan) if p_WO is None else self._places(p_WO)
        # Of two threads, one gives its target after the other.
        with process.lock:
            self._read(target)
            process.give(self._target, places)

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

    def close(self) -> None:
        """Have the arm come to rest, and end the guard's process, if it has one.

        Raises:
            RobotError: If the process has failed and nobody was told so, or had to be killed.
        """
        if self._process is not None:
            self._process.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def state(self) -> Array:
        """See `StreamGuard.state`."""
        return super().state if self._process is None else np.array(self._process.command()[3:])

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

    def _own_process(self, what: str) -> _Process:
        if self._process is None:
            raise InvalidInputError(f"{what}: is for a guard that was made with process=True")
        return self._process


def bind_step(built: BuiltStep | None, reading: SampledReading, period: float) -> StepInPlace:
    """Return a compiled step, which has been built or is left to JAX."""
    if built is not None:
        return built.in_place()
    return StepInPlace.by(law_step(reading, period), reading, period)


@dataclass(frozen=True)
class _File:
    """A descriptor of a file that a process gets as it is started."""

    descriptor: int

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _received, (DupFd(self.descriptor),)


def _received(copy: Any) -> _File:
    return _File(copy.detach())


@dataclass(frozen=True)
class _Task:
    """What a process is to do: arguments of a `Guard`, with the step that has been built."""

    law: Any
    period: float
    start: Array
    p_WO: Array | None
    t: float | None
    tolerance: float
    compiled: bool
    built: BuiltStep | None
    send: Callable[[GuardCommand], object] | None

    def guard(self) -> StreamGuard:
        """Return the guard."""
        bind = self._bind if self.compiled else None
        places = self.start, self.p_WO
        return StreamGuard(self.law, self.period, *places, self.t, self.tolerance, bind=bind)

    def _bind(self, reading: SampledReading, period: float) -> StepInPlace:
        return bind_step(self.built, reading, period)


class _Memory(SharedMemory):
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


class _Process:
    """The process of a guard, as the one that has started it sees it.

    Args:
        task: What it is to do.
        sizes: See `_Memory`.

    Attributes:
        lock: Held by the thread that gives a target.

    Raises:
        InvalidInputError: If there can be none, or an argument cannot be sent there.
        RobotError: If it does not come up.
    """

    def __init__(self, task: _Task, sizes: tuple[int, int, int]) -> None:
        _check_sending(law=task.law, process=task.send)
        file = anonymous_file(_Memory.size_of(sizes))
        self._memory, self._count, self._period = _Memory(file, sizes), 0, task.period
        self._was_told, self._has_closed, self._owner = False, False, os.getpid()
        self.lock = threading.Lock()
        context = get_context("spawn")
        self._process = context.Process(
            target=_serve, args=(task, _File(file), sizes, os.getpid()), name="guard"
        )
        try:
            with deaf_children():
                self._process.start()
        except RuntimeError:
            # It is raised where a process that starts imports the script that has started it.
            raise InvalidInputError(f"process: cannot be started here; {_MAIN}") from None
        finally:
            os.close(file)
        # Dropped by all, or at the end of this process, which waits for it then.
        self._finalize = weakref.finalize(self, _let_go, self._memory, self._process, self._owner)
        self._finalize.atexit = False
        self._at_exit = Finalize(None, _ask_to_rest, (self._memory,), exitpriority=0)
        until = time.monotonic() + _STARTS
        while self._memory.doing == STARTING and self._process.is_alive():
            if time.monotonic() > until:
                self._process.kill()
            time.sleep(0.002)
        if self._memory.doing == STARTING:
            self._process.join()
            self._has_closed = True
            status = self._process.exitcode
            raise RobotError(
                f"guard: its process has ended as it started, with status {status}; {_MAIN}"
            )
        if self._memory.failure:
            self._process.join()
            raise self._failure

    @property
    def _failure(self) -> RobotError:
        reason = self._memory.failure or f"ended, with status {self._process.exitcode}"
        self._was_told = True
        return RobotError(f"guard: its process has {reason}; the robot has its last command")

    def _check(self) -> None:
        """Raise a RobotError if the process has failed, or has ended by itself."""
        if os.getpid() != self._owner:
            raise RobotError("guard: belongs to the process that made it, of which this is a copy")
        if self._has_closed or (self._memory.doing == MOVING and self._process.is_alive()):
            return
        self._process.join()
        raise self._failure

    def give(self, target: Array, p_WO: Array) -> None:
        """Write a target, shape (n,) [rad], and places of obstacles, shape (m, 3) [m]."""
        if self._has_closed:
            raise RobotError("guard: it has been closed, and takes no target")
        self._check()
        self._count += 1
        self._memory.target.write(self._count, *target.tolist(), *p_WO.ravel().tolist())

    def command(self) -> Sequence[Any]:
        """Return the fields of the newest command."""
        until = time.monotonic() + _STALLS
        while (fields := self._memory.command.read()) is None:
            # It is being written.
            self._check()
            if time.monotonic() > until:
                raise RobotError("guard: its process stands still while it writes a command")
            time.sleep(1e-5)
        self._check()
        return fields

    def close(self) -> None:
        """See `Guard.close`."""
        if self._has_closed or os.getpid() != self._owner:
            return
        self._memory.request = REST
        has_gone_on = self._wait()
        self._has_closed = True
        self._finalize.detach()
        self._at_exit.cancel()
        if not has_gone_on:
            raise RobotError(
                "guard: its process did not go on and was killed; the robot has its last command"
            )
        if (self._memory.failure or self._process.exitcode) and not self._was_told:
            raise self._failure

    def _wait(self) -> bool:
        """Wait until the process has ended; kill it if it does not go on, and return False then."""
        number, since = 0, time.monotonic()
        while self._process.is_alive():
            self._process.join(0.01)
            fields = self._memory.command.read()
            if fields is not None and fields[0] != number:
                number, since = fields[0], time.monotonic()
            elif time.monotonic() - since > max(_STALLS, 3.0 * self._period):
                self._process.kill()
                self._process.join()
                return False
        return True


_MAIN = (
    "it imports the script that starts it, so what the script runs must stand below "
    '`if __name__ == "__main__":`'
)


def _check_sending(**values: object) -> None:
    """Raise an InvalidInputError unless this process may start one that takes all values."""
    if sys.platform != "linux":
        raise InvalidInputError("process: needs Linux, for the memory that both processes share")
    if current_process().daemon:
        raise InvalidInputError(
            "process: cannot be started by a process that is a daemon of multiprocessing"
        )
    for name, value in values.items():
        try:
            ForkingPickler.dumps(value)
        except Exception as error:
            reason = str(error).partition("\n")[0]
            raise InvalidInputError(
                f"{name}: cannot be sent to the guard's process: {reason}"
            ) from None


def _ask_to_rest(memory: _Memory) -> None:
    memory.request = REST


def _let_go(memory: _Memory, process: BaseProcess, owner: int) -> None:
    """Have a process come to rest and end that nobody has closed; wait for it beside this."""
    if os.getpid() != owner:
        return
    _ask_to_rest(memory)
    threading.Thread(target=process.join, daemon=True).start()


def _serve(task: _Task, file: _File, sizes: tuple[int, int, int], parent: int) -> None:
    """Run a guard for another process, until it is asked to end or that has ended."""
    memory = _Memory(file.descriptor, sizes)
    os.close(file.descriptor)

    def end(number: int, frame: object) -> None:
        memory.request = REST

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        guard = task.guard()
        if prioritize(LAW_BESIDE) is None:
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, 1)
        with without_collection():
            _Loop(guard, memory, sizes, task.send, parent).run()
    except BaseException as error:
        place = extract_tb(error.__traceback__)[-1]
        line = f"{os.path.basename(place.filename)} line {place.lineno}"
        memory.failure = f"failed with {type(error).__name__}: {error} ({line})"
    memory.doing = ENDED


class _Loop:
    """The loop of a guard's process.

    Args:
        guard: The guard.
        memory: What it shares.
        sizes: See `_Memory`.
        send: What is called with each command; None for nothing.
        parent: Number of the process that has started this one.
    """

    def __init__(
        self,
        guard: StreamGuard,
        memory: _Memory,
        sizes: tuple[int, int, int],
        send: Callable[[GuardCommand], object] | None,
        parent: int,
    ) -> None:
        self._guard, self._memory, self._send, self._parent = guard, memory, send, parent
        self._joints, self._moving, _ = sizes
        self._number = self._seen = 0
        self._not_measured = np.full((self._moving, 3), nan) if self._moving else None

    def run(self) -> None:
        """Give a command each period, until the arm rests and is to."""
        guard, memory = self._guard, self._memory
        due = time.monotonic()
        while True:
            now = time.monotonic()
            is_last = memory.request == REST or os.getppid() != self._parent
            rests = np.abs(guard.velocity).max() <= _REST
            self._command(now, is_last)
            memory.doing = MOVING
            # Still before and after: it does not accelerate either.
            if is_last and rests and np.abs(guard.velocity).max() <= _REST:
                return
            # After a call that came too late the period begins anew.
            due = (now if now - due > guard.tolerance else due) + guard.period
            now = time.monotonic()
            time.sleep(max(due - now, _LEAST_SLEEP * guard.period))

    def _command(self, now: float, is_last: bool) -> None:
        """Give a command; one of the last ones has the arm come to rest."""
        guard = self._guard
        target, places = self._newest()
        if is_last:
            target = None
            guard.rest()
        guard.command(target, places, now)
        self._number += 1
        state, late_stops = guard.state.tolist(), guard.late_stops
        self._memory.command.write(self._number, now, late_stops, *state)
        if self._send is not None:
            age = guard.part("since").item()
            self._send(GuardCommand(self._number, now, guard.position, guard.velocity, age))

    def _newest(self) -> tuple[Array | None, Array | None]:
        """Return a target and places of obstacles that are new; NaN for what is not."""
        fields = self._memory.target.read()
        if fields is None or fields[0] == self._seen:
            return None, self._not_measured
        self._seen, numbers = fields[0], np.array(fields[1:])
        places = numbers[self._joints :].reshape(-1, 3)
        return numbers[: self._joints], places if self._moving else None
