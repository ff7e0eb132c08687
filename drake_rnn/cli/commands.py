"""The command line."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..claims import Judge
from ..errors import DrakeRnnError, InvalidInputError, SimulationError
from ..experiment import Experiment, load_experiment, parse_change, read_document, set_key
from ..figures import write_figures
from ..figures.arm_picture import write_arm_picture
from ..figures.learning import learning_figure
from ..figures.sweep import sweep_figure
from ..inputs.documents import parse_yaml
from ..playback import write_playback
from ..robot.load_arm import load_arm
from ..robot.report import arm_report
from ..runs.fastest import fastest
from ..runs.folder import filled
from ..runs.result import Result
from ..runs.simulation import Progress as ProgressCallback
from ..runs.simulation import check_experiment, simulate
from ..runs.sweep import Row, parse_axis, write_csv
from ..runs.sweep import sweep as run_sweep
from .claims import chosen_claims, claims_table, judgement_table
from .new import Own, write_start
from .tables import (
    WIDE,
    arm_joints_table,
    arm_table,
    experiments_table,
    joints_table,
    metrics_table,
    sweep_tables,
    varying_metrics,
)

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,  # it would read [s] as a style
    pretty_exceptions_enable=False,
    help="Recurrent-neural-network controllers for redundant manipulators, as Drake systems.",
)

# Width of tables in a pipe or a file [characters].
_WIDTH = None if sys.stdout.isatty() else 140
out = Console(width=_WIDTH, soft_wrap=False, highlight=False)
err = Console(stderr=True, soft_wrap=True, highlight=False)

FAILED, BAD_INPUT, NOT_MET = 1, 2, 3

Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a key, e.g. law.kappa=8; repeatable."),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the result folders.")]
Seed = Annotated[int | None, typer.Option(help="Seed of all random numbers.")]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Exit with status 3 if a bound is not kept: of accept, or a limit that the law keeps.",
    ),
]
Anyway = Annotated[
    bool, typer.Option("--anyway", help="Run even if it may take more than three hours.")
]
Duration = Annotated[
    float | None,
    typer.Option(help="Simulated time [s]; a window that ends later is dropped."),
]


@app.command("list")
def list_experiments() -> None:
    """List the shipped experiments."""
    with _errors():
        out.print(experiments_table())


@app.command("arm")
def describe_arm(
    model: Annotated[
        str, typer.Argument(help="Name of a shipped arm, or a model file: URDF, SDF or MJCF.")
    ],
    frame: Annotated[
        str | None, typer.Option(help="Task frame E, or the frame that carries --tool.")
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(metavar="YAML", help="Tool to add, e.g. '{ball: 0.012, length: 0.1}'."),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Another key of the arm, e.g. mass_scale=1.1."
        ),
    ] = None,
    out_folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the picture.")
    ] = Path("out"),
    picture: Annotated[bool, typer.Option(help="Write a picture of the arm.")] = True,
) -> None:
    """Print an arm's joints, limits, reach, inertia and weight, and what is missing."""
    with _errors():
        fields = {} if frame is None else {"frame": frame}
        for change in changes or []:
            set_key(fields, *parse_change(change))
        if tool is not None:
            fields["tool"] = parse_yaml(tool, "--tool")
        report = arm_report(load_arm(model, **fields))
        out.print(arm_joints_table(report))
        out.print(arm_table(report))
        for warning in report.warnings:
            err.print(f"[yellow]warning[/] {escape(warning)}")
        if picture:
            file = out_folder / f"{report.arm.name}.png"
            _require_writable(out_folder)
            out.print(f"picture  {write_arm_picture(report.arm, report.home, file)}", markup=False)


