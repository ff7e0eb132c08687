"""Running experiments."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ..errors import InvalidInputError, SimulationError
from ..experiment import Experiment
from ..runs.fastest import fastest
from ..runs.result import Result
from ..runs.simulation import check_experiment, simulate
from .console import FAILED, NOT_MET, err, errors, out, progress_bar
from .options import (
    Anyway,
    Check,
    Duration,
    One,
    Out,
    Seed,
    Set,
    Several,
    changes_of,
    load,
    require_writable,
    tell_of_window,
)
from .saving import Pictures, write_result


def run(  # noqa: PLR0913  one argument for each option
    experiments: Several,
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
    with errors():
        loaded = [_load_named(name, names, changes, seed, duration) for name in names]
        _check_all(loaded, names, out_folder, anyway)
    results: list[Result] = []
    for experiment, name in zip(loaded, names, strict=True):
        with errors():
            tell_of_window(name, changes_of(changes, seed, duration))
            result = _run(experiment, anyway)
            others = results[: len(first)] if len(results) >= len(first) else ()
            write_result(result, out_folder / experiment.name, Pictures(playback=playback), others)
            results.append(result)
        if result.status == "interrupted":
            break
    if skipped := [experiment.name for experiment in loaded[len(results) :]]:
        err.print(f"[red]not run[/] {escape(', '.join(skipped))}")
    if any(result.status != "complete" for result in results):
        raise typer.Exit(FAILED)
    if check and not all(verdict.met for result in results for verdict in result.verdicts):
        raise typer.Exit(NOT_MET)


def run_fastest(
    experiment: One,
    out_folder: Out = Path("out"),
    changes: Set = None,
    playback: Annotated[bool, typer.Option(help="Write playback.html.")] = True,
) -> None:
    """Run a path as fast as the limits on all derivatives allow."""
    with errors():
        loaded = load(experiment, changes, None, None)
        folder = out_folder / f"{loaded.name}_fastest"
        require_writable(folder)
        found = fastest(loaded, lambda text: err.print(escape(text)))
        write_result(found.result, folder, Pictures(playback=playback))
    out.print(
        f"shortest duration {found.result.metrics['shortest_duration_s']:.4g} s, "
        f"{found.stretch:.4g} times the one asked for; limited by the {found.binding}"
    )


def _run(experiment: Experiment, anyway: bool) -> Result:
    """Return the result of an experiment; up to its failure, which is printed, if it fails."""
    try:
        with progress_bar(experiment) as progress:
            return simulate(experiment, progress, anyway=anyway)
    except SimulationError as error:
        err.print(f"[red]failed[/] {escape(str(error))}")
        failed: Result = error.result
        return failed


def _load_named(
    name: str,
    among: list[str],
    changes: list[str] | None,
    seed: int | None,
    duration: float | None,
) -> Experiment:
    """Return an experiment; an error names it if there are others."""
    with named(name, among=among):
        return load(name, changes, seed, duration)


def _check_all(
    experiments: list[Experiment], names: list[str], out_folder: Path, anyway: bool
) -> None:
    """Check everything before anything runs."""
    for experiment in experiments:
        _require_one_folder_each(experiment, experiments)
        with named(experiment.name, among=names):
            check_experiment(experiment, anyway)
        require_writable(out_folder / experiment.name)


@contextmanager
def named(name: str, among: list[str]) -> Iterator[None]:
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
