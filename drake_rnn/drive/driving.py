"""Experiments and diagrams that a robot carries out.

- The address of each robot, and the connection to it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInputError, RobotError
from ..experiment import Experiment
from ..inputs.fields import checked, flag, function, instance, offering, optional
from ..inputs.packages import not_installed
from ..runs.folder import Status as RunStatus
from ..runs.result import Result
from .approach import (
    DrivenLaw,
    RobotTask,
)
from .iiwa_lcm import WITHIN, IiwaLcm, address_fault, open_lcm
from .paced_connection import PacedConnection
from .robots import FR3, IIWA, Connection, DriveSettings, Robot
from .session import DriveOutcome, Say, Session


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
            all phases, ``cycles``, ``cycles_lost`` and ``cycles_late``, the number of the law's
            steps that were made in C, ``steps_in_c``, and the time that the stop took,
            ``stop_time_s``, if it came to its end.
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
    result = law.result(columns, status, failure)
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
