"""Commands of a process in a memory that it shares, each with the certified stop that follows it.

The process makes a command before it holds, and tells when that is. Who drives the robot by them
takes at each of its own times the command that holds then. Where there is none, the process being
late, it goes on along the stop of the last one, a sample each period. The process, once it goes on,
knows from the time alone how far along its stop the arm is by then, and commands what follows.

A command that is written so late that the driver may have looked already is one that both must
agree on. A driver writes the time before it looks at the commands, and afterwards which of them it
follows; the process reads that if its own clock shows, after it has written a command, that this
may have been too late. And a command says which one it goes on from: a driver that follows another
one never takes it.
"""

from __future__ import annotations

import os
import time
from ctypes import c_double
from math import inf, isinf, ulp
from struct import Struct

import numpy as np

from ..errors import InvalidInputError, RobotError
from ..inputs.fields import Array
from ..inputs.messages import is_number, short
from ..laws.guard_command import SAME, GuardCommand
from .shared_cycles import HEADER, SharedMemory, SharedSlot, write_word

#: Version of the layout, and commands that are kept.
VERSION, COMMANDS = 2, 1024
#: Where a header says the version, joints, targets of a chunk, and obstacles that may move.
ABOUT = 32
_SIZES = Struct("=4Q")
# Cells of the driver: number of the newest command; whether it goes on along stops; when it looked
# last, what it follows since, and that it has looked then.
_NEWEST, _STOPS, _LOOKS, _FOLLOWS, _LOOKED, _DRIVER = 0, 8, 16, 24, 32, 40
# Times that differ by fewer units of their last digit are one, but for their rounding.
_ROUNDED = 8.0
# Time for which the process waits for a driver that has begun to look [s].
_LOOKING = 5.0


