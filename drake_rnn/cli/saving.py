"""Making a run, with a progress bar on a terminal, and its folder: result, figures and playback."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import Experiment
from ..inputs.messages import fields_of
from ..playback import write_playback
from ..runs.checkpoint import Checkpoint, can_go_on, forget
from ..runs.folder import read_record, room_in
from ..runs.limit_use import conclusion_of
from ..runs.result import Result
from ..runs.series import SECOND, RunOptions
from ..runs.simulation import Progress as ProgressCallback
from ..runs.simulation import resume, simulate
from .console import err, out, print_table, sentence_of, status
from .drawing import draw_figures
from .tables import joints_sheet, metrics_table, print_sheet

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
