"""Making a run, with a progress bar on a terminal, and its folder: result, figures and playback.

- What options mean for the documents of experiments.
- Pictures that commands draw.
- Figures, drawn by two processes at a time, as drawing is most of what a short run takes; the paper
  that options describe.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import perf_counter
from typing import Any

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from .. import figures
from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import Experiment, ExperimentSource, parse_change, read_document
from ..inputs.messages import fields_of
from ..laws.guarantee import promise_lines
from ..playback import write_playback
from ..runs.checkpoint import Checkpoint, can_go_on, forget
from ..runs.folder import (
    claim_folder,
    make_folder,
    read_record,
    require_fillable,
    require_replaceable,
    room_in,
)
from ..runs.limit_use import conclusion_of
from ..runs.result import Result
from ..runs.series import SECOND, RunOptions
from ..runs.simulation import Progress as ProgressCallback
from ..runs.simulation import resume, simulate
from .command import PrintOptions
from .console import err, out, print_table, sentence_of, status
from .tables import (
    joints_sheet,
    metrics_table,
    print_sheet,
)

# Time by which a helper that began with us may be later [s].
_PATIENCE = 60.0


def draw_figures(
    result: Result,
    folder: Path,
    names: Sequence[str] | None = None,
    in_helper: bool | None = None,
    paper: figures.Paper | None = None,
) -> list[Path]:
    """Write figures of a result, as `write_figures`, with a second process if there is room.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply.
        in_helper: Whether a second process draws half of them; by default if there is a processor
            for it.
        paper: What they are drawn for; by default a screen.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """
    paper = figures.Paper() if paper is None else paper
    names = list(names or figures.fitting(figures.drawable(result), paper))
    ours, theirs = names[::2], names[1::2]
    if not theirs or not (_has_room() if in_helper is None else in_helper):
        return figures.write_figures(result, folder, names, paper)
    with _helper(result, folder, theirs, paper) as helper:
        figures.write_figures(result, folder, ours, paper)
        helper.join(_PATIENCE)
        is_drawn = helper.exitcode == 0
    if not is_drawn:
        # Where it failed, this tells why.
        figures.write_figures(result, folder, theirs, paper)
    return [folder / f"{name}.{paper.form}" for name in names]


def _has_room() -> bool:
    """Return whether a second process may draw."""
    # Elsewhere a fork is not safe. A process of a queue has its share of the processors.
    if sys.platform != "linux" or parent_process() is not None:
        return False
    return len(os.sched_getaffinity(0)) > 1


@contextmanager
def _helper(
    result: Result, folder: Path, names: Sequence[str], paper: figures.Paper
) -> Iterator[BaseProcess]:
    """Let a process draw figures meanwhile; afterwards it is gone, whatever happened."""
    # A fork has the result and all modules at once. It draws without Drake's threads.
    arguments = (result, folder, names, os.getpid(), paper)
    helper = get_context("fork").Process(target=_draw_for, args=arguments, daemon=True)
    helper.start()
    try:
        yield helper
    finally:
        helper.kill()
        helper.join()


def _draw_for(
    result: Result, folder: Path, names: Sequence[str], parent: int, paper: figures.Paper
) -> None:
    """Draw figures for a process, as long as that lives: a later run may use the folder."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for name in names:
        if os.getppid() != parent:
            return
        try:
            figures.write_figures(result, folder, [name], paper)
        except DrakeRnnError:
            # That process will try again, and tell why it fails.
            sys.exit(1)


def paper_of(args: PrintOptions) -> figures.Paper:
    """Return what the options say that figures are drawn for.

    Raises:
        InvalidInputError: If the width is none.
    """
    width = None if args.width is None else figures.parse_width(args.width)
    return figures.Paper(args.form, width, args.look)


# Room on the disk for pictures, for which a checkpoint that is no longer needed is removed [bytes].
_ROOM = 32_000_000


@dataclass(frozen=True)
class Pictures:
    """What is made of a result to look at.

    Attributes:
        figures: Whether figures are drawn.
        playback: Whether a playback is written.
    """

    figures: bool = True
    playback: bool = True


def write_result(
    result: Result,
    folder: Path,
    pictures: Pictures,
    beside: Sequence[Result] = (),
) -> None:
    """Write a result with its pictures, and print what came out.

    Args:
        result: The result.
        folder: Folder to write to.
        pictures: What is made to look at.
        beside: Results whose paths the playback shows too.

    Raises:
        InvalidInputError: If the result cannot be written, or something beside it; it is kept then.
        KeyboardInterrupt: If it is interrupted while pictures are made; the result is kept.
    """
    _print_result(result)

    def draw(place: Path) -> None:
        try:
            if room_in(place) < _ROOM and result.status != "interrupted":
                forget(place)
            _make(pictures, result, place, beside)
        except (DrakeRnnError, OSError) as error:
            raise InvalidInputError(f"{sentence_of(error)}; {_note_of(folder)}") from error

    try:
        result.save(folder, draw)
    except KeyboardInterrupt:
        with suppress(InvalidInputError):
            read_record(folder)
            raise KeyboardInterrupt(kept_without_pictures(folder)) from None
        raise