class CommandMemory(SharedMemory):
    """A memory with the last commands, and what the driver says of them.

    Args:
        file: File descriptor of the memory.
        size: Its size in bytes.
        joints: Joints of the arm.
        rows: Targets that a chunk may have, if there are chunks.
        obstacles: Obstacles that may move.

    Attributes:
        end: Where other records may begin.
    """

    def __init__(
        self, file: int, size: int, joints: int, *, rows: int = 0, obstacles: int = 0
    ) -> None:
        super().__init__(file, size)
        sizes = VERSION, joints, rows, obstacles
        if _SIZES.unpack_from(self._memory, ABOUT) != sizes:
            _SIZES.pack_into(self._memory, ABOUT, *sizes)
        text, at = self.command_fields(joints), HEADER
        self._commands = []
        for _ in range(COMMANDS):
            self._commands.append(SharedSlot(self._memory, at, text))
            at += self._commands[-1].size
        self._driver, self.end = at, at + _DRIVER

    @staticmethod
    def command_fields(joints: int) -> str:
        """Return the fields of a command in the format of `struct`.

        They are its number, that of the one it goes on from, when it begins to hold, its period,
        the time since a target, and positions, velocities, accelerations, and largest accelerations
        and jerks, infinite without a bound.
        """
        return f"QQ{3 + 5 * joints}d"

    @classmethod
    def command_bytes(cls, joints: int) -> int:
        """Return the bytes of all commands, and of what the driver says."""
        return COMMANDS * Struct(f"=Q{cls.command_fields(joints)}Q").size + _DRIVER

    @property
    def goes_on(self) -> bool:
        """Whether who gets no command in time goes on along the stop of the last one."""
        return bool(self._word(self._driver + _STOPS))

    @goes_on.setter
    def goes_on(self, value: bool) -> None:
        write_word(self._memory, self._driver + _STOPS, int(value))

    def give(self, command: GuardCommand, begins: float | None = None) -> None:
        """Write a command.

        Args:
            command: The command.
            begins: When it begins to hold [s], if that is not its time: never, if it is withdrawn.
        """
        number, t, q, v, age, period, a, most, jerk, after, _ = command
        bound = np.full(q.size, inf) if jerk is None else jerk
        numbers = np.concatenate((q, v, a, most, bound)).tolist()
        head = t if begins is None else begins, period, age
        self._commands[number % COMMANDS].write(number, after, *head, *numbers)
        write_word(self._memory, self._driver + _NEWEST, number)

    def command(self, number: int) -> GuardCommand | None:
        """Return what stands where a command does: it, an older or a newer one; None if nothing."""
        fields = self._commands[number % COMMANDS].read()
        if fields is None:
            return None
        found, after, t, period, age, *numbers = fields
        q, v, a, most, jerk = np.array(numbers).reshape(5, -1)
        bound = None if isinf(jerk.max()) else jerk
        return GuardCommand(found, t, q, v, age, period, a, most, bound, after)

    def newest(self, t: float) -> GuardCommand | None:
        """Return the last command that holds at a time, or the first one after; None without one.

        Args:
            t: The time [s]; does not count where commands are held.
        """
        newest, later = self._word(self._driver + _NEWEST), None
        for number in range(newest, max(newest - COMMANDS, -1), -1):
            command = self.command(number)
            if command is None or command.number != number:
                break
            if isinf(command.time):
                continue
            if not self.goes_on or command.time <= t + SAME * command.period:
                return command
            later = command
        return later

    def withdraw(self, command: GuardCommand) -> bool:
        """Withdraw a command that may have come too late, unless the driver follows it.

        Args:
            command: The command, which was written last.

        Returns:
            Whether it is withdrawn.
        """
        looks, t = self._number(_LOOKS), command.time - SAME * command.period
        if looks >= t:
            self._wait_for_driver(t)
        if looks != 0.0 and (looks < t or self._followed >= command.number):
            # It will be there when the driver looks, or was there.
            return False
        self.give(command, begins=inf)
        if looks == 0.0 and self._number(_LOOKS) != 0.0:
            # A driver has come meanwhile.
            self._wait_for_driver(t)
            if self._followed == command.number:
                self.give(command)
                return False
        return True

    def _wait_for_driver(self, t: float) -> None:
        """Wait until a driver that has begun to look says what it follows at a time [s]."""
        until = time.monotonic() + _LOOKING
        while self._number(_LOOKED) < t and time.monotonic() < until:
            time.sleep(1e-5)

    @property
    def _followed(self) -> int:
        """Number of the command that the driver follows."""
        return self._word(self._driver + _FOLLOWS)

    def look(self, t: float) -> None:
        """Say that the driver looks now at what holds at a time [s]."""
        self._set_number(_LOOKS, t)

    def follow(self, number: int, t: float) -> None:
        """Say which command the driver follows, from a time on [s]."""
        write_word(self._memory, self._driver + _FOLLOWS, number)
        self._set_number(_LOOKED, t)

    def _number(self, at: int) -> float:
        return c_double.from_buffer(self._memory, self._driver + at).value

    def _set_number(self, at: int, value: float) -> None:
        c_double.from_buffer(self._memory, self._driver + at).value = value


