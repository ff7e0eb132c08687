"""Running experiments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..runs.fastest import check_stretchable, fastest
from ..runs.simulation import check_experiment
from ..runs.stored import Series
from .announcing import print_json, print_plan
from .console import FAILED, NOT_MET, err, errors, out, silenced
from .options import (
    Anyway,
    AsJson,
    Beside,
    Check,
    DryRun,
    Duration,
    Figures,
    Jobs,
    One,
    Out,
    Playback,
    Quiet,
    Seed,
    Set,
    Several,
    StoredSeries,
    changes_of,
    load,
    require_writable,
)
from .queue import Outcome, Task, run_at_once, run_in_turn
from .saving import Pictures, write_result


def run(  # noqa: PLR0913  one argument for each option
    experiments: Several,
    out_folder: Out = Path("out"),
    changes: Set = None,
    seed: Seed = None,
    duration: Duration = None,
    figures: Figures = True,
    playback: Playback = True,
    beside: Beside = None,
    jobs: Jobs = 1,
    check: Check = False,
    anyway: Anyway = False,
    series: StoredSeries = "full",
    quiet: Quiet = False,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run experiments; each gets a folder with metrics, figures and a playback."""
    first = beside or []
    names = [*first, *experiments]
    with silenced(quiet or as_json):
        with errors():
            if first:
                _require_beside_is_possible(playback, jobs, series)
            changed = changes_of(changes, seed, duration)
            loaded = [_load_named(name, names, changed) for name in names]
            warnings = _check_all(loaded, names, anyway, series)
            tasks = [
                Task(
                    name,
                    experiment.name,
                    changed,
                    out_folder / experiment.name,
                    Pictures(figures, playback),
                    anyway,
                    series,
                )
                for name, experiment in zip(names, loaded, strict=True)
            ]
            if not dry_run:
                for task in tasks:
                    require_writable(task.folder)
        if dry_run:
            print_plan(tasks, loaded, warnings, as_json)
            return
        outcomes = run_at_once(tasks, jobs) if jobs > 1 else run_in_turn(tasks, loaded, len(first))
    if as_json:
        print_json(outcomes)
    _exit(tasks, outcomes, check)


def _require_beside_is_possible(playback: bool, jobs: int, series: Series) -> None:
    """Refuse --beside where no playback would show it, or no run could wait for it."""
    if jobs > 1:
        raise InvalidInputError("--jobs: cannot be combined with --beside")
    if not playback:
        raise InvalidInputError("--beside: shows paths in a playback; leave out --no-playback")
    if series == "none":
        raise InvalidInputError("--beside: shows paths, and --series none stores none")


def _exit(tasks: list[Task], outcomes: list[Outcome], check: bool) -> None:
    """End with the status that fits, unless all is well; name what was not run."""
    ran = {outcome.name for outcome in outcomes}
    if skipped := [task.name for task in tasks if task.name not in ran]:
        err.print(f"[red]not run[/] {escape(', '.join(skipped))}")
    if skipped or not all(outcome.complete for outcome in outcomes):
        raise typer.Exit(FAILED)
    if check and not all(outcome.met for outcome in outcomes):
        raise typer.Exit(NOT_MET)


def run_fastest(
    experiment: One,
    out_folder: Out = Path("out"),
    changes: Set = None,
    figures: Figures = True,
    playback: Playback = True,
) -> None:
    """Run a path as fast as the limits on all derivatives allow."""
    with errors():
        loaded = load(experiment, changes, None, None)
        check_stretchable(loaded)
        folder = out_folder / f"{loaded.name}_fastest"
        require_writable(folder)
        found = fastest(loaded, lambda text: err.print(escape(text)))
        write_result(found.result, folder, Pictures(figures, playback))
    out.print(
        f"shortest duration {found.result.metrics['shortest_duration_s']:.4g} s, "
        f"{found.stretch:.4g} times the one asked for; limited by the {found.binding}"
    )


def _load_named(name: str, among: list[str], changes: Mapping[str, object]) -> Experiment:
    """Return an experiment; an error names it if there are others."""
    with named(name, among=among):
        return load_experiment(name, changes)


def _check_all(
    experiments: list[Experiment], names: list[str], anyway: bool, series: Series
) -> list[list[str]]:
    """Check everything before anything runs; return the warnings about each."""
    warnings = []
    for experiment in experiments:
        _require_one_folder_each(experiment, experiments)
        with named(experiment.name, among=names):
            warnings.append(check_experiment(experiment, anyway, series))
    return warnings


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