def _print_result(result: Result) -> None:
    """Print warnings, metrics, the verdict and what the run cost."""
    name = result.experiment.name
    for warning in result.warnings:
        err.print(f"[yellow]warning[/] {escape(f'{name}: {warning}')}")
    print_table(metrics_table(result))
    if (joints := joints_sheet(result)) is not None:
        print_sheet(joints)
    if result.second is not None:
        for warning in result.second.warnings:
            if f"second: {warning}" not in result.warnings:
                err.print(f"[yellow]warning[/] {escape(f'{name}: second: {warning}')}")
        print_table(metrics_table(result.second))
    conclusion = conclusion_of(result)
    colour = {"good": "green", "bad": "red"}.get(conclusion.kind, "none")
    text = escape(f"{name}: {conclusion}")
    out.print(f"verdict   [{colour}]{text}[/]", soft_wrap=True)
    for arm, title in ((result, "promise"), (result.second, "second")):
        for line in () if arm is None else promise_lines(arm.promises):
            out.print(escape(f"{title:<9} {line}"), soft_wrap=True)
    cost = result.timings["wall_time_s"]
    how = "simulated" if result.experiment.level.is_simulated else "driven"
    how += f" {result.options.words}" if result.options.words else ""
    since = result.timings.get("resumed_at_s", 0.0)
    again = f", resumed at {since:g} s" if since else ""
    out.print(f"time      {result.record['until_s'] - since:g} s {how} in {cost:.3g} s{again}")


def _make(pictures: Pictures, result: Result, folder: Path, beside: Sequence[Result]) -> None:
    """Make what there is to look at; of a run that was interrupted nobody wants to wait for it."""
    _draw_beside(folder / "diagram.dot")
    out.print(escape(f"results   {folder}"), soft_wrap=True)
    if result.status == "interrupted":
        if can_go_on(folder):
            out.print(escape(f"go on     {_resuming(folder)}"), soft_wrap=True)
        if pictures.figures or pictures.playback:
            out.print(escape(f"pictures  none: {_again(folder)}"), soft_wrap=True)
        return
    if pictures.figures:
        with status(f"{result.experiment.name}: drawing figures"):
            figures = draw_figures(result, folder / "figures")
            if result.second is not None:
                draw_figures(result.second, folder / SECOND / "figures")
        figure = f"{folder / 'figures'} ({len(figures)})" if figures else "none"
        out.print(escape(f"figures   {figure}"), soft_wrap=True)
    if pictures.playback and result.time.size > 1:
        write_page(result, folder, beside)


def going_on(folder: Path) -> str:
    """Return how a run that was stopped can be brought to its end."""
    return f"`{_resuming(folder)}` goes on with it"


def kept_without_pictures(folder: Path) -> str:
    """Return what there is of a run that was interrupted when it was complete."""
    return f"interrupted: {_note_of(folder)}"


def _note_of(folder: Path) -> str:
    return f"{folder} has the result; {_again(folder)}"


def _resuming(folder: Path) -> str:
    return f"drake-rnn run --resume {folder}"


def _again(folder: Path) -> str:
    return f"`drake-rnn plot {folder}` and `drake-rnn replay {folder}` draw it"


def write_page(result: Result, folder: Path, beside: Sequence[Result]) -> None:
    """Write a result's playback to its folder."""
    others = [other for other in beside if other.time.size > 1]
    # A lower rate keeps the page of a long run small.
    rate = 64 if result.time[-1] <= 30.0 else 32
    with status(f"{result.experiment.name}: writing the playback"):
        page = write_playback(result, folder / "playback.html", rate, others)
    out.print(escape(f"playback  {page}"), soft_wrap=True)


class InterruptedAfterItsLastStep(KeyboardInterrupt):
    """A run that was told to end when nothing was left to simulate.

    Attributes:
        result: The result of the whole run.
    """

    def __init__(self, result: Result) -> None:
        super().__init__("interrupted")
        self.result = result


def simulate_or_print(
    experiment: Experiment,
    bar: bool = True,
    *,
    keep: Path | None = None,
    options: RunOptions = RunOptions(),  # noqa: B008  it is frozen
) -> Result:
    """Return the result of an experiment; up to its failure, which is printed, if it fails.

    Raises:
        InterruptedAfterItsLastStep: If that is when it is interrupted.
    """
    how = {"keep": keep, **fields_of(options)}
    return _run_or_print(experiment, lambda progress: simulate(experiment, progress, **how), bar)


def resume_or_print(since: Checkpoint) -> Result:
    """Return the result of a run that goes on, as `simulate_or_print` does."""
    return _run_or_print(since.experiment, lambda progress: resume(since, progress))


