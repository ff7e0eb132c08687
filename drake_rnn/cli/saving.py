"""The folder of a run: its result, figures and playback.

- Figures drawn by two processes at a time, as drawing is most of what a short run takes.
- Pictures of a diagram's wiring, by Graphviz.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path

from rich.markup import escape

from .. import figures
from ..errors import DrakeRnnError, InvalidInputError
from ..playback import write_playback
from ..runs.checkpoint import can_go_on, forget
from ..runs.folder import read_record, replacing, require_output, room_in, written_whole
from ..runs.limit_use import conclusion_of
from ..runs.result import Result
from ..runs.series import SECOND
from .console import err, out, print_table, sentence_of, status
from .tables import joints_table, metrics_table

# Time by which a helper that began with us may be later [s].
_PATIENCE = 60.0


def draw_figures(
    result: Result,
    folder: Path,
    names: Sequence[str] | None = None,
    helped: bool | None = None,
    paper: figures.Paper | None = None,
) -> list[Path]:
    """Write figures of a result, as `write_figures`, with a second process if there is room.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply.
        helped: Whether a second process draws half of them; by default if there is a processor
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
    if not theirs or not (_has_room() if helped is None else helped):
        return figures.write_figures(result, folder, names, paper)
    with _helper(result, folder, theirs, paper) as helper:
        figures.write_figures(result, folder, ours, paper)
        helper.join(_PATIENCE)
        done = helper.exitcode == 0
    if not done:
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


#: What Graphviz can write of what is of use here.
_FORMATS = (".svg", ".png", ".pdf")


def draw_beside(dot: Path) -> None:
    """Write the picture of a file of Graphviz beside it, if Graphviz is installed."""
    if program := shutil.which("dot"):
        command = [program, "-Tsvg", str(dot), "-o", str(dot.with_suffix(".svg"))]
        subprocess.run(command, check=False, capture_output=True)


def write_graph(graph: str, file: Path) -> None:
    """Write a graph: its text, or a picture, as the file's name says.

    Raises:
        InvalidInputError: If the file has another ending, Graphviz is needed and not installed, or
            the file cannot be written.
    """
    if file.suffix not in (".dot", *_FORMATS):
        endings = ", ".join((".dot", *_FORMATS))
        raise InvalidInputError(f"--diagram: must end with one of {endings}, not {file.name!r}")
    program = shutil.which("dot")
    if file.suffix != ".dot" and program is None:
        raise InvalidInputError(
            f"--diagram: {file.suffix} needs Graphviz, whose program dot is not installed; "
            "install the package graphviz, or write a .dot file"
        )
    require_output(file, "--diagram")
    try:
        if file.suffix == ".dot" or program is None:
            with written_whole(file) as stream:
                stream.write(graph)
            return
        drawn = subprocess.run(
            [program, f"-T{file.suffix[1:]}"],
            input=graph.encode(),
            capture_output=True,
            check=True,
        )
        with replacing(file) as new:
            new.write_bytes(drawn.stdout)
    except OSError as error:
        raise InvalidInputError(f"--diagram: {file}: {error.strerror}") from None


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
            raise InvalidInputError(f"{sentence_of(error)}; {_kept(folder)}") from error

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
    if (joints := joints_table(result)) is not None:
        print_table(joints)
    if result.second is not None:
        for warning in result.second.warnings:
            if f"second: {warning}" not in result.warnings:
                err.print(f"[yellow]warning[/] {escape(f'{name}: second: {warning}')}")
        print_table(metrics_table(result.second))
    conclusion = conclusion_of(result)
    colour = {"good": "green", "bad": "red"}.get(conclusion.kind, "none")
    told = escape(f"{name}: {conclusion}")
    out.print(f"verdict   [{colour}]{told}[/]", soft_wrap=True)
    cost = result.timings["wall_time_s"]
    how = "simulated" if result.experiment.level.is_simulated else "driven"
    since = result.timings.get("resumed_at_s", 0.0)
    again = f", resumed at {since:g} s" if since else ""
    out.print(f"time      {result.record['until_s'] - since:g} s {how} in {cost:.3g} s{again}")


def _make(pictures: Pictures, result: Result, folder: Path, beside: Sequence[Result]) -> None:
    """Make what there is to look at; of a run that was interrupted nobody wants to wait for it."""
    draw_beside(folder / "diagram.dot")
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
        drawn = f"{folder / 'figures'} ({len(figures)})" if figures else "none"
        out.print(escape(f"figures   {drawn}"), soft_wrap=True)
    if pictures.playback and result.time.size > 1:
        write_page(result, folder, beside)


def going_on(folder: Path) -> str:
    """Return how a run that was stopped can be brought to its end."""
    return f"`{_resuming(folder)}` goes on with it"


def kept_without_pictures(folder: Path) -> str:
    """Return what there is of a run that was interrupted when it was complete."""
    return f"interrupted: {_kept(folder)}"


def _kept(folder: Path) -> str:
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