class CommandReader:
    """What a program that drives a robot reads the commands of a guard's or shield's process with.

    One reader drives the robot: the process goes by what it says. Others look with ``latest``. In
    C, `examples/shield_memory.h` does the same.

    Args:
        path: File of the memory, `Shield.path` or `Guard.path`.

    Raises:
        InvalidInputError: If the file is no such memory.
    """

    def __init__(self, path: str) -> None:
        self._memory = _memory_of(path)
        self._followed: GuardCommand | None = None
        self._looked = -inf
        # Share of the period at which it has looked.
        self._share = 0.0

    def at(self, t: float | None = None) -> GuardCommand:
        """Return what is commanded at a time: a command, or a sample of the stop after it.

        `position_at` says where the arm is to be.

        Args:
            t: Time on the clock of `time.monotonic` [s], not after now, and no earlier one than the
                last; by default now. Give times of a regular clock: see
                `GuardCommand.position_at`.

        Raises:
            InvalidInputError: If the time is no number, after now or before the last one.
            RobotError: If there is no command at all; or commands are lost that it would have
                followed, as it has not looked for so long, or the process has taken one back that
                it follows, as it stood still for seconds while it looked.
        """
        t = self._checked_time(t)
        self._memory.look(t)
        followed = self._memory.newest(t) if self._followed is None else self._next(t)
        if followed is None:
            raise RobotError("commands: there is none that is whole")
        self._followed, self._looked = followed, t
        self._memory.follow(followed.number, t)
        return followed.at(t) if self._memory.goes_on else followed

    def _checked_time(self, t: float | None) -> float:
        """Return a time at which it looks [s], by default now."""
        now = time.monotonic()
        if t is None:
            return now
        if not is_number(t):
            raise InvalidInputError(f"t: must be a time [s], not {short(t)}")
        # What begins to hold until then may still come, and would be followed by nobody.
        if t > now:
            raise InvalidInputError(
                f"t: is {t - now:.3g} s after now; must be on the clock of time.monotonic, and not "
                "after what that shows. Commands for then may still come"
            )
        if t < self._looked:
            raise InvalidInputError(
                f"t: is {self._looked - t:.3g} s before the time of the last look, "
                f"{self._looked:.9g} s; must not go back"
            )
        return float(t)

    def position_at(self, t: float | None = None) -> Array:
        """Return where the joints are to be at a time, shape (n,) [rad]; send it to the robot.

        It is what `at` and `GuardCommand.position_at` tell. But times of a regular clock that
        differ by their rounding alone, which are days, are the same within a period.

        Args:
            t: See `at`.

        Raises:
            InvalidInputError, RobotError: As `at` does.
        """
        t = self._checked_time(t)
        command = self.at(t)
        share = command.share_at(t)
        off = (share - self._share) - round(share - self._share)
        if abs(off) * command.period <= _ROUNDED * ulp(t):
            share = min(max(share - off, 0.0), 1.0)
        self._share = share
        return command.reached(share)

    def _next(self, t: float) -> GuardCommand | None:
        """Return the command that is followed at a time [s]."""
        followed, memory = self._followed, self._memory
        assert followed is not None
        number = followed.number + 1
        while (command := memory.command(number)) is not None and command.number >= number:
            if command.number > number:
                raise self._lost(
                    f"more than the {COMMANDS} that are kept have come since: times are asked for "
                    "too seldom, or fall behind time.monotonic()"
                )
            number += 1
            slack = SAME * command.period
            if isinf(command.time):
                continue
            if command.time > t + slack:
                break
            is_in_time = command.time > self._looked + slack or not memory.goes_on
            if command.after < followed.number:
                raise self._lost("the process has taken it back since, as nobody looked for long")
            if command.after == followed.number and is_in_time:
                followed = command
        return followed

    def _lost(self, why: str) -> RobotError:
        """Return the error of a reader that does not know how the arm goes on."""
        assert self._followed is not None
        return RobotError(
            f"commands: number {self._followed.number} was followed last, {self._looked:.3f} s, "
            f"and {why}; how the arm goes on is not known. Have it stop, and begin with another "
            "reader"
        )


def _memory_of(path: str) -> CommandMemory:
    """Return the memory of a file, for whoever drives the robot."""
    try:
        file = os.open(path, os.O_RDWR)
    except (OSError, TypeError, ValueError) as error:
        raise InvalidInputError(f"path: {short(path)} cannot be opened: {error}") from None
    try:
        size = os.fstat(file).st_size
        head = os.pread(file, _SIZES.size, ABOUT)
        version, joints, rows, obstacles = _SIZES.unpack(head) if size >= HEADER else (0,) * 4
        if version != VERSION or CommandMemory.command_bytes(joints) + HEADER > size:
            raise InvalidInputError(
                f"path: {short(path)} is no memory of version {VERSION} of a guard or a shield; "
                "must be what the property path of one with process=True says"
            )
        return CommandMemory(file, size, joints, rows=rows, obstacles=obstacles)
    finally:
        os.close(file)