@app.command()
def run(  # noqa: PLR0913  one argument for each option
    experiments: Annotated[
        list[str],
        typer.Argument(
            metavar="EXPERIMENT...", help="Names of shipped experiments, or YAML files."
        ),
    ],
    out_folder: Out = Path("out"),
    changes: Set = None,
    seed: Seed = None,
    duration: Duration = None,
    playback: Annotated[bool, typer.Option(help="Write playback.html.")] = True,
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EXPERIMENT",
            help="Run this one first, and show its path beside the others' in their playbacks; "
            "repeatable.",
        ),
    ] = None,
    check: Check = False,
    anyway: Anyway = False,
) -> None:
    """Run experiments; each gets a folder with metrics, figures and a playback."""
    first = beside or []
    names = [*first, *experiments]
    with _errors():
        if first and not playback:
            raise InvalidInputError("--beside: shows paths in a playback; leave out --no-playback")
        loaded = [_load_named(name, names, changes, seed, duration) for name in names]
        _check_all(loaded, names, out_folder, anyway)
    results: list[Result] = []
    for experiment, name in zip(loaded, names, strict=True):
        with _errors():
            _tell_of_window(name, _changes(changes, seed, duration))
            result = _run(experiment, anyway)
            others = results[: len(first)] if len(results) >= len(first) else ()
            _write(result, out_folder / experiment.name, playback, others)
            results.append(result)
        if result.status == "interrupted":
            break
    if skipped := [experiment.name for experiment in loaded[len(results) :]]:
        err.print(f"[red]not run[/] {escape(', '.join(skipped))}")
    if any(result.status != "complete" for result in results):
        raise typer.Exit(FAILED)
    if check and not all(verdict.met for result in results for verdict in result.verdicts):
        raise typer.Exit(NOT_MET)


def _run(experiment: Experiment, anyway: bool) -> Result:
    """Return the result of an experiment; up to its failure, which is printed, if it fails."""
    try:
        with _progress(experiment) as progress:
            return simulate(experiment, progress, anyway=anyway)
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(str(error))}")
        failed: Result = error.result
        return failed


@app.command("fastest")
def run_fastest(
    experiment: Annotated[
        str, typer.Argument(help="Name of a shipped experiment, or a YAML file.")
    ],
    out_folder: Out = Path("out"),
    changes: Set = None,
    playback: Annotated[bool, typer.Option(help="Write playback.html.")] = True,
) -> None:
    """Run a path as fast as the limits on all derivatives allow."""
    with _errors():
        loaded = _load(experiment, changes, None, None)
        folder = out_folder / f"{loaded.name}_fastest"
        _require_writable(folder)
        found = fastest(loaded, lambda text: err.print(escape(text)))
        _write(found.result, folder, playback)
    out.print(
        f"shortest duration {found.result.metrics['shortest_duration_s']:.4g} s, "
        f"{found.stretch:.4g} times the one asked for; limited by the {found.binding}"
    )


@app.command()
def sweep(
    experiment: Annotated[
        str, typer.Argument(help="Name of a shipped experiment, or a YAML file.")
    ],
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=v1,v2,...",
            help="Values of a key; repeat for all combinations. Default: those in the document.",
        ),
    ] = None,
    out_folder: Out = Path("out"),
    changes: Set = None,
    seed: Seed = None,
    duration: Duration = None,
    jobs: Annotated[int, typer.Option(min=1, help="Number of runs at a time.")] = 1,
    check: Check = False,
) -> None:
    """Run an experiment with several values; write a table, a CSV file and a figure."""
    with _errors():
        changed = _changes(changes, seed, duration)
        axes = _axes(over) or load_experiment(experiment, changed).document.over
        if not axes:
            raise InvalidInputError(f"--over: must be given; {experiment} has no values of its own")
        keys = list(axes)
        folder = out_folder / f"sweep_{Path(experiment).stem}_{'_'.join(keys)}"
        _require_writable(folder)

        def done(row: Row) -> None:
            values = ", ".join(f"{key}={v}" for key, v in zip(keys, row.values, strict=True))
            err.print(escape(f"{values}: {row.failure or 'done'}"))

        rows = run_sweep(experiment, axes, changed, jobs, done)
        write_csv(folder / "sweep.csv", keys, rows)
        pictures = [
            sweep_figure(keys, rows, varying_metrics(rows), folder / "sweep.png"),
            learning_figure(keys, rows, folder / "learning.png"),
        ]
    for length in axes.get("duration", [None]):
        swept = {} if length is None else {"duration": length}
        _tell_of_window(experiment, changed | swept)
    _print_sweep(keys, rows)
    out.print(escape(f"table    {folder / 'sweep.csv'}"), soft_wrap=True)
    for picture in filter(None, pictures):
        out.print(escape(f"picture  {picture}"), soft_wrap=True)
    if any(row.failure for row in rows):
        raise typer.Exit(FAILED)
    if check and any(row.not_met for row in rows):
        raise typer.Exit(NOT_MET)


