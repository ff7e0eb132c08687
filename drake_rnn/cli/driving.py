"""Driving a robot, and the simulated one to try it on."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from ..drive import (
    IIWA,
    ROBOTS,
    Driven,
    DriveSettings,
    Faults,
    FollowingRobot,
    Paced,
    Robot,
    SimulatedIiwa,
    connect,
    connected,
    drive_experiment,
    driven_experiment,
)
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.complaints import nearest
from ..inputs.dataclass_fields import field_names, fields_of
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..runs.whole_file import replacing, require_replaceable
from .asked import Drive, ServeRobot
from .changing import changes_of, claimed_folder
from .console import err, errors, finish, out, print_whole, silenced
from .saving import Pictures, write_result
from .statuses import INTERRUPTED

#: File of a run's folder with every cycle.
CYCLES = "cycles.npz"
#: File of a run's folder with every cycle of a paced robot, as its pacer saw it.
PACER = "pacer.npz"
#: File beside a run's folder that the pacer leaves if this process is killed.
KILLED = "{}.cycles"


def drive_robot(asked: Drive) -> None:
    """Let a robot carry out an experiment, or print what it would be sent."""
    with silenced(asked.quiet), errors(), ExitStack() as claims:
        robot = _known(asked.robot)
        changes = changes_of(asked.changes, duration=asked.duration)
        experiment = driven_experiment(asked.experiment, robot, changes)
        folder = asked.out_folder / experiment.name
        given = {"silence": asked.silence, "late": asked.late, "lag": asked.lag}
        settings = construct(DriveSettings, _given(**given, contact=asked.wait), "")
        if asked.dry:
            follower = FollowingRobot(_posture(asked.begin, experiment), robot.period)
            driven = drive_experiment(experiment, robot, follower, settings, say=_say).driven
            _print_sent(driven, experiment, robot)
            return
        if asked.begin is not None:
            raise InvalidInputError("--from: only with --dry; a robot tells where it stands")
        claims.enter_context(claimed_folder(folder, CYCLES, PACER, filled=True))
        connection = connect(robot, asked.url, _left_where_killed(folder))
        with _stop_asked() as told:
            result, driven = drive_experiment(
                experiment, robot, connection, settings, say=_say, is_told_to_stop=told
            )

        def save_cycles(place: Path) -> None:
            _save(place / CYCLES, driven.log.arrays())
            if isinstance(connection, Paced):
                _save(place / PACER, connection.cycles())

        write_result(result, folder, Pictures(asked.figures, asked.playback), (), save_cycles)
        cycles = (result.timings[name] for name in ("cycles", "cycles_lost", "cycles_late"))
        out.print("cycles    {:g}, of these {:g} lost and {:g} late".format(*cycles))
        if result.failure:
            err.print(f"[red]{result.status}[/] {escape(result.failure)}")
    if result.status == "interrupted":
        raise typer.Exit(INTERRUPTED)
    finish(
        result.status == "complete",
        not asked.check or all(verdict.met for verdict in result.verdicts),
    )


def serve_robot(asked: ServeRobot) -> None:
    """Simulate a robot behind its messages, in real time, until it is told to end."""
    with errors():
        if (robot := _known(asked.robot)) is not IIWA:
            raise InvalidInputError(
                f"robot: there is no simulated {robot.name} here; an iiwa is; franka-sim simulates "
                "an FR3 behind its own messages, see docs/drive.md"
            )
        names = [name for name in field_names(Faults) if name != "deaf"]
        wrong = {name: fields_of(asked)[name] for name in names}
        deaf = np.inf if asked.limit_stop else 0.0
        faults = construct(Faults, wrong | {"deaf": deaf}, "")
        start = None if asked.begin is None else _numbers(asked.begin)
        url = asked.url or IIWA.url
        served = SimulatedIiwa(connected(url), start, faults, asked.seed)
        out.print(escape(f"{asked.robot}: simulated at {url}; Ctrl-C ends it"))
        with _stop_asked() as told:
            served.serve(told)
        out.print(f"ended after {served.time:.4g} s")


def _known(name: str) -> Robot:
    if name not in ROBOTS:
        raise InvalidInputError(f"robot: no robot {name!r}; {nearest(name, list(ROBOTS))}")
    return ROBOTS[name]


def _left_where_killed(folder: Path) -> Path:
    file = folder.parent.absolute() / KILLED.format(folder.name)
    require_replaceable(file)
    return file


def _save(file: Path, arrays: dict[str, Any]) -> None:
    with replacing(file) as new, new.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def _given(**options: Any) -> dict[str, Any]:
    """Return the options that were given."""
    return {name: value for name, value in options.items() if value is not None}


def _posture(text: str | None, experiment: Experiment) -> Array:
    return experiment.start if text is None else _numbers(text)


def _numbers(text: str) -> Array:
    """Return the joint positions of a comma-separated text, shape (n,) [rad]."""
    try:
        found = np.array([float(entry) for entry in text.split(",")])
    except ValueError:
        raise InvalidInputError(f"--from: must be numbers with commas, not {text!r}") from None
    if not np.isfinite(found).all():
        raise InvalidInputError(f"--from: must be finite, not {text!r}")
    return found


def _say(text: str) -> None:
    out.print(escape(text), soft_wrap=True)


def _print_sent(driven: Driven, experiment: Experiment, robot: Robot) -> None:
    """Print what each phase would send, and its largest derivatives beside the limits."""
    table = Table("phase", "commands", "time [s]", "velocity / limit", "acceleration / limit")
    for phase in ("approach", "run", "stop"):
        log = driven.log.of(phase)
        speed, change = _ratios(log["time"], log["position_sent"], experiment)
        length = np.ptp(log["time"]) if log["time"].size else 0.0
        table.add_row(phase, str(log["time"].size), f"{length:.3f}", speed, change)
    print_whole(table)
    log = driven.log.arrays()
    sent = np.isfinite(log["position_sent"]).all(axis=1)
    rows = Table("phase", "t [s]", *(f"{name} [rad]" for name in experiment.arm.joints))
    times, phases, positions = (log[name][sent] for name in ("time", "phase", "position_sent"))
    every = max(round(1.0 / robot.period), 1)
    for k in [*range(0, times.size, every), times.size - 1]:
        rows.add_row(
            str(phases[k]), f"{times[k] - times[0]:.3f}", *(f"{q:.4f}" for q in positions[k])
        )
    print_whole(rows)


def _ratios(time: Array, position: Array, experiment: Experiment) -> tuple[str, str]:
    """Return the largest velocity and acceleration as shares of their limits, as texts."""
    limits = experiment.limits
    if time.size < 3:
        return "", ""
    velocity = np.diff(position, axis=0) / np.diff(time)[:, np.newaxis]
    middle = (time[1:] + time[:-1]) / 2.0
    acceleration = np.diff(velocity, axis=0) / np.diff(middle)[:, np.newaxis]
    most = limits.require("acceleration", "the robot's bounds")
    return (
        f"{np.abs(velocity / limits.velocity).max():.6f}",
        f"{np.abs(acceleration / most).max():.6f}",
    )


@contextmanager
def _stop_asked() -> Iterator[Callable[[], bool]]:
    """Note Ctrl-C and SIGTERM instead of obeying at once: a robot is brought to rest first."""
    came: list[int] = []
    before = {
        number: signal.signal(number, lambda number, frame: came.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
