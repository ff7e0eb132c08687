"""Experiments and diagrams that a robot carries out.

- The address of each robot, and the connection to it.
- A connection whose robot is answered by a pacer, in a process of its own beside this one.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from math import isnan, nan
from pathlib import Path
from select import POLLIN, poll
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInputError, RobotError
from ..experiment import Experiment
from ..inputs.fields import Array, checked, flag, function, instance, offering, optional
from ..inputs.packages import not_installed
from ..laws.law import Signals
from ..robot.limits import JointLimits
from ..runs.folder import Status as RunStatus
from ..runs.result import Result
from .approach import (
    DrivenLaw,
    RobotTask,
)
from .iiwa_lcm import WITHIN, IiwaLcm, address_fault, open_lcm
from .law_in_c import LawInC
from .pacer import STATES, LawMemory
from .robots import (
    FR3,
    IIWA,
    Command,
    Connection,
    DriveSettings,
    LawCourse,
    LawSample,
    Motion,
    Robot,
    RobotStatus,
)
from .session import DriveOutcome, Say, Session
from .shared_cycles import (
    END,
    ENDED,
    LAW,
    LAW_BESIDE,
    MOVE,
    MOVING,
    NOBODY,
    RECORD,
    REST,
    RUN,
    STARTING,
    STOP,
    CycleRecord,
    LawCommand,
    Schedule,
    SharedCycles,
    anonymous_file,
    prioritize,
    restore,
)

#: Class of the robot by the manufacturer's bindings, as a pacer is told it.
FRANKA = "drake_rnn.drive.franka:Franka"
# Times that a pacer has to come up and to end [s].
_STARTS, _ENDS = 15.0, 5.0
# Statuses that are looked at of those that have come together; more is a stall, which stops anyway.
_MOST_MISSES = 100
# Names of the numbers of a cycle, in their order.
_NUMBERS = (
    "position_measured",
    "velocity_measured",
    "position_held",
    "position_commanded",
    "velocity_commanded",
    "acceleration_commanded",
)


class PacedConnection(Connection):
    """A connection to an FR3.

    Args:
        address: Name or IP address of the robot.
        robot: Class of the robot, see `drake_rnn.drive.pacer.PacedRobot`, as ``module:name``.
        record: File that the pacer writes all cycles to if this process is killed, see
            `read_record`.

    Raises:
        RobotError: If the robot is not reached.
    """

    paced = True

    def __init__(self, address: str, robot: str = FRANKA, record: Path | None = None) -> None:
        file, self._event = anonymous_file(), os.eventfd(0, os.EFD_NONBLOCK)
        # Empty until a law is taken over.
        self._law_file = os.memfd_create("law")
        self._shared = SharedCycles(file)
        self._poll = poll()
        self._poll.register(self._event, POLLIN)
        line = [sys.executable, "-m", "drake_rnn.drive.pacer", robot, address]
        options = [] if record is None else ["--record", str(record)]
        # A Ctrl-C is for this process, which has the robot brought to rest first.
        self._process = subprocess.Popen(
            [*line, str(file), str(self._event), str(self._law_file), *options],
            stdin=subprocess.PIPE,
            pass_fds=(file, self._event, self._law_file),
            start_new_session=True,
        )
        os.close(file)
        self._before: Schedule | None = None
        self._read = 0
        self._told: dict[int, Motion] = {}
        self._kept: list[bytes] = []
        self._law: LawMemory | None = None
        self._origin, self._until = nan, 2**62
        # States of the law, the numbers of their samples, and the cycles in which they came.
        self._states: list[tuple[int, int, tuple[float, ...]]] = []
        try:
            self._await(lambda: self._shared.doing != STARTING)
        except RobotError:
            self.end()
            raise

    def _await(self, is_done: Callable[[], bool]) -> None:
        """Wait until the pacer has done something; raise a RobotError if it fails."""
        until = self.now() + _STARTS
        while not is_done():
            self._poll.poll(1.0)
            if self.failure:
                raise RobotError(f"robot: {self.failure}")
            if self.now() > until:
                raise RobotError(f"robot: the pacer does not get on within {_STARTS:g} s")
        if self.failure:
            raise RobotError(f"robot: {self.failure}")

    @property
    def period(self) -> float:
        """See `Connection.period`."""
        return FR3.period

    def now(self) -> float:
        """See `Connection.now`."""
        return time.monotonic()

    @property
    def pid(self) -> int:
        """Number of the pacer's process."""
        return self._process.pid

    def next(self, timeout: float) -> RobotStatus | None:
        """See `Connection.next`."""
        until = self.now() + timeout
        while self._shared.count == self._read:
            left = until - self.now()
            if left <= 0.0 or self._shared.doing == ENDED:
                return None
            self._poll.poll(1e3 * left)
            self._take_event()
        begin = self._read
        self._keep()
        newest = _status(self._shared.cycle(self._read - 1))
        # After a stall only the last of them are worth the time.
        numbers = range(max(begin, self._read - _MOST_MISSES), self._read - 1)
        if not numbers:
            return newest
        return replace(newest, earlier=[_status(self._shared.cycle(k)) for k in numbers])

    def _take_event(self) -> None:
        try:
            os.eventfd_read(self._event)
        except BlockingIOError:
            return

    def _keep(self) -> None:
        """Keep all cycles that have come."""
        count, law = self._shared.count, self._law
        self._kept.append(self._shared.raw(self._read, count))
        if law is not None:
            law.look_count = count
            if (first := law.first) is not None:
                cycles = range(max(self._read, first, count - STATES), count)
                self._states += [(cycle, *law.read(cycle)) for cycle in cycles]
        self._read = count

    def send(self, command: Command) -> None:
        """See `Connection.send`; it goes on from the status that was returned last."""
        most = tuple(command.limits.require("acceleration", "coming to rest").tolist())
        jerk = None if command.limits.jerk is None else tuple(command.limits.jerk.tolist())
        options = {}
        for base, motion in enumerate((command.motion, *command.then), self._read - 1):
            if self._told.get(base) is not motion:
                q, v, a = (tuple(part.tolist()) for part in motion)
                self._shared.tell(LawCommand(base, q, v, a, most, jerk))
            options[base] = motion
        self._told = options

    def begin(self) -> None:
        """See `Connection.begin`."""
        self._before = prioritize(LAW_BESIDE)
        self._shared.request = MOVE
        self._await(lambda: self._shared.doing in (MOVING, ENDED))

    def take_law(
        self, law: LawInC, limits: JointLimits, commanded: JointLimits, late: float
    ) -> bool:
        """See `Connection.take_law`."""
        content = law.memory(limits, commanded, round(late / self.period))
        os.ftruncate(self._law_file, len(content))
        os.pwrite(self._law_file, content, 0)
        self._law = LawMemory(self._law_file)
        return True

    def run(self) -> None:
        """See `Connection.run`."""
        assert self._law is not None
        self._law.look_count = self._read
        self._shared.request = RUN

    @property
    def course(self) -> LawCourse:
        """See `Connection.course`."""
        law = self._law
        if law is None or (first := law.first) is None or first >= self._read:
            return LawCourse()
        if isnan(self._origin):
            self._origin = self._shared.cycle(first).time
        over = law.over
        return LawCourse(self._origin, over is not None and over < self._read, law.why)

    def samples(self) -> list[LawSample]:
        """See `Connection.samples`."""
        every = self.cycles()
        names = ("position_commanded", "velocity_commanded", "acceleration_commanded")
        rows = np.searchsorted(every["number"], [cycle for cycle, _, _ in self._states])
        return [
            LawSample(
                sample * self.period,
                every["position_measured"][k],
                every["velocity_measured"][k],
                Motion(*(every[name][k - 1] for name in names)),
                np.array(state),
            )
            for k, (_, sample, state) in zip(rows, self._states, strict=True)
            if every["source"][k] == LAW
        ]

    def commanded(self) -> Signals | None:
        """See `Connection.commanded`."""
        every = self.cycles()
        names = ("position_commanded", "velocity_commanded", "acceleration_commanded")
        motions, h = [every[name] for name in names], self.period
        reached, times, rows, begin = every["time"] + h, [], [], 0
        for k in (np.flatnonzero(every["passed"][1:] > 1) + 1).tolist():
            times.append(reached[begin:k])
            rows.append(motions[0][begin:k])
            begin, (q, v, a) = k, (motion[k - 1] for motion in motions)
            for lost in range(1, int(every["passed"][k])):
                # It goes on with its acceleration.
                v = v + h * a
                q = q + h * v
                times.append(reached[k - 1 : k] + h * lost)
                rows.append(q[None])
        times.append(reached[begin:])
        rows.append(motions[0][begin:])
        return {"time": np.concatenate(times), "position": np.concatenate(rows)}

    def rest(self) -> None:
        """See `Connection.rest`."""
        self._until = self._shared.count
        self._shared.request = REST

    def end(self) -> None:
        """See `Connection.end`."""
        if self._process.stdin is None or self._process.stdin.closed:
            return
        restore(self._before)
        self._shared.request = END
        try:
            self._process.wait(_ENDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdin.close()
        self._keep()
        os.close(self._event)
        os.close(self._law_file)

    @property
    def failure(self) -> str:
        """See `Connection.failure`."""
        if text := self._shared.failure:
            return text
        status = self._process.poll()
        return "" if not status else f"the pacer has ended, with status {status}"

    @property
    def late(self) -> int:
        """See `Connection.late`."""
        if self._law is None or (first := self._law.first) is None:
            return 0
        every = self.cycles()
        until = self._until if (over := self._law.over) is None else min(over, self._until)
        is_due = (every["number"] >= first) & (every["number"] < until) & (every["passed"] == 1)
        return int((is_due & (every["source"] == STOP)).sum())

    @property
    def lost(self) -> int:
        """See `Connection.lost`."""
        every = self.cycles()
        moved = np.flatnonzero(every["source"] != NOBODY)
        if not moved.size:
            return 0
        return int(np.maximum(every["passed"][moved[0] :].astype(int) - 1, 0).sum())

    def cycles(self) -> dict[str, Array]:
        """Return all cycles, by the names that `read_record` has."""
        return _arrays(b"".join(self._kept))


def read_record(file: Path) -> dict[str, Array]:
    """Return all cycles of a file that a pacer has left, k of them.

    ``number``, ``source`` (0: nobody, 1: the law, 2: the pacer's stop), ``passed`` (cycles of the
    robot's clock), ``time``, ``heard`` and ``answered`` [s] and ``success``, shape (k,); and
    ``position_measured``, ``velocity_measured``, ``position_held``, ``position_commanded``,
    ``velocity_commanded`` and ``acceleration_commanded``, shape (k, 7).
    """
    return _arrays(file.read_bytes())


def _arrays(data: bytes) -> dict[str, Array]:
    times = ("time", "heard", "answered", "success")
    row = np.dtype(
        [(name, "u8") for name in ("number", "source", "passed")]
        + [(name, "f8") for name in times]
        + [(name, "f8", (7,)) for name in _NUMBERS]
    )
    assert row.itemsize == RECORD.size
    table = np.frombuffer(data, dtype=row)
    return {name: np.array(table[name]) for name in row.names or ()}


def _status(cycle: CycleRecord) -> RobotStatus:
    q, v, q_commanded, *commanded = (np.array(cycle.part(k)) for k in range(6))
    return RobotStatus(cycle.time, q, v, q_commanded, Motion(*commanded))


def _silent(text: str) -> None:
    """Say nothing."""


def _never() -> bool:
    """Let a drive come to its end."""
    return False


class DrivenRun(NamedTuple):
    """What came of an experiment that a robot carried out.

    Attributes:
        result: The run until the robot was stopped, with what it has measured and, in the series
            ``position_commanded``, what it was told. Its ``timings`` have the number of cycles in
            all phases, ``cycles``, ``cycles_lost`` and ``cycles_late``, of a paced robot as its
            pacer has counted them, the number of the law's steps that were made in C,
            ``steps_in_c``, and the time that the stop took, ``stop_time_s``, if it came to its end.
        driven: Every cycle.
    """

    result: Result
    driven: DriveOutcome


@checked(
    experiment=instance(Experiment),
    robot=instance(Robot),
    connection=offering("next", "send"),
    settings=instance(DriveSettings, None),
    say=function(),
    is_told_to_stop=function(),
    compiled=optional(flag),
)
def drive_experiment(
    experiment: Experiment,
    robot: Robot,
    connection: Connection,
    settings: DriveSettings | None = None,
    *,
    say: Say = _silent,
    is_told_to_stop: Callable[[], bool] = _never,
    compiled: bool | None = None,
) -> DrivenRun:
    """Let a robot carry out an experiment.

    Args:
        experiment: An experiment of `driven_experiment`.
        robot: The robot.
        connection: Connection to it.
        settings: What is tolerated.
        say: Told what happens, in sentences.
        is_told_to_stop: Whether somebody wants it to end; asked in every cycle.
        compiled: Whether the steps of the law are compiled to C; by default where they can be.

    Raises:
        InvalidInputError: If the path is out of reach, the law fails when it is tried or cannot be
            compiled, or the robot stands where no way to the start begins.
        RobotError: If nothing answers, or the robot is not ready. Nothing was sent then.
    """
    law = task_of(experiment, compiled, paced=connection.paced)
    outcome = drive_diagram(
        law, robot, connection, settings, say=say, is_told_to_stop=is_told_to_stop
    )
    return DrivenRun(result_of(law, outcome), outcome)


@checked(experiment=instance(Experiment), compiled=optional(flag), paced=flag)
def task_of(
    experiment: Experiment, compiled: bool | None = None, *, paced: bool = False
) -> DrivenLaw:
    """Return an experiment of `driven_experiment` as a robot's task.

    Args:
        experiment: The experiment.
        compiled: Whether the steps of its law are compiled to C; by default where they can be.
        paced: Whether the robot's connection is paced, see `Connection`, and makes them then.

    Raises:
        InvalidInputError: If the path is out of reach, or the law fails when it is tried or cannot
            be compiled.
    """
    if experiment.document.level != "robot" or experiment.document.period is None:
        raise InvalidInputError(
            "experiment: must be one of driven_experiment, at level: robot and with a period"
        )
    return DrivenLaw(experiment, compiled, paced=paced)


def result_of(law: DrivenLaw, outcome: DriveOutcome) -> Result:
    """Return what `DrivenRun.result` is, of a task that a robot has carried out."""
    law.follow(outcome.samples)
    run = outcome.log.of("run")
    is_heard = np.isfinite(run["position_measured"]).all(axis=1)
    is_heard &= np.isfinite(run["velocity_measured"]).all(axis=1)
    columns = {
        "time": run["time"][is_heard] - outcome.origin,
        "position": run["position_measured"][is_heard],
        "velocity": run["velocity_measured"][is_heard],
    }
    status: RunStatus = "complete"
    failure = ""
    if (why := outcome.stopped) is not None:
        status = "interrupted" if why.watch == "interrupted" else "failed"
        failure = f"{why} (at t = {law.time:.6g} s)"
    commanded = outcome.commanded
    if commanded is not None:
        commanded = {**commanded, "time": commanded["time"] - outcome.origin}
    result = law.result(columns, status, failure, commanded)
    result.timings.update(
        cycles=len(outcome.log.times),
        cycles_lost=outcome.lost,
        cycles_late=outcome.late,
        steps_in_c=law.steps_in_c,
    )
    if np.isfinite(outcome.rested):
        result.timings["stop_time_s"] = outcome.rested
    return result


@checked(
    task=instance(RobotTask),
    robot=instance(Robot),
    connection=offering("next", "send"),
    settings=instance(DriveSettings, None),
    say=function(),
    is_told_to_stop=function(),
)
def drive_diagram(
    task: RobotTask,
    robot: Robot,
    connection: Connection,
    settings: DriveSettings | None = None,
    *,
    say: Say = _silent,
    is_told_to_stop: Callable[[], bool] = _never,
) -> DriveOutcome:
    """Let a robot do what a diagram with a `RobotArm` commands.

    Args:
        task: The diagram.
        robot: The robot.
        connection: Connection to it.
        settings: What is tolerated.
        say: Told what happens, in sentences.
        is_told_to_stop: Whether somebody wants it to end; asked in every cycle.

    Raises:
        InvalidInputError, RobotError: As `drive_experiment` does.
    """
    settings = DriveSettings() if settings is None else settings
    if connection.paced and not task.resumes:
        raise InvalidInputError(
            f"task: the {robot.name} does not wait for a diagram; it is driven by experiments alone"
        )
    return Session(task, robot, connection, settings, say, is_told_to_stop).drive()


# Name or IP address of a machine, without a port.
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?")


def address_of(robot: Robot, url: str | None) -> str:
    """Return the address of a robot.

    Args:
        robot: The robot.
        url: What was given as its address; None for the robot's own, if it has one.

    Raises:
        RobotError: If the address is missing, or no address of this robot.
    """
    address = robot.url if url is None else url
    if not address.strip():
        like = (
            f"such as {robot.url}" if robot.url else f"the name or IP address of the {robot.name}"
        )
        raise RobotError(f"--url: must be given, {like}")
    if fault := _LINKS[robot.name].fault(address):
        raise RobotError(fault)
    return address


def connect(robot: Robot, url: str | None = None, record: Path | None = None) -> Connection:
    """Return a connection to a robot.

    Args:
        robot: The robot.
        url: Its address; by default the robot's own, if it has one.
        record: File that a paced connection leaves if this process is killed.

    Raises:
        RobotError: As `address_of`; if nothing answers there, or a package is missing.
    """
    return _LINKS[robot.name].connected(address_of(robot, url), record)


@dataclass(frozen=True)
class _Link:
    """How a robot is reached.

    Attributes:
        fault: Why a text is no address of it; empty if it is one.
        connected: The connection at an address, with a file that it leaves if it is paced.
    """

    fault: Callable[[str], str]
    connected: Callable[[str, Path | None], Connection]


def _network_fault(url: str) -> str:
    if url.startswith(WITHIN):
        return f"--url: {url!r} keeps messages within one process; it may be such as {IIWA.url}"
    return address_fault(url)


def _iiwa(url: str, record: Path | None) -> Connection:
    return IiwaLcm(open_lcm(url))


def _host_fault(url: str) -> str:
    if _HOST.fullmatch(url):
        return ""
    return (
        f"--url: must be the name or IP address of the fr3 alone, such as 172.16.0.2, not {url!r}"
    )


def _fr3(url: str, record: Path | None) -> Connection:
    if find_spec("pylibfranka") is None:
        raise RobotError(not_installed("--robot fr3", "franka", "pylibfranka"))
    return PacedConnection(url, record=record)


_LINKS = {IIWA.name: _Link(_network_fault, _iiwa), FR3.name: _Link(_host_fault, _fr3)}
