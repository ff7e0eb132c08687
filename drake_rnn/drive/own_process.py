"""A process of its own that gives a command every period, whatever becomes of its source.

The source of targets may stall, send what is no target, or end. Both processes share a memory of
`drake_rnn.drive.shared_cycles`. The source writes there what is wanted; the process writes the
newest command. What is commanded, and how it is written, is up to a `Commander`.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from multiprocessing import current_process, get_context
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd, ForkingPickler
from multiprocessing.util import Finalize
from traceback import extract_tb
from types import TracebackType
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np

from ..errors import InvalidInputError, RobotError
from ..inputs.fields import Array
from ..inputs.messages import short
from ..inputs.processes import deaf_children
from ..laws.guard import Late, StreamGuard, checked_late
from ..laws.guard_command import SAME
from ..laws.guard_command import GuardCommand as GuardCommand
from .call_times import CallTimes
from .command_memory import CommandMemory
from .shared_cycles import (
    ENDED,
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
_STARTS, _STALLS = 300.0, 5.0
# Speeds and accelerations over a period below which the arm rests [rad/s].
_REST = 1e-9
#: Share of a period that a command of a process takes until it is written, if it is to be in time.
CALL_TIME = 0.25
# Calls whose least time is expected of the next one, and by how much longer that may take.
_CALLS, _MARGIN = 4, 1.25
# Share of a period that the process sleeps at least, so that others may run.
_LEAST_SLEEP = 0.05
# Of Linux: the call that has this thread woken up on time.
_SET_TIMER_SLACK = 29


#: What is called in the process with each command.
Send = Callable[[GuardCommand], object]


M = TypeVar("M", bound=CommandMemory)
T = TypeVar("T")


class Commander(Protocol):
    """What gives the commands in the process."""

    period: float
    tolerance: float

    @property
    def times(self) -> CallTimes:
        """How long calls take, with what is done besides."""

    @property
    def velocity(self) -> Array:
        """Velocities commanded last, shape (n,) [rad/s]."""

    def next_call(self, now: float) -> float:
        """Return when to call next, where the arm goes on along its stop without a command [s].

        Args:
            now: Not before that time.
        """

    def give(self, now: float, *, is_last: bool) -> GuardCommand | None:
        """Make a command and write it into the memory.

        Args:
            now: Time of the call [s].
            is_last: Whether the arm is to come to rest whatever is wanted.

        Returns:
            The command; None of one that came too late, and was withdrawn.
        """

    def prepare(self, now: float) -> None:
        """Do what can wait until a command was sent.

        Args:
            now: Time of the call of `give` [s].
        """


class Task(Protocol[M]):
    """What a process is to do; it is sent there.

    Attributes:
        owner: What it is called in messages.
    """

    owner: ClassVar[str]

    @property
    def send(self) -> Send | None:
        """What is called with each command; None for nothing."""

    @property
    def period(self) -> float:
        """Time between two commands [s]."""

    @property
    def size(self) -> int:
        """Bytes of the memory."""

    def parts(self) -> dict[str, object]:
        """Return what has to be sent, by the names of the arguments that it comes from."""

    def memory(self, file: int) -> M:
        """Return the memory of a file descriptor."""

    def commander(self, memory: M) -> Commander:
        """Return what gives the commands."""


class CommandWriter:
    """Writes the commands of a guard into a memory, and takes back those that are too late.

    How long calls take decides for when their commands are made: a process that is too slow for
    the next period goes on with those after it.

    Args:
        memory: Where commands are written.
        guard: The guard.

    Attributes:
        withdrawn: How many commands were too late.
    """

    def __init__(self, memory: CommandMemory, guard: StreamGuard) -> None:
        self._memory, self._guard, self.withdrawn = memory, guard, 0
        memory.goes_on = guard.late == "stop"
        # Of the last calls, the least of which is not one in which the process stood still.
        self._took = deque([0.0] * _CALLS, maxlen=_CALLS)
        self._expect()

    def _expect(self) -> None:
        """Have the guard expect that a call takes as long as the last ones did."""
        h, took = self._guard.period, min(self._took)
        expected = max(CALL_TIME * h, _MARGIN * took)
        if took < h or self._guard.moving:
            # What is measured must not be older than the law knows.
            expected = min(expected, h)
        self._guard.call_time = expected

    def stand(self, now: float, target_age: float) -> GuardCommand:
        """Write a command to stand, before there is a first one.

        Args:
            now: Time of the call [s].
            target_age: Time since the last target [s].
        """
        guard, none = self._guard, np.zeros(self._guard.velocity.size)
        motion = guard.position, none, target_age, guard.period, none, np.full(none.size, inf), None
        command = GuardCommand(0, now + guard.tolerance, *motion)
        self._memory.give(command)
        return command

    def write(self, began: float, target_age: float | None = None) -> GuardCommand | None:
        """Write the newest command; withdraw it, and return None, if it is too late.

        Args:
            began: When its call began [s].
            target_age: Of the command, if that is not of the guard's target [s].
        """
        memory, guard = self._memory, self._guard
        command = guard.newest
        if target_age is not None:
            command = command._replace(target_age=target_age)
        if guard.late == "hold":
            memory.give(command)
            return command
        # Before that time nobody has looked for it.
        last_moment = command.time - 2.0 * SAME * command.period
        is_seen = time.monotonic() < last_moment
        if is_seen:
            memory.give(command)
        now = time.monotonic()
        self._took.append(now - began)
        self._expect()
        if is_seen and (now < last_moment or not memory.withdraw(command)):
            return command
        self.withdrawn += 1
        guard.withdraw(unseen=not is_seen)
        if memory.newest(now) is None:
            self.stand(now, command.target_age)
        return None


def checked_timing(
    late: object, tolerance: float | None, period: float, process: object
) -> tuple[Late, float | None]:
    """Return what a robot does that gets no command in time, and by how much one may be late [s].

    By default a robot goes on along the certified stop where others read the commands of a process,
    and holds the last command where it gets them by calls: nobody is known there to do otherwise.

    Args:
        late: What is given; None for nothing.
        tolerance: Likewise; commands of a process are made a period before they hold.
        period: Time between two commands [s].
        process: What is given as ``process``.
    """
    checked = checked_late(("stop" if process is True else "hold") if late is None else late)
    if tolerance is None and process and checked == "stop":
        tolerance = period
    return checked, tolerance


def check_process(process: object) -> Send | None:
    """Return what is to be called with each command, of an argument ``process``.

    Raises:
        InvalidInputError: If it is neither a truth value nor a function.
    """
    if isinstance(process, bool):
        return None
    if not callable(process):
        raise InvalidInputError(f"process: must be True, False or a function, not {short(process)}")
    return process


@dataclass(frozen=True)
class _File:
    """A descriptor of a file that a process gets as it is started."""

    descriptor: int

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _received, (DupFd(self.descriptor),)


def _received(copy: Any) -> _File:
    return _File(copy.detach())


class OwnProcess(Generic[M]):
    """The process, as the one that has started it sees it.

    Args:
        task: What it is to do.

    Attributes:
        memory: What both processes share.
        lock: Held by the thread that writes what is wanted.

    Raises:
        InvalidInputError: If there can be none, or an argument cannot be sent there.
        RobotError: If it does not come up.
    """

    def __init__(self, task: Task[M]) -> None:
        _check_sending(task)
        file = anonymous_file(task.size)
        self._name, self._period = task.owner, task.period
        self.memory = task.memory(file)
        self._was_told, self._has_closed, self._owner = False, False, os.getpid()
        self.lock = threading.Lock()
        context = get_context("spawn")
        self._process = context.Process(
            target=_serve, args=(task, _File(file), os.getpid()), name=task.owner
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
        self._finalize = weakref.finalize(self, _let_go, self.memory, self._process, self._owner)
        self._finalize.atexit = False
        self._at_exit = Finalize(None, _ask_to_rest, (self.memory,), exitpriority=0)
        until = time.monotonic() + _STARTS
        while self.memory.doing == STARTING and self._process.is_alive():
            if time.monotonic() > until:
                self._process.kill()
            time.sleep(0.002)
        if self.memory.doing == STARTING:
            self._process.join()
            self._has_closed = True
            status = self._process.exitcode
            why = f"its process has ended as it started, with status {status}; {_MAIN}"
            if time.monotonic() > until:
                why = f"its process has not come up within {_STARTS:g} s, and was killed"
            raise RobotError(f"{self._name}: {why}")
        if self.memory.failure:
            self._process.join()
            raise self._failure

    @property
    def _failure(self) -> RobotError:
        reason = self.memory.failure or f"ended, with status {self._process.exitcode}"
        self._was_told = True
        return RobotError(f"{self._name}: its process has {reason}; the robot has its last command")

    def _check(self) -> None:
        """Raise a RobotError if the process has failed, or has ended by itself."""
        if os.getpid() != self._owner:
            raise RobotError(
                f"{self._name}: belongs to the process that made it, of which this is a copy"
            )
        if self._has_closed or (self.memory.doing == MOVING and self._process.is_alive()):
            return
        self._process.join()
        raise self._failure

    def check_open(self) -> None:
        """Raise a RobotError unless what is wanted can be written."""
        if self._has_closed:
            raise RobotError(f"{self._name}: it has been closed, and takes no target")
        self._check()

    @property
    def path(self) -> str:
        """Where other programs find the memory, as long as the process runs."""
        return f"/proc/{self._process.pid}/fd/{self.memory.descriptor}"

    def latest(self) -> GuardCommand:
        """Return what is commanded now; after the process has ended, the last command."""
        now = time.monotonic()
        command = self.whole(lambda: self.memory.newest(now))
        return command.at(now) if self.memory.goes_on else command

    def read(self, slot: SharedSlot) -> Sequence[Any]:
        """Return the fields of a record that the process writes with each command."""
        return self.whole(slot.read)

    def whole(self, read: Callable[[], T | None]) -> T:
        """Return what is read once it is there, whole.

        Raises:
            RobotError: If the process has failed, or does not go on.
        """
        until = time.monotonic() + _STALLS
        while (fields := read()) is None:
            # It is being written.
            self._check()
            if time.monotonic() > until:
                raise RobotError(f"{self._name}: its process stands still")
            time.sleep(1e-5)
        self._check()
        return fields

    def close(self) -> None:
        """Have the arm come to rest, and end the process.

        Raises:
            RobotError: If it has failed and nobody was told so, or had to be killed.
        """
        if self._has_closed or os.getpid() != self._owner:
            return
        self.memory.request = REST
        has_gone_on = self._wait()
        self._has_closed = True
        self._finalize.detach()
        self._at_exit.cancel()
        if not has_gone_on:
            raise RobotError(
                f"{self._name}: its process did not go on and was killed; the robot has its "
                "last command"
            )
        if (self.memory.failure or self._process.exitcode) and not self._was_told:
            raise self._failure

    def _wait(self) -> bool:
        """Wait until the process has ended; kill it if it does not go on, and return False then."""
        number, since = 0, time.monotonic()
        while self._process.is_alive():
            self._process.join(0.01)
            command = self.memory.newest(inf)
            if command is not None and command.number != number:
                number, since = command.number, time.monotonic()
            elif time.monotonic() - since > max(_STALLS, 3.0 * self._period):
                self._process.kill()
                self._process.join()
                return False
        return True


_MAIN = (
    "it imports the script that starts it, so what the script runs must stand below "
    '`if __name__ == "__main__":`'
)


class InOwnProcess(Generic[M]):
    """What may run in a process of its own, and how that is ended."""

    _process: OwnProcess[M] | None

    def close(self) -> None:
        """Have the arm come to rest, and end the process, if there is one of its own.

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

    def _own_process(self, what: str) -> OwnProcess[M]:
        if self._process is None:
            name = type(self).__name__.lower()
            raise InvalidInputError(f"{what}: is for a {name} that was made with process=True")
        return self._process


