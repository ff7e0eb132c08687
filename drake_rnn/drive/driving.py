"""Experiments and diagrams that a robot carries out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.arguments import checked, function, instance, offering
from ..runs.result import Result
from ..runs.result import Status as RunStatus
from .connection import Connection
from .driven_law import DrivenLaw
from .robot_task import RobotTask
from .robots import Robot
from .session import Driven, Say, Session
from .settings import DriveSettings


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
            all phases, ``cycles``, ``cycles_lost`` and ``cycles_late``, and the time that
            the stop took, ``stop_time_s``, if it came to its end.
        driven: Every cycle.
    """

    result: Result
    driven: Driven


@checked(
    experiment=instance(Experiment),
    robot=instance(Robot),
    connection=offering("next", "send"),
    settings=instance(DriveSettings, None),
    say=function(),
    is_told_to_stop=function(),
)
def drive_experiment(
    experiment: Experiment,
    robot: Robot,
    connection: Connection,
    settings: DriveSettings | None = None,
    *,
    say: Say = _silent,
    is_told_to_stop: Callable[[], bool] = _never,
) -> DrivenRun:
    """Let a robot carry out an experiment.

    Args:
        experiment: An experiment of `driven_experiment`.
        robot: The robot.
        connection: Connection to it.
        settings: What is tolerated.
        say: Told what happens, in sentences.
        is_told_to_stop: Whether somebody wants it to end; asked in every cycle.

    Raises:
        InvalidInputError: If the path is out of reach, the law fails when it is tried, or the
            robot stands where no way to the start begins.
        RobotError: If nothing answers, or the robot is not ready. Nothing was sent then.
    """
    law = task_of(experiment)
    driven = drive_diagram(
        law, robot, connection, settings, say=say, is_told_to_stop=is_told_to_stop
    )
    return DrivenRun(result_of(law, driven), driven)


@checked(experiment=instance(Experiment))
def task_of(experiment: Experiment) -> DrivenLaw:
    """Return an experiment of `driven_experiment` as a robot's task.

    Raises:
        InvalidInputError: If the path is out of reach, or the law fails when it is tried.
    """
    if experiment.document.level != "robot" or experiment.document.period is None:
        raise InvalidInputError(
            "experiment: must be one of driven_experiment, at level: robot and with a period"
        )
    return DrivenLaw(experiment)


def result_of(law: DrivenLaw, driven: Driven) -> Result:
    """Return what `DrivenRun.result` is, of a task that a robot has carried out."""
    run = driven.log.of("run")
    heard = np.isfinite(run["position_measured"]).all(axis=1)
    heard &= np.isfinite(run["velocity_measured"]).all(axis=1)
    told = {
        "time": run["time"][heard] - driven.origin,
        "position": run["position_measured"][heard],
        "velocity": run["velocity_measured"][heard],
    }
    status: RunStatus = "complete"
    failure = ""
    if (why := driven.stopped) is not None:
        status = "interrupted" if why.watch == "interrupted" else "failed"
        failure = f"{why} (at t = {law.time:.6g} s)"
    result = law.result(told, status, failure)
    result.timings.update(
        cycles=len(driven.log.times),
        cycles_lost=driven.lost,
        cycles_late=driven.late,
    )
    if np.isfinite(driven.rested):
        result.timings["stop_time_s"] = driven.rested
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
) -> Driven:
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