@app.command()
def new(
    what: Annotated[Own, typer.Argument(help="What it is to be.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the module, e.g. my_law.")],
) -> None:
    """Write a module of your own, a document that names it and a test, to the current folder."""
    with _errors():
        for file in write_start(what, name, Path()):
            out.print(escape(f"written  {file}"), soft_wrap=True)
    out.print(f"next     drake-rnn run {name}.yaml; pytest test_{name}.py", soft_wrap=True)


@app.command("claims")
def show_claims(
    ids: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ID]...", help="Claims, e.g. slc-F2a, or schemes, e.g. slc."),
    ] = None,
    judge: Annotated[
        bool, typer.Option("--judge", help="Make the runs and print the verdicts.")
    ] = False,
) -> None:
    """List what the papers claim, or judge it."""
    with _errors():
        for paper, claims in chosen_claims(ids or []):
            if not judge:
                out.print(claims_table(paper, claims))
                continue
            judging = Judge(paper)
            for claim in claims:
                out.print(judgement_table(judging.judge(claim)))


def _axes(over: list[str] | None) -> dict[str, list[Any]]:
    """Return the values of all ``--over`` options, by key."""
    named = [parse_axis(text) for text in over or []]
    keys = [key for key, _ in named]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InvalidInputError(f"--over: {twice[0]!r} is given twice; give all its values at once")
    return dict(named)


def _print_sweep(keys: list[str], rows: list[Row]) -> None:
    # In a pipe or a file there is room for all columns in one table.
    wide = Console(width=WIDE, highlight=False)
    for table in sweep_tables(keys, rows, out.width if out.is_terminal else None):
        wide.print(table)


def main() -> None:
    """Run the command line ``drake-rnn``.

    Modules in the current folder can be named in a document, as with ``python -m``. The folder
    comes last, so that no file in it stands in for an installed module.
    """
    if not sys.flags.safe_path:
        sys.path.append(str(Path.cwd()))
    # What stops a job on a server stops it as Ctrl-C does: what it had is kept.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    app()


def _load_named(
    name: str,
    among: list[str],
    changes: list[str] | None,
    seed: int | None,
    duration: float | None,
) -> Experiment:
    """Return an experiment; an error names it if there are others."""
    with _named(name, among=among):
        return _load(name, changes, seed, duration)


def _check_all(
    experiments: list[Experiment], names: list[str], out_folder: Path, anyway: bool
) -> None:
    """Check everything before anything runs."""
    for experiment in experiments:
        _require_one_folder_each(experiment, experiments)
        with _named(experiment.name, among=names):
            check_experiment(experiment, anyway)
        _require_writable(out_folder / experiment.name)


def _load(
    name: str, changes: list[str] | None, seed: int | None, duration: float | None
) -> Experiment:
    return load_experiment(name, _changes(changes, seed, duration))