def _run_or_print(
    experiment: Experiment, make: Callable[[ProgressCallback | None], Result], bar: bool = True
) -> Result:
    try:
        with _progress_bar(experiment, bar) as progress:
            return make(progress)
    except SimulationError as error:
        result: Result = error.result
        if isinstance(error, InterruptedRunError) and result.status != "interrupted":
            raise InterruptedAfterItsLastStep(result) from None
        err.print(f"[red]failed[/] {escape(f'{experiment.name}: {error}')}")
        return result


@contextmanager
def _progress_bar(experiment: Experiment, is_visible: bool) -> Iterator[ProgressCallback | None]:
    """Show a progress bar on a terminal if it is to be shown, nothing elsewhere."""
    if not is_visible or not err.is_terminal or out.quiet:
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} / {task.total:g} s"),
        TextColumn("{task.fields[speed]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(experiment.name, total=experiment.document.duration, speed="")
        began: list[float] = []

        def progress(t: float) -> None:
            # A run that goes on begins later.
            since, at = began or (t, perf_counter())
            began[:] = since, at
            speed = (t - since) / max(perf_counter() - at, 1e-9)
            bar.update(task, completed=t, speed=f"{speed:.1f} x real time")

        yield progress


def run_and_write(
    run: Callable[[], Result], folder: Path, pictures: Pictures, beside: Sequence[Result] = ()
) -> Result:
    """Make a run and write its result.

    Raises:
        KeyboardInterrupt: If it is interrupted after the last step; it says where the result is, or
            how to go on to it.
    """
    try:
        result = run()
        write_result(result, folder, pictures, beside)
    except InterruptedAfterItsLastStep as interrupt:
        write_result(interrupt.result, folder, Pictures(figures=False, playback=False))
        raise KeyboardInterrupt(kept_without_pictures(folder)) from None
    except KeyboardInterrupt as interrupt:
        if str(interrupt) or not can_go_on(folder):
            raise
        raise KeyboardInterrupt(f"interrupted; {going_on(folder)}") from None
    return result


def _draw_beside(dot: Path) -> None:
    """Write the picture of a file of Graphviz beside it, if Graphviz is installed."""
    if program := shutil.which("dot"):
        command = [program, "-Tsvg", str(dot), "-o", str(dot.with_suffix(".svg"))]
        subprocess.run(command, check=False, capture_output=True)


def changes_of(
    changes: list[str] | None, seed: int | None = None, duration: float | None = None
) -> dict[str, Any]:
    """Return the changes that options ask for, by dotted key.

    Raises:
        InvalidInputError: If a change is not ``KEY=VALUE``, or a key is given twice.
    """
    keys = [("--set", *parse_change(change)) for change in changes or []]
    keys += [("--seed", "seed", seed), ("--duration", "duration", duration)]
    new: dict[str, Any] = {}
    for option, key, value in keys:
        if option != "--set" and value is None:
            continue
        if key in new:
            raise InvalidInputError(
                f"{option}: {key} is given twice, as {new[key]!r} and {value!r}"
            )
        new[key] = value
    return new


def tell_of_window(name: ExperimentSource, changes: Mapping[str, Any]) -> None:
    """Print a note if the duration ends before the window and therefore drops it."""
    others = {key: value for key, value in changes.items() if key != "duration"}
    before, now = read_document(name, others), read_document(name, changes)
    missing = [key for key in ("window", "accept") if key in before and key not in now]
    if "window" not in missing:
        return
    what = "and the bounds of accept are" if "accept" in missing else "is"
    # A change of what is measured is also told to those who want to hear of nothing else.
    (err if out.quiet else out).print(
        f"[yellow]note[/] {escape(str(now['name']))}: window {escape(str(before['window']))} s "
        f"{what} dropped: the run ends at {now['duration']:g} s",
        soft_wrap=True,
    )


@contextmanager
def claimed_folder(folder: Path, *names: str, may_exist: bool = False) -> Iterator[None]:
    """Make a folder for a with-block in which no other process writes to it.

    Args:
        folder: The folder.
        *names: Names of the files that are to be written to it.
        may_exist: Whether it is that of a run, whose result is to take the place of another one.

    Raises:
        InvalidInputError: If nothing can be written to it, or another process writes to it.
    """
    require_writable(folder)
    for name in names:
        require_replaceable(folder / name)
    with claim_folder(folder):
        if may_exist:
            require_fillable(folder)
        yield


def require_writable(folder: Path, option: str = "--out") -> None:
    """Make a folder, or say of an option why nothing can be written to it."""
    try:
        make_folder(folder)
    except InvalidInputError as error:
        raise InvalidInputError(f"{option}: {error}") from None
    except OSError as error:
        raise InvalidInputError(f"{option}: {folder}: {error.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidInputError(f"{option}: {folder}: not writable")
