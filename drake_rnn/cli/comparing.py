"""Runs side by side: one table of their metrics, one figure of their errors.

- Tuning of gains.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import typer
from rich.markup import escape

from ..errors import InterruptedRunError, InvalidInputError
from ..experiment import Experiment, load_experiment, read_document
from ..figures import drawn_for
from ..figures.campaign import groups_figure, tuning_figure
from ..figures.comparison import comparison_figure
from ..inputs.documents import to_yaml
from ..inputs.files import is_file
from ..inputs.messages import drawn_of
from ..inputs.packages import import_extra
from ..jobs.campaign import write_csv
from ..jobs.plan import StatisticsSettings
from ..jobs.requests import Row, RunRecord, RunRequest
from ..jobs.summary import Line, group_campaigns, group_lines, telling_metrics, write_lines
from ..measures import METRICS
from ..runs.checkpoint import require_ended
from ..runs.folder import written_whole
from ..runs.result import (
    Result,
    Verdict,
    bound_text,
    hyphened,
    is_noise,
    name_with_ending,
    value_text,
)
from ..runs.simulation import check_experiment, effort_of
from ..tables import Cell, Column, Heading, Sheet, metric_heading
from ..tuning import Between, Trial, Tuning, TuningOutcome, parse_between
from .arguments import Compare, Tune
from .campaigning import (
    KeptCampaign,
    campaign_in,
    is_campaign,
    keys_by,
    print_groups,
    require_metrics,
    spreads_by_name,
)
from .console import err, errors, finish, out, silence, status
from .running import print_data, run_here, told_of
from .saving import changes_of, claimed_folder, paper_of, simulate_or_print, tell_of_window
from .starting import INTERRUPTED
from .tables import (
    chosen_metrics,
    groups_sheet,
    print_sheet,
    require_tables,
    split_words,
    unfinished_cell,
    write_tables,
)

# Quantiles of campaigns whose documents name none.
_QUANTILES = StatisticsSettings().quantiles
# Most characters of a warning that was told in full when its run was made.
_WARNING = 100
# Names that a folder of a comparison is called after.
_MOST_NAMES = 3

Run = TypeVar("Run", Result, Experiment | Result)
Named = TypeVar("Named")


def compare(args: Compare) -> None:
    """Compare runs, of which experiments are run first."""
    with silence(args.quiet or args.as_json), errors():
        require_tables(args.tables)
        metrics = chosen_metrics(args.metrics)
        paper_of(args)
        changes = changes_of(args.changes, args.seed, args.duration)
        if any(map(is_campaign, args.runs)):
            _compare_campaigns(args, metrics, changes)
            return
        if args.by is not None:
            raise InvalidInputError("--by: groups rows of campaigns, and none of these is one")
        run_results = label(args.runs, [_load(run, changes) for run in args.runs])
        folder = args.out_folder / compared_folder(list(run_results))
        run_results = relabel(run_results, args.labels)
        for run, each in zip(args.runs, run_results.values(), strict=True):
            if isinstance(each, Experiment):
                tell_of_window(run, changes)
        if args.dry_run:
            _print_plan(run_results, folder, args.as_json)
            return
        with claimed_folder(folder, "comparison.csv", f"comparison.{args.form}"):
            results = _results(run_results)
            saved = {name for name, each in run_results.items() if isinstance(each, Result)}
            _print_and_write(results, saved, folder, comparison_sheet(results, metrics), args)
        if args.as_json:
            print_data({name: {"metrics": r.metrics, **r.record} for name, r in results.items()})
    finish(
        all(result.status == "complete" for result in results.values()),
        not args.check or all(result.keeps_bounds for result in results.values()),
    )


def _compare_campaigns(args: Compare, metrics: list[str], changes: Mapping[str, Any]) -> None:
    """Compare campaigns that were kept, and results, each of which counts as one run."""
    if twice := [run for run in args.runs if args.runs.count(run) > 1]:
        raise InvalidInputError(f"compare: {twice[0]} is given twice")
    campaigns: dict[str, KeptCampaign] = {}
    for run in args.runs:
        each = _campaign_of(run, changes)
        campaigns[each.name if each.name not in campaigns else run] = each
    campaigns = relabel(campaigns, args.labels)
    rows = {name: each.lines for name, each in campaigns.items()}
    require_metrics(metrics, ", ".join(rows), [each for lines in rows.values() for each in lines])
    completed_lines = [line for lines in rows.values() for line in lines if line.record.complete]
    own = list(dict.fromkeys(name for each in campaigns.values() for name in each.metrics))
    names = metrics or own or telling_metrics(completed_lines)
    quantiles = next((each.quantiles for each in campaigns.values() if each.quantiles), [])
    by = keys_by(args)
    groups = group_campaigns(rows, by, names, quantiles or _QUANTILES)
    sheet = groups_sheet([*by, "run"], groups, names, args.statistic)
    folder, paper = args.out_folder / compared_folder(list(rows)), paper_of(args)
    with claimed_folder(folder, "comparison.csv", f"comparison.{paper.form}"):
        print_groups(sheet, len(by) + 1)
        head, *others = group_lines([*by, "run"], groups)
        write_lines(folder / "comparison.csv", head, others)
        out.print(escape(f"table    {folder / 'comparison.csv'}"), soft_wrap=True)
        with drawn_for(paper), drawn_of("comparison"):
            file = folder / f"comparison.{paper.form}"
            if groups_figure(spreads_by_name(groups), names, args.statistic, file):
                out.print(escape(f"picture  {file}"), soft_wrap=True)
    write_tables(sheet, args.tables)


def _campaign_of(run: str, changes: Mapping[str, Any]) -> KeptCampaign:
    """Return a campaign that was kept, or a result as one of a single row."""
    if is_campaign(run):
        if changes:
            raise InvalidInputError(f"{next(iter(changes))}: {run} is a campaign that has run")
        return campaign_in(run)
    if not Path(run).exists():
        raise InvalidInputError(
            f"compare: {run}: there is no such folder; beside a campaign, give folders of runs or "
            "campaigns"
        )
    require_ended(Path(run))
    if not is_file(Path(run, "experiment.yaml")):
        raise InvalidInputError(f"compare: {run}: beside a campaign, give the folder of a run")
    result = _load_result(run, changes)
    line = Line(0, {}, RunRecord.of_result(result))
    return KeptCampaign(result.experiment.name, [line], [], [])


def compared_folder(names: list[str]) -> str:
    """Return the name of the folder of a comparison."""
    rest = [f"{len(names) - _MOST_NAMES}_more"] if len(names) > _MOST_NAMES else []
    return "_".join(["compare", *(Path(name).name for name in names[:_MOST_NAMES]), *rest])


def _print_plan(results: Mapping[str, Experiment | Result], folder: Path, as_json: bool) -> None:
    plan: dict[str, float | None] = {}
    for name, each in results.items():
        if isinstance(each, Result):
            plan[name], text = 0.0, "has run"
        else:
            effort = effort_of(each.document)
            plan[name], text = effort.time if effort.key else None, told_of(effort)
        out.print(escape(f"{name}: {text}"), soft_wrap=True)
    out.print(escape(f"compared in {folder}"), soft_wrap=True)
    if as_json:
        print_data({"folder": str(folder), "expected_time_s": plan})


def _load(run: str, changes: Mapping[str, object]) -> Experiment | Result:
    """Return an experiment that is ready to run, or a result that a folder holds."""
    if not is_file(Path(run, "experiment.yaml")):
        require_ended(Path(run))
        experiment = load_experiment(run, changes)
        check_experiment(experiment)
        return experiment
    for key in changes:
        if key in ("seed", "duration"):
            raise InvalidInputError(f"{key}: {run} is a saved result, which cannot be changed")
    return _load_result(run, changes)


def saved_result(folder: str | Path, changes: list[str] | None) -> Result:
    """Return the result in a folder; what is not as it was in the run is told.

    Args:
        folder: The folder.
        changes: Options ``--set`` that name files.
    """
    return _load_result(folder, changes_of(changes))


def _load_result(folder: str | Path, files: Mapping[str, Any]) -> Result:
    with warnings.catch_warnings(record=True) as raised_warnings:
        warnings.simplefilter("always", UserWarning)
        result = Result.load(folder, modules=True, files=files)
    for each in raised_warnings:
        err.print(f"[yellow]note[/] {escape(str(each.message))}", soft_wrap=True)
    if result.ending:
        text = f"{name_with_ending(str(folder), result)}: {result.failure}".rstrip(": ")
        err.print(f"[red]not complete[/] {escape(text)}", soft_wrap=True)
    return result


def label(runs: list[str], results: list[Run]) -> dict[str, Run]:
    """Return runs by their experiments' names, or as they were given if names are the same.

    Raises:
        InvalidInputError: If there is only one run, or one is given twice.
    """
    if len(runs) < 2:
        raise InvalidInputError("compare: needs two runs or more")
    if twice := [run for run in runs if runs.count(run) > 1]:
        raise InvalidInputError(f"compare: {twice[0]} is given twice")
    names = [each.experiment.name if isinstance(each, Result) else each.name for each in results]
    alike = len(set(names)) < len(names)
    return dict(zip(runs if alike else names, results, strict=True))


def relabel(results: Mapping[str, Named], labels: str | None) -> dict[str, Named]:
    """Return runs by the names of ``--labels``, or as they are without it.

    Raises:
        InvalidInputError: If there are not as many names as runs, or two are the same.
    """
    names = list(results) if labels is None else split_words(labels)
    if len(names) != len(results):
        raise InvalidInputError(
            f"--labels: must have one name for each of {len(results)} runs, not {len(names)}"
        )
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInputError(f"--labels: {twice[0]!r} is given twice")
    return dict(zip(names, results.values(), strict=True))


def _results(runs_or_experiments: Mapping[str, Experiment | Result]) -> dict[str, Result]:
    """Return the results by name; leave the command if a run is interrupted."""
    experiments = {
        name: each for name, each in runs_or_experiments.items() if isinstance(each, Experiment)
    }
    results: dict[str, Result] = {}

    def make(request: RunRequest) -> Result:
        results[request.key] = simulate_or_print(experiments[request.key])
        return results[request.key]

    records = run_here([RunRequest(name, {}) for name in experiments], make)
    if any(record.status == "interrupted" for record in records.values()):
        if left := [name for name in experiments if name not in records]:
            err.print(f"[red]not run[/] {escape(', '.join(left))}")
        raise typer.Exit(INTERRUPTED)
    return {
        name: results[name] if isinstance(each, Experiment) else each
        for name, each in runs_or_experiments.items()
    }


def _print_and_write(
    results: dict[str, Result], saved: set[str], folder: Path, sheet: Sheet, args: Compare
) -> None:
    for names, warning in _warnings(results, saved):
        err.print(f"[yellow]warning[/] {escape(f'{names}: {warning}')}", soft_wrap=True)
    print_sheet(sheet)
    rows = [
        Row((name,), each.metrics, each.failure or each.ending or None)
        for name, each in results.items()
    ]
    write_csv(folder / "comparison.csv", ["run"], rows)
    out.print(escape(f"table    {folder / 'comparison.csv'}"), soft_wrap=True)
    write_tables(sheet, args.tables)
    if all(result.time.size > 1 for result in results.values()):
        paper = paper_of(args)
        with drawn_for(paper), drawn_of("comparison"):
            picture = comparison_figure({"": results}, folder / f"comparison.{paper.form}")
        out.print(escape(f"picture  {picture}"), soft_wrap=True)


def _warnings(results: Mapping[str, Result], saved: set[str]) -> Iterator[tuple[str, str]]:
    """Yield warnings of runs, each once, with the names of the runs that have it.

    Those of saved runs alone, which were told in full, are short.
    """
    names: dict[str, list[str]] = {}
    for name, result in results.items():
        for warning in dict.fromkeys(result.warnings):
            names.setdefault(warning, []).append(name)
    for warning, runs in names.items():
        is_new = len(warning) <= _WARNING or not saved.issuperset(runs)
        yield ", ".join(runs), warning if is_new else f"{warning[: _WARNING - 1].rstrip()}…"


def comparison_sheet(results: Mapping[str, Result], metrics: Sequence[str] = ()) -> Sheet:
    """Return a table with a column for each run: its metrics, and the bounds they should keep.

    Args:
        results: The runs by the names that they are called by.
        metrics: Names of the metrics, in their order; by default all that any run has.
    """
    verdicts = {
        name: {verdict.metric: verdict for verdict in result.verdicts}
        for name, result in results.items()
    }
    runs = tuple(
        Column(Heading(name_with_ending(name, each)), right=True) for name, each in results.items()
    )
    sheet = Sheet((Column(Heading("metric")), *runs))
    known = {name for n, each in results.items() for name in (*each.metrics, *verdicts[n])}
    for metric in metrics or METRICS.names:
        cells = [
            unfinished_cell(result.status)
            if result.ending
            else _cell(metric, result.metrics.get(metric), verdicts[name].get(metric))
            for name, result in results.items()
        ]
        if metrics or metric in known:
            sheet.rows.append((metric_heading(metric), *cells))
    return sheet


def _cell(metric: str, value: float | None, verdict: Verdict | None) -> Cell | str:
    """Return a value with its bound, without rounding errors; an empty text without either."""
    if value is None and verdict is None:
        return ""
    bound = None if verdict is None else verdict.bound
    text = value_text(metric, value, bound)
    # As a run prints it: a value that was not reached, or a violation that is none.
    numbers, form = ((), text) if value is None or text == "none" else ((value,), "{}")
    if numbers and is_noise(metric, numbers[0], bound):
        numbers = (0.0,)
    if verdict is None:
        return Cell(numbers, form)
    return Cell(numbers, form, hyphened(bound_text(metric, verdict.bound)), verdict.met)


def tune_gains(args: Tune) -> None:
    """Tune gains of a law, and write the document with them."""
    with silence(args.quiet), errors(), ExitStack() as claims:
        import_extra("tune", "jax", "jax")
        keys = [key.strip() for text in args.numbers for key in text.split(",")]
        bounds = _bounds(args.between)
        changes = changes_of(args.changes, args.seed)
        experiment = load_experiment(args.experiment, changes)
        for warning in check_experiment(experiment):
            err.print(f"[yellow]warning[/] {escape(warning)}")
        tuning = Tuning(experiment, keys, args.least, between=bounds, duration=args.duration)
        folder = args.out_folder / f"tune_{experiment.name}_{'_'.join(keys)}"
        claims.enter_context(claimed_folder(folder, "tuned.yaml", "tuning.png"))
        if args.duration is not None:
            tell_of_window(args.experiment, changes | {"duration": args.duration})
        # What an earlier call has found must not stand beside the figure of this one.
        (folder / "tuned.yaml").unlink(missing_ok=True)
        with _left_at_once(), status(f"{experiment.name}: tuning"):
            tuning_result = tuning.run(args.steps, _tell)
        _print(tuning_result)
        if tuning_result.better:
            name_change = {"name": f"{experiment.name}_tuned"}
            _write(
                read_document(args.experiment, {**changes, **tuning_result.gains, **name_change}),
                folder,
            )
        if args.figures:
            picture = tuning_figure(tuning_result, folder / "tuning.png")
            out.print(escape(f"picture  {picture}"), soft_wrap=True)
    finish(True, tuning_result.better or not args.check)


@contextmanager
def _left_at_once() -> Iterator[None]:
    """End this process when it is interrupted, while JAX computes on in threads of its own.

    To take these down in the usual way ends in a crash.
    """
    try:
        yield
    except (KeyboardInterrupt, InterruptedRunError):
        err.print("interrupted: nothing was written")
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(INTERRUPTED)


def _bounds(between: list[str] | None) -> dict[str, Between]:
    """Return the bounds of all ``--between`` options, by key."""
    bounds: dict[str, Between] = {}
    for text in between or []:
        key, pair = parse_between(text)
        if key in bounds:
            raise InvalidInputError(f"--between: {key} is given twice")
        bounds[key] = pair
    return bounds


def _write(document: Mapping[str, Any], folder: Path) -> None:
    """Write the tuned document."""
    file = folder / "tuned.yaml"
    with written_whole(file) as stream:
        stream.write(to_yaml(document))
    out.print(escape(f"document {file}"), soft_wrap=True)


def _tell(trial: Trial) -> None:
    if not out.quiet:
        gains = ", ".join(f"{key}={value:.6g}" for key, value in trial.gains.items())
        err.print(escape(f"{trial.value:.6g} with {gains}"))


def _print(outcome: TuningOutcome) -> None:
    text = ", ".join(outcome.stopped_by)
    if not outcome.better:
        why = f"; others break the bound of {text}" if text else ""
        err.print(f"[yellow]not tuned[/] descent found no gains that reduce {outcome.metric}{why}")
        return
    if outcome.chosen < len(outcome.history) - 1:
        why = f"break the bound of {text}" if text else "are no better in Drake's runs"
        steps = f"step {outcome.chosen:g} of {len(outcome.history) - 1}"
        note = f"[yellow]note[/] gains beyond {steps} {why}, and were not taken"
        out.print(note, soft_wrap=True)
    print_sheet(comparison_sheet({"before": outcome.before, "tuned": outcome.after}))
    before, after = (
        value_text(outcome.metric, run.metrics[outcome.metric])
        for run in (outcome.before, outcome.after)
    )
    out.print(f"{outcome.metric}: {before} before, {after} tuned, both run by Drake")
    gains = ", ".join(f"{key}={value:g}" for key, value in outcome.gains.items())
    out.print(escape(f"gains    {gains}"), soft_wrap=True)
