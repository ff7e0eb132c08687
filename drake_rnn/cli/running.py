"""Running experiments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..playback.arm_drawing import require_looks
from ..runs.fastest import check_stretchable, fastest
from ..runs.simulation import check_experiment
from .arguments import Fastest, Run
from .changing import changes_of, claimed_folder
from .console import err, errors, finish, out, silenced
from .queue import Outcome, Task, go_on, print_data, print_plan, run_at_once, run_in_turn
from .saving import Pictures, write_result


def run(asked: Run) -> None:
    """Run experiments, one after another or several at a time; or go on with a run."""
    with silenced(asked.quiet or asked.as_json):
        if asked.resume is None:
            begun = _begun(asked)
        else:
            with errors():
                _require_alone(asked)
            begun = [go_on(asked.resume, Pictures(asked.figures, asked.playback))], []
    if begun is None:
        return
    outcomes, skipped = begun
    if asked.as_json:
        print_data(
            {
                each.name: {"folder": str(each.folder), "metrics": each.metrics, **each.record}
                for each in outcomes
            }
        )
    if skipped:
        err.print(f"[red]not run[/] {escape(', '.join(skipped))}")
    finish(
        not skipped and all(outcome.complete for outcome in outcomes),
        not asked.check or all(outcome.met for outcome in outcomes),
    )


def _begun(asked: Run) -> tuple[list[Outcome], list[str]] | None:
    """Run experiments; return outcomes and names of those not run, None if none was to run."""
    first = asked.beside or []
    names = [*first, *(asked.experiments or [])]
    with errors():
        if not asked.experiments:
            raise InvalidInputError("EXPERIMENT: must be given, or a run's folder with --resume")
        if first:
            _require_beside_is_possible(asked)
        changed = changes_of(asked.changes, asked.seed, asked.duration)
        loaded = []
        for name in names:
            with named(name, among=names):
                loaded.append(load_experiment(name, changed))
        warnings = _check_all(loaded, names, asked)
        if asked.playback:
            _require_looks(loaded, names)
        tasks = [
            _task(asked, name, experiment.name, changed)
            for name, experiment in zip(names, loaded, strict=True)
        ]
        if asked.dry_run:
            print_plan(tasks, loaded, warnings, asked.as_json)
            return None
        claims = _claim(tasks, together=asked.jobs == 1)
    with claims:
        if asked.jobs > 1:
            outcomes = run_at_once(tasks, asked.jobs)
        else:
            outcomes = run_in_turn(tasks, loaded, len(first))
    ran = {outcome.name for outcome in outcomes}
    return outcomes, [task.name for task in tasks if task.name not in ran]


def _claim(tasks: Sequence[Task], together: bool) -> ExitStack:
    """Claim the folders of tasks before anything runs; return what gives them back.

    Args:
        tasks: The tasks.
        together: Whether they are run in this process; other ones claim them anew.
    """
    with ExitStack() as claims:
        for task in tasks:
            claims.enter_context(claimed_folder(task.folder, filled=True))
        if together:
            return claims.pop_all()
    return claims


def _require_looks(experiments: list[Experiment], names: list[str]) -> None:
    """Refuse looks that no playback could show, before anything runs."""
    for name, experiment in zip(names, experiments, strict=True):
        second = experiment.second
        for arm in [experiment.arm, *([second.arm] if second else [])]:
            if arm.looks is not None:
                with named(name, among=names):
                    require_looks(arm)


def _require_alone(asked: Run) -> None:
    """Refuse what --resume takes from the run that it goes on with."""
    for option, given in (
        ("EXPERIMENT", asked.experiments),
        ("--set", asked.changes),
        ("--seed", asked.seed is not None),
        ("--duration", asked.duration is not None),
        ("--series", asked.series != "full"),
        ("--out", asked.out_folder != Path("out")),
        ("--beside", asked.beside),
        ("--jobs", asked.jobs > 1),
        ("--dry-run", asked.dry_run),
    ):
        if given:
            raise InvalidInputError(
                f"{option}: cannot be combined with --resume, which goes on with the run as it was"
            )


def _task(asked: Run, experiment: str, name: str, changes: dict[str, Any]) -> Task:
    return Task(
        experiment=experiment,
        name=name,
        changes=changes,
        folder=asked.out_folder / name,
        pictures=Pictures(asked.figures, asked.playback),
        anyway=asked.anyway,
        series=asked.series,
    )


def _require_beside_is_possible(asked: Run) -> None:
    """Refuse --beside where no playback would show it, or no run could wait for it."""
    if asked.jobs > 1:
        raise InvalidInputError("--jobs: cannot be combined with --beside")
    if not asked.playback:
        raise InvalidInputError("--beside: shows paths in a playback; leave out --no-playback")
    if asked.series == "none":
        raise InvalidInputError("--beside: shows paths, and --series none stores none")


def run_fastest(asked: Fastest) -> None:
    """Run a path as fast as the limits on all derivatives allow."""
    with errors():
        loaded = load_experiment(asked.experiment, changes_of(asked.changes))
        check_stretchable(loaded)
        folder = asked.out_folder / f"{loaded.name}_fastest"
        with claimed_folder(folder, filled=True):
            found = fastest(loaded, lambda text: err.print(escape(text)))
            write_result(found.result, folder, Pictures(asked.figures, asked.playback))
    out.print(
        f"shortest duration {found.result.metrics['shortest_duration_s']:.4g} s, "
        f"{found.stretch:.4g} times the document's; limited by the {found.binding}"
    )


def _check_all(experiments: list[Experiment], names: list[str], asked: Run) -> list[list[str]]:
    """Check everything before anything runs; return the warnings about each."""
    warnings = []
    for experiment in experiments:
        if sum(other.name == experiment.name for other in experiments) > 1:
            raise InvalidInputError(
                f"name: two experiments are called {experiment.name!r}; one would overwrite the "
                "other"
            )
        with named(experiment.name, among=names):
            warnings.append(check_experiment(experiment, asked.anyway, asked.series))
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
