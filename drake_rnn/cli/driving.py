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
    DrivenLaw,
    DriveOutcome,
    DriveSettings,
    Faults,
    FollowingRobot,
    PacedConnection,
    Robot,
    SimulatedIiwa,
    address_of,
    connect,
    drive_diagram,
    driven_experiment,
    open_lcm,
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
from ..live.play import Play, Source
from ..live.serving import LOCAL
from ..live.session import Session
from ..live.shielded import ShieldSession
from ..runs.folder import replacing, require_replaceable
from ..runs.result import Result
from ..tables import Column, Heading, Sheet
from .arguments import Drive, Live, ServeRobot
from .console import err, errors, finish, out, silence, status
from .saving import Pictures, changes_of, claimed_folder, require_writable, write_result
from .starting import INTERRUPTED
from .tables import print_sheet

#: File of a run's folder with every cycle.
CYCLES = "cycles.npz"
#: File of a run's folder with every cycle of a paced robot, as its pacer saw it.
PACER = "pacer.npz"
#: File beside a run's folder that the pacer leaves if this process is killed.
CYCLES_FILE = "{}.cycles"
# Signals that end a simulated robot, and those that end a drive: a drive that is suspended, as by
# Ctrl-Z, commands nothing any more.
_TERMINATIONS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_ENDINGS = (*_TERMINATIONS, signal.SIGTSTP)


def drive_robot(args: Drive) -> None:
    """Let a robot carry out an experiment, or print what it would be sent."""
    with silence(args.quiet), errors(), ExitStack() as claims:
        robot = _robot(args.robot)
        address = _address(args, robot)
        changes = changes_of(args.changes, duration=args.duration)
        experiment = driven_experiment(args.experiment, robot, changes)
        settings = _settings(args)
        if args.dry:
            start = experiment.start if args.begin is None else _posture(args.begin, robot)
            follower = FollowingRobot(start, robot.period)
            law = task_of(experiment, args.compiled)
            outcome = drive_diagram(law, robot, follower, settings, say=_say)
            _say(f"law: {law.way}")
            _print_sent(outcome, experiment, robot)
            return
        folder = args.out_folder / experiment.name
        claims.enter_context(_removed_if_refused(folder))
        claims.enter_context(claimed_folder(folder, CYCLES, PACER, may_exist=True))
        # All that takes time is done before the robot is connected.
        law = task_of(experiment, args.compiled, paced=robot.paced)
        connection = connect(robot, address, _left_where_killed(folder))
        with _stop_asked(_ENDINGS) as stop_asked:
            outcome = drive_diagram(
                law, robot, connection, settings, say=_say, is_told_to_stop=stop_asked
            )
        _keep_cycles(outcome, connection, folder)
        result = _evaluate(law, outcome, folder)
        # Whatever becomes of tables and pictures, the result is kept.
        with signals_held():
            result.save(folder)
        write_result(result, folder, Pictures(args.figures, args.playback))
        cycles = (result.timings[name] for name in ("cycles", "cycles_lost", "cycles_late"))
        out.print("cycles    {:g}, of these {:g} lost and {:g} late".format(*cycles))
        out.print(f"law       {escape(law.way)}", soft_wrap=True)
        if result.failure:
            err.print(f"[red]{result.status}[/] {escape(result.failure)}")
    if result.status == "interrupted":
        raise typer.Exit(INTERRUPTED)
    finish(
        result.status == "complete",
        not args.check or result.keeps_bounds,
    )


def serve_robot(args: ServeRobot) -> None:
    """Simulate a robot behind its messages, in real time, until it is told to end."""
    with errors():
        if (robot := _robot(args.robot)) is not IIWA:
            raise InvalidInputError(
                f"robot: there is no simulated {robot.name} here; an iiwa is; franka-sim simulates "
                "an FR3 behind its own messages, see docs/drive.md"
            )
        url = _checked_address(robot, args.url)
        names = [name for name in field_names(Faults) if name != "deaf"]
        wrong = {name: fields_of(args)[name] for name in names}
        deaf = np.inf if args.limit_stop else 0.0
        faults = construct(Faults, wrong | {"deaf": deaf}, "")
        if args.seed < 0:
            raise InvalidInputError(f"--seed: must be at least 0, not {args.seed}")
        start = None if args.begin is None else _posture(args.begin, robot)
        lcm = open_lcm(url)
        require_alone(lcm, url)
        simulated_robot = SimulatedIiwa(lcm, start, faults, args.seed, say=_say)
        _say(f"{args.robot}: simulated at {url}; Ctrl-C ends it")
        with _stop_asked(_TERMINATIONS) as stop_asked:
            simulated_robot.serve(stop_asked)
        out.print(f"ended after {simulated_robot.time:.4g} s")


def _address(args: Drive, robot: Robot) -> str:
    """Return the address of the robot; options that contradict each other are refused."""
    if not args.dry:
        if args.begin is not None:
            raise InvalidInputError("--from: only with --dry; a robot tells where it stands")
        return _checked_address(robot, args.url)
    for option, value in (("--url", args.url), ("--wait", args.wait)):
        if value is not None:
            raise InvalidInputError(f"{option}: not with --dry, which needs no robot")
    return ""


def _robot(name: str) -> Robot:
    if name not in ROBOTS:
        raise InvalidInputError(f"robot: no robot {name!r}; {nearest(name, list(ROBOTS))}")
    return ROBOTS[name]