def _check_sending(task: Task[Any]) -> None:
    """Raise an InvalidInputError unless this process may start one that takes a task."""
    if sys.platform != "linux":
        raise InvalidInputError("process: needs Linux, for the memory that both processes share")
    if current_process().daemon:
        raise InvalidInputError(
            "process: cannot be started by a process that is a daemon of multiprocessing"
        )
    for name, value in task.parts().items():
        try:
            ForkingPickler.dumps(value)
        except Exception as error:
            reason = str(error).partition("\n")[0]
            raise InvalidInputError(
                f"{name}: cannot be sent to the {task.owner}'s process: {reason}"
            ) from None


def _ask_to_rest(memory: SharedMemory) -> None:
    memory.request = REST


def _let_go(memory: SharedMemory, process: BaseProcess, owner: int) -> None:
    """Have a process come to rest and end that nobody has closed; wait for it beside this."""
    if os.getpid() != owner:
        return
    _ask_to_rest(memory)
    threading.Thread(target=process.join, daemon=True).start()


def _serve(task: Task[Any], file: _File, parent: int) -> None:
    """Give commands for another process, until it is asked to end or that has ended."""
    memory = task.memory(file.descriptor)
    # It stays open: others find the memory by it.
    memory.descriptor = file.descriptor

    def end(number: int, frame: object) -> None:
        memory.request = REST

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        commander = task.commander(memory)
        if prioritize(LAW_BESIDE) is None:
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, 1)
        with without_collection():
            _Loop(commander, memory, task.send, parent).run()
    except BaseException as error:
        place = extract_tb(error.__traceback__)[-1]
        line = f"{os.path.basename(place.filename)} line {place.lineno}"
        memory.failure = f"failed with {type(error).__name__}: {error} ({line})"
    memory.doing = ENDED


