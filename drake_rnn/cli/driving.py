"""Commands that drive a robot, or play with an experiment live.

- Driving a robot, and the simulated one to try it on.
- Playing with an experiment while it runs.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.markup import escape

from ..drive import (
    IIWA,
    ROBOTS,
    Connection,
    Driven,
    DrivenLaw,
    DriveSettings,
    Faults,
    FollowingRobot,
    Paced,
    Robot,
    SimulatedIiwa,
    address_of,
    connect,
    connected,
    drive_diagram,
    drive_experiment,
    driven_experiment,
    require_alone,
    result_of,
    task_of,
)
from ..errors import InvalidInputError, RobotError, SimulationError
from ..experiment import Experiment, load_experiment
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.messages import field_names, fields_of, nearest
from ..inputs.processes import signals_held
from ..live.play import Play
from ..live.requests import LOCAL
from ..live.session import Session
from ..runs.folder import replacing, require_replaceable
from ..runs.result import Result
from ..tables import Column, Heading, Sheet
from .arguments import Drive, Live, ServeRobot
from .changing import changes_of, claimed_folder, require_writable
from .console import err, errors, finish, out, silenced, status
from .saving import Pictures, write_result
from .starting import INTERRUPTED
from .tables import print_sheet

#: File of a run's folder with every cycle.
CYCLES = "cycles.npz"
#: File of a run's folder with every cycle of a paced robot, as its pacer saw it.
PACER = "pacer.npz"
#: File beside a run's folder that the pacer leaves if this process is killed.
KILLED = "{}.cycles"
# Signals that end a simulated robot, and those that end a drive: a drive that is suspended, as by
# Ctrl-Z, commands nothing any more.
_TERMINATIONS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_ENDINGS = (*_TERMINATIONS, signal.SIGTSTP)


def drive_robot(asked: Drive) -> None:
    """Let a robot carry out an experiment, or print what it would be sent."""
    with silenced(asked.quiet), errors(), ExitStack() as claims:
        robot = _known(asked.robot)
        address = _address(asked, robot)
        changes = changes_of(asked.changes, duration=asked.duration)
        experiment = driven_experiment(asked.experiment, robot, changes)
        settings = _settings(asked)
        if asked.dry:
            start = experiment.start if asked.begin is None else _posture(asked.begin, robot)
            follower = FollowingRobot(start, robot.period)
            driven = drive_experiment(experiment, robot, follower, settings, say=_say).driven
            _print_sent(driven, experiment, robot)
            return
        folder = asked.out_folder / experiment.name
        claims.enter_context(_removed_if_refused(folder))
        claims.enter_context(claimed_folder(folder, CYCLES, PACER, filled=True))
        # All that takes time is done before the robot is connected.
        law = task_of(experiment)
        connection = connect(robot, address, _left_where_killed(folder))
        with _stop_asked(_ENDINGS) as told:
            driven = drive_diagram(law, robot, connection, settings, say=_say, is_told_to_stop=told)
        _keep_cycles(driven, connection, folder)
        result = _evaluated(law, driven, folder)
        # Whatever becomes of tables and pictures, the result is kept.
        with signals_held():
            result.save(folder)
        write_result(result, folder, Pictures(asked.figures, asked.playback))
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
        url = _checked_address(robot, asked.url)
        names = [name for name in field_names(Faults) if name != "deaf"]
        wrong = {name: fields_of(asked)[name] for name in names}
        deaf = np.inf if asked.limit_stop else 0.0
        faults = construct(Faults, wrong | {"deaf": deaf}, "")
        if asked.seed < 0:
            raise InvalidInputError(f"--seed: must be at least 0, not {asked.seed}")
        start = None if asked.begin is None else _posture(asked.begin, robot)
        lcm = connected(url)
        require_alone(lcm, url)
        served = SimulatedIiwa(lcm, start, faults, asked.seed, say=_say)
        _say(f"{asked.robot}: simulated at {url}; Ctrl-C ends it")
        with _stop_asked(_TERMINATIONS) as told:
            served.serve(told)
        out.print(f"ended after {served.time:.4g} s")


def _address(asked: Drive, robot: Robot) -> str:
    """Return the address of the robot; options that contradict each other are refused."""
    if not asked.dry:
        if asked.begin is not None:
            raise InvalidInputError("--from: only with --dry; a robot tells where it stands")
        return _checked_address(robot, asked.url)
    for option, value in (("--url", asked.url), ("--wait", asked.wait)):
        if value is not None:
            raise InvalidInputError(f"{option}: not with --dry, which needs no robot")
    return ""


def _known(name: str) -> Robot:
    if name not in ROBOTS:
        raise InvalidInputError(f"robot: no robot {name!r}; {nearest(name, list(ROBOTS))}")
    return ROBOTS[name]


def _left_where_killed(folder: Path) -> Path:
    file = folder.parent.absolute() / KILLED.format(folder.name)
    require_replaceable(file)
    return file


def _checked_address(robot: Robot, url: str | None) -> str:
    """Return the address of a robot; a text that is none is a bad input."""
    try:
        return address_of(robot, url)
    except RobotError as error:
        raise InvalidInputError(str(error)) from None


def _settings(asked: Drive) -> DriveSettings:
    names = {"silence": "silence", "late": "late", "lag": "lag", "contact": "wait"}
    values = {name: fields_of(asked)[option] for name, option in names.items()}
    given = {name: value for name, value in values.items() if value is not None}
    try:
        return construct(DriveSettings, given, "")
    except InvalidInputError as error:
        name, _, why = str(error).partition(":")
        raise InvalidInputError(f"--{names.get(name, name)}:{why}") from None


@contextmanager
def _removed_if_refused(folder: Path) -> Iterator[None]:
    """Remove the folder of a run that is new and still empty if what is done within fails."""
    is_new = not folder.exists()
    try:
        yield
    except BaseException:
        if is_new:
            with suppress(OSError):
                folder.rmdir()
        raise


def _keep_cycles(driven: Driven, connection: Connection, folder: Path) -> None:
    """Write every cycle before anything is made of it; the result does without, if it must."""
    files: dict[str, dict[str, Any]] = {CYCLES: driven.log.arrays()}
    if isinstance(connection, Paced):
        files[PACER] = connection.cycles()
    for name, arrays in files.items():
        try:
            with replacing(folder / name) as new, new.open("wb") as stream:
                np.savez_compressed(stream, **arrays)
        except OSError as error:
            err.print(f"[red]error[/] {escape(f'{folder / name}: {error.strerror}; not kept')}")


def _evaluated(law: DrivenLaw, driven: Driven, folder: Path) -> Result:
    try:
        return result_of(law, driven)
    except Exception as error:  # the robot has moved: what it did is told all the same
        why = f" after it was stopped by {driven.stopped}" if driven.stopped else ""
        raise SimulationError(
            f"the drive cannot be evaluated{why}: {type(error).__name__}: {error}; "
            f"{folder / CYCLES} has every cycle",
            law.time,
        ) from error


def _posture(text: str, robot: Robot) -> Array:
    """Return the joint positions of a comma-separated text, shape (n,) [rad]."""
    try:
        found = np.array([float(entry) for entry in text.split(",")])
    except ValueError:
        raise InvalidInputError(f"--from: must be numbers with commas, not {text!r}") from None
    if not np.isfinite(found).all():
        raise InvalidInputError(f"--from: must be finite, not {text!r}")
    limits, names = robot.limits, robot.joints
    if found.shape != (len(names),):
        raise InvalidInputError(
            f"--from: must be {len(names)} numbers, one for each joint of the {robot.name}, not "
            f"{found.size}"
        )
    if limits.violation(found).any():
        raise InvalidInputError(f"--from: {limits.complaint(found, 0.0, names)}")
    return found


def _say(text: str) -> None:
    out.print(escape(text), soft_wrap=True)


def _print_sent(driven: Driven, experiment: Experiment, robot: Robot) -> None:
    """Print what each phase would send, and its largest derivatives beside the limits."""
    names = ("commands", "time [s]", "velocity / limit", "acceleration / limit")
    table = _numbers("phase", *names)
    for phase in ("approach", "run", "stop"):
        log = driven.log.of(phase)
        speed, change = _ratios(log["time"], log["position_sent"], experiment)
        length = np.ptp(log["time"]) if log["time"].size else 0.0
        table.rows.append((phase, str(log["time"].size), f"{length:.3f}", speed, change))
    print_sheet(table)
    log = driven.log.arrays()
    sent = np.isfinite(log["position_sent"]).all(axis=1)
    rows = _numbers("phase", "t [s]", *(f"{name} [rad]" for name in experiment.arm.joints))
    times, phases, positions = (log[name][sent] for name in ("time", "phase", "position_sent"))
    every = max(round(1.0 / robot.period), 1)
    for k in [*range(0, times.size, every), times.size - 1]:
        told = (f"{times[k] - times[0]:.3f}", *(f"{q:.4f}" for q in positions[k]))
        rows.rows.append((str(phases[k]), *told))
    print_sheet(rows, 2)


def _numbers(first: str, *names: str) -> Sheet:
    """Return a table without rows, of a column of words and others of numbers."""
    return Sheet((Column(Heading(first)), *(Column(Heading(name), right=True) for name in names)))


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
def _stop_asked(numbers: Sequence[signal.Signals]) -> Iterator[Callable[[], bool]]:
    """Note signals instead of obeying them at once: a robot is brought to rest first."""
    came: list[int] = []
    before = {}
    for number in numbers:
        if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
            # As with nohup: the end of a terminal is not to end this.
            continue
        before[number] = signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def play_live(asked: Live) -> None:
    """Play with an experiment until Ctrl-C."""
    with errors():
        experiment = load_experiment(asked.experiment, changes_of(asked.changes, asked.seed))
        session = Session(experiment, asked.obstacle_speed)
        require_writable(asked.out_folder)
        with status(f"{experiment.name}: making the page"):
            saving = _Saving(asked.out_folder)
            play = Play(session, asked.host, asked.port, saving, waits=True)
    for warning in session.warnings:
        err.print(f"[yellow]warning[/] {escape(warning)}")
    if asked.host not in LOCAL:
        err.print(
            f"[yellow]warning[/] anyone who reaches {escape(asked.host)} sees the page and, while "
            "no other page is open, has its controls; nothing is encrypted"
        )
    out.print(f"live      {escape(play.url)}  (Ctrl-C ends it)", soft_wrap=True)
    try:
        play.run()
    except KeyboardInterrupt:
        out.print(f"ended     after {session.time:.1f} s, at {play.rate:.2f} times real time")
    finally:
        play.close()
    if (left := play.unsaved) > 0.0:
        err.print(f"[yellow]warning[/] {left:.1f} s were recorded and not saved")


class _Saving:
    """Writes each recording to a folder of its own, and returns that.

    Args:
        out_folder: Folder that they are in.
    """

    def __init__(self, out_folder: Path) -> None:
        self._out = out_folder

    def __call__(self, result: Result) -> str:
        name, number = f"{result.experiment.name}_live", 1
        while not _is_made(folder := self._out / f"{name}_{number}"):
            number += 1
        write_result(result, folder, Pictures(figures=False))
        return str(folder)


def _is_made(folder: Path) -> bool:
    """Make a folder, unless something of that name is there, maybe another process's."""
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    except OSError as error:
        raise InvalidInputError(f"--out: {folder}: {error.strerror}") from None
    return True