def _left_where_killed(folder: Path) -> Path:
    file = folder.parent.absolute() / CYCLES_FILE.format(folder.name)
    require_replaceable(file)
    return file


def _checked_address(robot: Robot, url: str | None) -> str:
    """Return the address of a robot; a text that is none is a bad input."""
    try:
        return address_of(robot, url)
    except RobotError as error:
        raise InvalidInputError(str(error)) from None


def _settings(args: Drive) -> DriveSettings:
    names = {"silence": "silence", "late": "late", "lag": "lag", "contact": "wait"}
    values = {name: fields_of(args)[option] for name, option in names.items()}
    settings = {name: value for name, value in values.items() if value is not None}
    try:
        return construct(DriveSettings, settings, "")
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


def _keep_cycles(outcome: DriveOutcome, connection: Connection, folder: Path) -> None:
    """Write every cycle before anything is made of it; the result does without, if it must."""
    files: dict[str, dict[str, Any]] = {CYCLES: outcome.log.arrays()}
    if isinstance(connection, PacedConnection):
        files[PACER] = connection.cycles()
    for name, arrays in files.items():
        try:
            with replacing(folder / name) as new, new.open("wb") as stream:
                np.savez_compressed(stream, **arrays)
        except OSError as error:
            err.print(f"[red]error[/] {escape(f'{folder / name}: {error.strerror}; not kept')}")


def _evaluate(law: DrivenLaw, outcome: DriveOutcome, folder: Path) -> Result:
    try:
        return result_of(law, outcome)
    except Exception as error:  # the robot has moved: what it did is told all the same
        why = f" after it was stopped by {outcome.stopped}" if outcome.stopped else ""
        raise SimulationError(
            f"the drive cannot be evaluated{why}: {type(error).__name__}: {error}; "
            f"{folder / CYCLES} has every cycle",
            law.time,
        ) from error


def _posture(text: str, robot: Robot) -> Array:
    """Return the joint positions of a comma-separated text, shape (n,) [rad]."""
    try:
        entries = np.array([float(entry) for entry in text.split(",")])
    except ValueError:
        raise InvalidInputError(f"--from: must be numbers with commas, not {text!r}") from None
    if not np.isfinite(entries).all():
        raise InvalidInputError(f"--from: must be finite, not {text!r}")
    limits, names = robot.limits, robot.joints
    if entries.shape != (len(names),):
        raise InvalidInputError(
            f"--from: must be {len(names)} numbers, one for each joint of the {robot.name}, not "
            f"{entries.size}"
        )
    if limits.violation(entries).any():
        raise InvalidInputError(f"--from: {limits.complaint(entries, 0.0, names)}")
    return entries


def _say(text: str) -> None:
    out.print(escape(text), soft_wrap=True)


def _print_sent(outcome: DriveOutcome, experiment: Experiment, robot: Robot) -> None:
    """Print what each phase would send, and its largest derivatives beside the limits."""
    names = ("commands", "time [s]", "velocity / limit", "acceleration / limit")
    table = _numbers("phase", *names)
    for phase in ("approach", "run", "stop"):
        log = outcome.log.of(phase)
        speed, change = _ratios(log["time"], log["position_sent"], experiment)
        length = np.ptp(log["time"]) if log["time"].size else 0.0
        table.rows.append((phase, str(log["time"].size), f"{length:.3f}", speed, change))
    print_sheet(table)
    log = outcome.log.arrays()
    is_sent = np.isfinite(log["position_sent"]).all(axis=1)
    rows = _numbers("phase", "t [s]", *(f"{name} [rad]" for name in experiment.arm.joints))
    times, phases, positions = (log[name][is_sent] for name in ("time", "phase", "position_sent"))
    every = max(round(1.0 / robot.period), 1)
    for k in [*range(0, times.size, every), times.size - 1]:
        cells = (f"{times[k] - times[0]:.3f}", *(f"{q:.4f}" for q in positions[k]))
        rows.rows.append((str(phases[k]), *cells))
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


def play_live(args: Live) -> None:
    """Play with an experiment until Ctrl-C."""
    with errors():
        experiment = load_experiment(args.experiment, changes_of(args.changes, args.seed))
        session = Session(experiment, args.obstacle_speed)
    serve(session, session.warnings, args.out_folder, (args.host, args.port))


def serve(
    session: Session | ShieldSession,
    warnings: Sequence[str],
    out_folder: Path,
    place: tuple[str, int],
    source: Source | None = None,
) -> None:
    """Serve a page that plays with a session, until Ctrl-C.

    Args:
        session: The session.
        warnings: What is told of it.
        out_folder: Folder of the recordings.
        place: Address to listen at, and port.
        source: Returns what a shield makes of a source, to be shown; None without one.
    """
    host, port = place
    with errors():
        require_writable(out_folder)
        with status(f"{session.base.name}: making the page"):
            play = Play(session, host, port, _Saving(out_folder), waits=True, source=source)
    for warning in warnings:
        err.print(f"[yellow]warning[/] {escape(warning)}")
    if host not in LOCAL:
        err.print(
            f"[yellow]warning[/] anyone who reaches {escape(host)} sees the page and, while "
            "no other page is open, has its controls; nothing is encrypted"
        )
    out.print(f"live      {escape(play.url)}  (Ctrl-C ends it)", soft_wrap=True)
    try:
        play.run()
    except KeyboardInterrupt:
        out.print(f"ended     after {session.time:.1f} s, at {play.rate:.2f} times real time")
    finally:
        play.close()
    if (left := play.unsaved_time) > 0.0:
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