class _Loop:
    """The loop of the process.

    Args:
        commander: What gives the commands.
        memory: What both processes share.
        send: What is called with each command; None for nothing.
        parent: Number of the process that has started this one.
    """

    def __init__(
        self, commander: Commander, memory: CommandMemory, send: Send | None, parent: int
    ) -> None:
        self._commander, self._memory, self._send = commander, memory, send
        self._parent = parent

    def run(self) -> None:
        """Give a command each period, until the arm rests and is to."""
        commander, memory = self._commander, self._memory
        due = time.monotonic()
        while True:
            now, begin = time.monotonic(), time.perf_counter()
            is_alone = os.getppid() != self._parent
            is_last = memory.request == REST or is_alone
            rests = is_last and self._rests()
            command = commander.give(now, is_last=is_last)
            if self._send is not None and command is not None:
                self._send(command)
            memory.doing = MOVING
            commander.prepare(now)
            commander.times.note(begin, now, is_real=True, is_late=command is None)
            # Still before and after: it does not accelerate either.
            if rests and self._rests():
                if is_alone:
                    memory.failure = "come to rest, as the one that started it has ended"
                return
            least = _LEAST_SLEEP * commander.period
            if memory.goes_on:
                due = commander.next_call(time.monotonic() + least)
            else:
                # After a call that came too late the period begins anew.
                due = (now if now - due > commander.tolerance else due) + commander.period
            time.sleep(max(due - time.monotonic(), least))

    def _rests(self) -> bool:
        """Return whether the arm rests, by its last command or at the end of its stop."""
        v, now = self._commander.velocity, time.monotonic()
        if self._memory.goes_on and (command := self._memory.newest(now)) is not None:
            v = command.at(now).velocity
        return bool(np.abs(v).max() <= _REST)