def _changes(
    changes: list[str] | None, seed: int | None, duration: float | None
) -> dict[str, object]:
    new: dict[str, object] = {}
    for change in changes or []:
        key, value = parse_change(change)
        if key in new:
            raise InvalidInputError(f"--set: {key} is given twice, as {new[key]!r} and {value!r}")
        new[key] = value
    if seed is not None:
        new["seed"] = seed
    if duration is not None:
        new["duration"] = duration
    return new


def _tell_of_window(name: str, changes: dict[str, Any]) -> None:
    """Print a note if the duration ends before the window and therefore drops it."""
    kept = {key: value for key, value in changes.items() if key != "duration"}
    before, now = read_document(name, kept), read_document(name, changes)
    lost = [key for key in ("window", "accept") if key in before and key not in now]
    if "window" not in lost:
        return
    what = "and the bounds of accept are" if "accept" in lost else "is"
    out.print(
        f"[yellow]note[/] {escape(str(now['name']))}: window {escape(str(before['window']))} s "
        f"{what} dropped: the run ends at {now['duration']:g} s",
        soft_wrap=True,
    )


def _write(result: Result, folder: Path, playback: bool, beside: Sequence[Result] = ()) -> None:
    """Write a result with its pictures, and print what came out."""
    for warning in result.warnings:
        err.print(f"[yellow]warning[/] {escape(warning)}")
    out.print(metrics_table(result))
    if (joints := joints_table(result)) is not None:
        out.print(joints)
    cost = result.timings["wall_time_s"]
    out.print(f"time      {result.record['until_s']:g} s simulated in {cost:.3g} s")
    with filled(folder, result.record):
        result.write(folder)
        _draw_diagram(folder / "diagram.dot")
        figures = write_figures(result, folder / "figures")
        out.print(escape(f"results   {folder}"), soft_wrap=True)
        out.print(escape(f"figures   {folder / 'figures'} ({len(figures)})"), soft_wrap=True)
        if playback and result.time.size > 1:
            others = [other for other in beside if other.time.size > 1]
            file, rate = folder / "playback.html", _frames_per_second(result)
            page = write_playback(result, file, rate, others)
            out.print(escape(f"playback  {page}"), soft_wrap=True)


def _frames_per_second(result: Result) -> int:
    """Return the playback's frame rate, lower for long runs to keep the page small."""
    return 64 if result.time[-1] <= 30.0 else 32


def _draw_diagram(dot: Path) -> None:
    if program := shutil.which("dot"):
        command = [program, "-Tsvg", str(dot), "-o", str(dot.with_suffix(".svg"))]
        subprocess.run(command, check=False, capture_output=True)


@contextmanager
def _named(name: str, among: list[str]) -> Iterator[None]:
    """Add the experiment's name to errors if there are several experiments."""
    try:
        yield
    except InvalidInputError as error:
        if len(among) == 1:
            raise
        raise InvalidInputError(f"{name}: {error}") from None


def _require_one_folder_each(experiment: Experiment, among: list[Experiment]) -> None:
    if sum(other.name == experiment.name for other in among) > 1:
        raise InvalidInputError(
            f"name: two experiments are called {experiment.name!r}; one would overwrite the other"
        )


def _require_writable(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"--out: {folder}: {error.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidInputError(f"--out: {folder}: not writable")


@contextmanager
def _errors() -> Iterator[None]:
    """Turn this package's errors into a message and an exit status, without a traceback."""
    try:
        yield
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(str(error))}")
        raise typer.Exit(FAILED) from error
    except (DrakeRnnError, OSError) as error:
        err.print(f"[red]error[/] {escape(str(error))}")
        raise typer.Exit(BAD_INPUT) from error


@contextmanager
def _progress(experiment: Experiment) -> Iterator[ProgressCallback | None]:
    """Show a progress bar on a terminal, nothing elsewhere."""
    if not err.is_terminal:
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
        began = perf_counter()

        def progress(t: float) -> None:
            speed = t / max(perf_counter() - began, 1e-9)
            bar.update(task, completed=t, speed=f"{speed:.1f} x real time")

        yield progress
