"""Campaigns and sweeps.

- Campaigns.
- What a terminal shows of a campaign: how far it is, and what came out.
- Sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import load_experiment, read_document, unit_of_key
from ..figures import Paper, drawn_for
from ..figures.campaign import (
    groups_figure,
    interval_text,
    learning_figure,
    strongest,
    sweep_figure,
    write_campaign_figures,
    write_campaign_page,
)
from ..figures.style import current
from ..inputs.documents import construct, read_yaml
from ..inputs.files import is_file
from ..inputs.messages import drawn_of, nearest, plural, short
from ..jobs import CampaignResult, Plan, cluster_at, plan_campaign, plan_sweep, read_campaign
from ..jobs.campaign import InterruptedSweepError, parse_axis, run_campaign, run_sweep, write_csv
from ..jobs.plan import StatisticsSettings
from ..jobs.pool import Jobs, require_address
from ..jobs.requests import RecordStore, Row, RunRecord
from ..jobs.summary import (
    Group,
    Interval,
    Line,
    Spread,
    Statistic,
    Summary,
    format_values,
    group_by,
    group_lines,
    metrics_in,
    read_lines,
    telling_metrics,
    write_lines,
)
from ..measures import METRICS
from ..tables import Cell, Column, Heading, Sheet, metric_heading
from .arguments import Campaign, Compare, Sweep
from .console import err, errors, finish, out, print_table, silence, status
from .running import jobs_progress, print_data
from .saving import changes_of, claimed_folder, paper_of, tell_of_window
from .tables import (
    chosen_metrics,
    groups_sheet,
    print_sheet,
    require_tables,
    split_words,
    sweep_sheet,
    terminal_table,
    varying_metrics,
    write_tables,
)


def status_text(result: CampaignResult) -> str:
    """Return in one line how many rows there are, and how they ended."""
    parts = [f"{count} {status}" for status, count in result.summary.statuses.items()]
    if result.missing:
        parts.append(f"{result.missing} not run")
    if count := result.summary.methods.get("batch", 0):
        parts.append(f"{count} in batches")
    before = f", {result.kept} of them from before" if result.kept else ""
    return f"{plural(len(result.plan.rows), 'row')}: {', '.join(parts)}{before}"


def shares_sheet(summary: Summary) -> Sheet:
    """Return a table of the shares of rows that keep bounds."""
    share = Heading(f"share of the rows [{summary.confidence:.0%}]")
    sheet = Sheet((Column(Heading("keeps")), Column(share, right=True)))
    for name, interval in summary.shares.items():
        sheet.rows.append((name, interval_text(interval, percent=True)))
    return sheet


def statistics_sheet(summary: Summary) -> Sheet:
    """Return a table of the metrics, without rows if there are none."""
    quantiles = summary.metrics[0].quantiles if summary.metrics else ()
    columns = [f"{probability:g} quantile" for probability in quantiles]
    columns += ["worst", "row", "strongest correlation"]
    sheet = Sheet(
        (Column(Heading("metric")), *(Column(Heading(each), right=True) for each in columns))
    )
    for metric in summary.metrics:
        worst = metric.worst[0] if metric.worst else None
        key = strongest(metric)
        sheet.rows.append(
            (
                metric_heading(metric.name),
                *map(interval_cell, metric.quantiles.values()),
                "-" if worst is None else Cell((worst.value,)),
                "-" if worst is None else str(worst.row),
                f"{key} ({metric.correlations[key]:.2f})" if key else "-",
            )
        )
    return sheet


def written_sheet(summary: Summary) -> Sheet:
    """Return the table of a campaign for a page: the metrics, and how many rows keep each bound."""
    shares, sheet = dict(summary.shares), statistics_sheet(summary)
    bound_column = Column(
        Heading(f"rows that keep its bound [{summary.confidence:.0%}]"), right=True
    )
    rows = []
    for metric, row in zip(summary.metrics, sheet.rows, strict=True):
        share = shares.pop(metric.name, None)
        rows.append((*row, "" if share is None else interval_text(share, percent=True)))
    for name, share in shares.items():
        empty = ("",) * (len(sheet.columns) - 1)
        rows.append((metric_heading(name), *empty, interval_text(share, percent=True)))
    title = f"{summary.name}, {summary.rows} rows"
    return Sheet((*sheet.columns, bound_column), rows, title)


def interval_cell(interval: Interval) -> Cell:
    """Return an estimate with its bounds; bounds that are not known are left out."""
    bounds = (interval.low, interval.high)
    finite = tuple(bound for bound in bounds if not math.isinf(bound))
    low, high = ("?" if math.isinf(bound) else "{}" for bound in bounds)
    return Cell((interval.value, *finite), f"{{}} [{low}, {high}]")


# Files that a campaign writes, besides rows and figures.
_TABLE = "table.csv"
_FILES = (
    "experiment.yaml",
    "campaign.yaml",
    _TABLE,
    "campaign.json",
    "summary.html",
    "groups.csv",
)
# Rows that did not finish that are told of one by one.
_MOST_LINES = 10


def campaign(args: Campaign) -> None:
    """Run the rows of a campaign that have not ended, and write what all of them say."""
    with silence(args.quiet or args.as_json), errors():
        require_tables(args.tables)
        paper, metrics = paper_of(args), chosen_metrics(args.metrics)
        if is_campaign(args.campaign):
            _group_again(args, metrics, paper)
            return
        if args.scheduler is not None:
            require_address(args.scheduler)
        settings: dict[str, Any] = {"samples": args.samples, "method": args.method}
        settings = {key: value for key, value in settings.items() if value is not None}
        with status(f"{args.campaign}: checking the rows"):
            changes = changes_of(args.changes, None, args.duration)
            read = read_campaign(args.campaign, **settings)
            plan = plan_campaign(read, changes, anyway=args.anyway)
            by = keys_by(args)
            names = _planned_names(plan, by, args.labels)
        tell_of_window(plan.campaign.experiment, {**plan.campaign.changes, **changes})
        folder = args.out_folder / f"campaign_{plan.campaign.name or 'unnamed'}"
        if args.dry_run:
            count = f"{plan.campaign.name}: {plural(len(plan.rows), 'row')}"
            _print_plan(plan, count, folder, folder / "rows", args)
            return
        with claimed_folder(folder, *_FILES):
            result, page = _run(plan, folder, args, metrics)
            _print(result, page)
            _hint(result.lines, by)
            _print_figures(result, folder, paper)
            sheet = written_sheet(result.summary)
            if by and result.lines:
                shown = [metric.name for metric in result.summary.metrics]
                groups = _Groups(by, result.groups(*by), names)
                sheet = _print_groups(groups, shown, args.statistic, folder, paper)
        write_tables(sheet, args.tables)
        if args.as_json:
            contents = [_group_contents(by, group) for group in result.groups(*by)]
            print_data(_contents(result, page) | ({"groups": contents} if by else {}))
    if result.missing:
        text = f"{result.missing} of {plural(len(result.plan.rows), 'row')}"
        err.print(
            f"[red]not run[/] {text}: {escape(result.reason)}; run the same command again to "
            "continue"
        )
    finish(
        not result.missing and result.summary.complete == len(result.lines),
        not args.check or not any(line.record.not_met for line in result.lines),
    )


def _run(
    plan: Plan, folder: Path, args: Campaign, metrics: list[str]
) -> tuple[CampaignResult, Path]:
    workers = None if args.scheduler is None else cluster_at(args.scheduler)
    with jobs_progress(plan.campaign.name) as progress:
        result = run_campaign(
            plan, folder, jobs=args.jobs, executor=workers, progress=progress, again=args.again
        ).showing(metrics)
    with status(f"{args.campaign}: drawing the summary"):
        return result, write_campaign_page(result, folder / "summary.html")


def _print(result: CampaignResult, page: Path) -> None:
    out.print(escape(f"{result.summary.name}: {status_text(result)}"), soft_wrap=True)
    if result.lines:
        print_table(terminal_table(shares_sheet(result.summary)))
    if result.summary.metrics:
        print_sheet(statistics_sheet(result.summary))
    for row, ending, failure, command in result.summary.unlike[:_MOST_LINES]:
        err.print(f"[red]{ending}[/] {escape(f'row {row}: {failure}; {command}')}")
    if (left := len(result.summary.unlike) - _MOST_LINES) > 0:
        err.print(f"[red]and {left} more rows[/] did not finish")
    out.print(escape(f"table    {result.folder / 'table.csv'}"), soft_wrap=True)
    out.print(escape(f"summary  {page}"), soft_wrap=True)


def _hint(lines: Sequence[Line], by: Sequence[str]) -> None:
    """Say how rows are told apart whose laws, arms or other words differ."""
    words: dict[str, set[str]] = {}
    for line in lines:
        for key, value in line.values.items():
            if isinstance(value, dict) and "kind" in value:
                key, value = f"{key}.kind", value["kind"]
            if isinstance(value, str):
                words.setdefault(key, set()).add(value)
    if not by and (differ := [key for key, values in words.items() if len(values) > 1]):
        hint = f"all rows are taken together; --by {','.join(differ)} tells them apart"
        out.print(f"[yellow]note[/] {escape(hint)}", soft_wrap=True)


def is_campaign(name: str | Path) -> bool:
    """Return whether a name is that of a folder with the rows of a campaign."""
    return all(is_file(Path(name, file)) for file in ("campaign.yaml", _TABLE))


class KeptCampaign(NamedTuple):
    """A campaign that has run, or a single run as one.

    Attributes:
        name: Its name.
        lines: Its rows.
        metrics: Names of the metrics that its document names; empty for those that matter.
        quantiles: Probabilities of the quantiles; empty for the usual ones.
    """

    name: str
    lines: list[Line]
    metrics: list[str]
    quantiles: list[float]


def campaign_in(folder: str | Path) -> KeptCampaign:
    """Return a campaign that was kept in a folder.

    Nothing in it is run, so that its modules and models may be missing.

    Args:
        folder: Its folder.

    Raises:
        InvalidInputError: If a file in it cannot be read.
    """
    document = read_yaml(Path(folder, "campaign.yaml"))
    contents = document if isinstance(document, dict) else {}
    settings = construct(StatisticsSettings, contents.get("statistics") or {}, "statistics")
    name, metrics = str(contents.get("name") or Path(folder).name), contents.get("metrics") or []
    metric_names = [each for each in metrics if each in METRICS.names]
    return KeptCampaign(
        name, read_lines(Path(folder, _TABLE)), metric_names, list(settings.quantiles)
    )


def require_metrics(metrics: Sequence[str], name: str, lines: Sequence[Line]) -> None:
    """Refuse metrics that no row of a campaign has.

    Raises:
        InvalidInputError: If there is one.
    """
    known = metrics_in(lines)
    for metric in metrics:
        if metric not in known:
            raise InvalidInputError(
                f"--metrics: no row of {name} has {metric}; {nearest(metric, known)}"
            )


def keys_by(args: Campaign | Compare) -> list[str]:
    """Return the keys of ``--by``; none without it."""
    return [] if args.by is None else split_words(args.by)


class _Names(NamedTuple):
    """What tables and figures call keys and groups.

    Attributes:
        keys: Names of keys that have one of their own, by key.
        groups: Names of groups by their values; empty if they have none of their own.
    """

    keys: dict[str, str]
    groups: dict[tuple[str, ...], str]


def _names_of_groups(labels: str | None, by: list[str], groups: Sequence[Group]) -> _Names:
    """Return the names of ``--labels``.

    Raises:
        InvalidInputError: If nothing is grouped, there is not a name for each group, or two are the
            same.
    """
    if labels is None:
        return _Names({}, {})
    if not by:
        raise InvalidInputError("--labels: names the groups of --by, which must be given")
    words = split_words(labels)
    keys = {key: name for key, _, name in (word.partition("=") for word in words) if key in by}
    names = [word for word in words if word.partition("=")[0] not in by]
    if names and len(names) != len(groups):
        values = "; ".join(", ".join(group.values) for group in groups)
        raise InvalidInputError(
            f"--labels: must have one name for each of {plural(len(groups), 'group')} "
            f"({short(values)}), not {len(names)}"
        )
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInputError(f"--labels: {twice[0]!r} is given twice")
    pairs = zip((group.values for group in groups), names, strict=True) if names else ()
    return _Names(keys, dict(pairs))


def _planned_names(plan: Plan, by: list[str], labels: str | None) -> _Names:
    """Return the names of the groups that will be, which are refused before anything runs."""
    # All rows are needed for their names alone.
    rows = plan.rows if labels is not None else plan.rows[:1]
    lines = [Line(0, row.changes, RunRecord("complete")) for row in rows]
    return _names_of_groups(labels, by, group_by(lines, by, ()))


class _Groups(NamedTuple):
    """Groups of rows, and what they are called."""

    by: list[str]
    groups: list[Group]
    names: _Names

    def named(self) -> tuple[list[str], list[Group]]:
        """Return heads of columns, and groups with their names as values."""
        heads = [self.names.keys.get(key, key) for key in self.by]
        if not self.names.groups:
            return heads, self.groups
        groups = [
            replace(group, values=(self.names.groups[group.values],)) for group in self.groups
        ]
        return [", ".join(heads)], groups


def _group_again(args: Campaign, metrics: list[str], paper: Paper) -> None:
    """Print and write the groups of a campaign that was kept."""
    folder, by = Path(args.campaign), keys_by(args)
    name, lines, own, quantiles = campaign_in(folder)
    completed_lines = [line for line in lines if line.record.complete]
    require_metrics(metrics, name, lines)
    names = metrics or own or telling_metrics(completed_lines)
    groups = group_by(lines, by, names, quantiles)
    named = _Groups(by, groups, _names_of_groups(args.labels, by, groups))
    with claimed_folder(folder, "groups.csv"):
        out.print(escape(f"{name}: {plural(len(lines), 'row')}, from before"), soft_wrap=True)
        sheet = _print_groups(named, names, args.statistic, folder, paper)
    write_tables(sheet, args.tables)
    if args.as_json:
        print_data([_group_contents(by, group) for group in groups])


def _group_contents(by: list[str], group: Group) -> dict[str, Any]:
    metrics = {
        name: {
            "count": each.count,
            "mean": each.mean,
            "deviation": each.deviation,
            "quantiles": {f"{p:g}": value for p, value in each.quantiles.items()},
        }
        for name, each in group.metrics.items()
    }
    values = dict(zip(by, group.values, strict=True))
    return {"values": values, "rows": group.rows, "complete": group.complete, "metrics": metrics}


def _print_groups(
    groups: _Groups, metrics: list[str], statistic: Statistic, folder: Path, paper: Paper
) -> Sheet:
    """Print groups, write their numbers and their figure, and return their table."""
    heads, named = groups.named()
    sheet = groups_sheet(heads, named, metrics, statistic)
    print_groups(sheet, len(heads))
    head, *lines = group_lines(groups.by, groups.groups)
    write_lines(folder / "groups.csv", head, lines)
    out.print(escape(f"groups   {folder / 'groups.csv'}"), soft_wrap=True)
    with drawn_for(paper), drawn_of("groups"):
        file = folder / f"groups.{current().form}"
        if groups_figure(spreads_by_name(named), metrics, statistic, file):
            out.print(escape(f"figure   {file}"), soft_wrap=True)
    return sheet


def spreads_by_name(groups: Sequence[Group]) -> dict[str, dict[str, Spread]]:
    """Return the metrics of groups by the names that a figure calls them by."""
    names = (", ".join(values) or "all" for values in format_values(groups))
    return {name: group.metrics for name, group in zip(names, groups, strict=True)}


def print_groups(sheet: Sheet, names: int) -> None:
    """Print a table of groups, in several where it does not fit beside.

    Args:
        sheet: The table.
        names: Number of its columns that tell the group.
    """
    print_sheet(sheet, names + 1)
    out.print(escape(sheet.note), soft_wrap=True)


def _print_figures(result: CampaignResult, folder: Path, paper: Paper) -> None:
    """Write the figures of the page as files too, if they are asked for in any way of their own."""
    if paper == Paper():
        return
    with drawn_for(paper):
        for file in write_campaign_figures(result, folder):
            out.print(escape(f"figure   {file}"), soft_wrap=True)


def _print_plan(plan: Plan, what: str, folder: Path, rows: Path, args: Campaign | Sweep) -> None:
    """Print what would be run.

    Args:
        plan: The plan.
        what: Number of its runs, in words.
        folder: Folder that they would be written to.
        rows: Folder with the records of those that have ended.
        args: The command.
    """
    jobs = Jobs(plan.rows, RecordStore(rows) if rows.is_dir() else None)
    left = plan.time * (1.0 - jobs.kept / len(jobs.requests)) / args.jobs
    if args.as_json:
        contents = {
            "folder": str(folder),
            "rows": len(plan.rows),
            "runs": len(jobs.requests),
            "kept": jobs.kept,
            "expected_time_s": left if plan.time else None,
        }
        print_data(contents)
    progress_note = f", {jobs.kept} of them finished" if jobs.kept else ""
    time = f"about {left:.2g} s with {args.jobs} in parallel" if plan.time else ""
    text = f"{what}{progress_note}; {time or 'there is no estimate'}; {folder}"
    out.print(escape(text), soft_wrap=True)


def _contents(result: CampaignResult, page: Path) -> dict[str, Any]:
    """Return the summary as plain data that JSON can hold."""
    summary = result.summary
    return {
        "name": summary.name,
        "folder": str(result.folder),
        "table": str(result.folder / "table.csv"),
        "summary": str(page),
        "status": result.ending,
        "reason": result.reason,
        "rows": summary.rows,
        "statuses": summary.statuses,
        "methods": summary.methods,
        "shares": {name: interval._asdict() for name, interval in summary.shares.items()},
        "metrics": {
            metric.name: {
                "count": metric.count,
                "mean": metric.mean,
                "least": metric.least,
                "largest": metric.largest,
                "quantiles": {f"{p:g}": each._asdict() for p, each in metric.quantiles.items()},
                "worst": [vars(worst) for worst in metric.worst],
                "rank_correlations": metric.correlations,
            }
            for metric in summary.metrics
        },
        "unlike": [
            dict(zip(("row", "status", "failure", "command"), each, strict=True))
            for each in summary.unlike
        ],
    }


def sweep(args: Sweep) -> None:
    """Run an experiment with several values, and write what came out."""
    experiment = args.experiment
    with silence(args.quiet or args.as_json), errors():
        require_tables(args.tables)
        metrics, paper = chosen_metrics(args.metrics), paper_of(args)
        changes = changes_of(args.changes, args.seed, args.duration)
        axes = _axes(args.over) or load_experiment(experiment, changes).document.over
        if not axes:
            raise InvalidInputError(f"--over: must be given; {experiment} has no values of its own")
        keys = list(axes)
        plan = plan_sweep(experiment, axes, changes, anyway=args.anyway)
        document = read_document(experiment, changes)
        units = {key: unit_of_key(document, key) for key in keys}
        folder = args.out_folder / f"sweep_{Path(experiment).stem}_{'_'.join(keys)}"
        for length in axes.get("duration", [None]):
            duration_change = {} if length is None else {"duration": length}
            tell_of_window(experiment, changes | duration_change)
        if args.dry_run:
            _print_plan(plan, plural(len(plan.rows), "run"), folder, folder / ".rows", args)
            return
        names = ("sweep.csv", f"sweep.{paper.form}", f"learning.{paper.form}")
        with claimed_folder(folder, *names):
            rows, missing = _rows(keys, plan, args.jobs, folder)
            sheet = sweep_sheet(keys, rows, metrics or varying_metrics(rows), units)
            with drawn_for(paper):
                _print_and_write(keys, rows, folder, document, sheet)
        write_tables(sheet, args.tables)
        if args.as_json:
            print_data(
                {"folder": str(folder), "runs": [_sweep_contents(keys, row) for row in rows]}
            )
        if missing:
            text = "; ".join(_name_of(keys, values) for values in missing)
            err.print(f"[red]not run[/] {escape(text)}; run the same command again to continue")
    finish(
        not missing and not any(row.failure for row in rows),
        not args.check or not any(row.not_met for row in rows),
    )


def _rows(
    keys: list[str], plan: Plan, jobs: int, folder: Path
) -> tuple[list[Row], list[tuple[Any, ...]]]:
    """Return the rows that have ended, and the values of those that have not."""

    def done(row: Row) -> None:
        if not out.quiet or row.failure:
            err.print(escape(f"{_name_of(keys, row.values)}: {row.failure or 'done'}"))

    try:
        return run_sweep(plan, jobs, done, keep=folder / ".rows"), []
    except InterruptedSweepError as error:
        return error.rows, error.missing


def _print_and_write(
    keys: list[str],
    rows: list[Row],
    folder: Path,
    document: Mapping[str, Any],
    sheet: Sheet,
) -> None:
    write_csv(folder / "sweep.csv", keys, rows)
    names = [column.heading.name for column in sheet.columns[len(keys) :]]
    form, accept = current().form, document.get("accept") or {}
    units = {key: unit_of_key(document, key) for key in keys}
    pictures = [
        sweep_figure(keys, rows, names, folder / f"sweep.{form}", units, accept),
        learning_figure(keys, rows, folder / f"learning.{form}", units),
    ]
    print_sheet(sheet, len(keys))
    out.print(escape(f"table    {folder / 'sweep.csv'}"), soft_wrap=True)
    for picture in filter(None, pictures):
        out.print(escape(f"picture  {picture}"), soft_wrap=True)


def _sweep_contents(keys: list[str], row: Row) -> dict[str, Any]:
    return {
        "values": dict(zip(keys, row.values, strict=True)),
        "metrics": row.metrics,
        "failure": row.failure or "",
        "not_met": list(row.not_met),
    }


def _name_of(keys: list[str], values: tuple[Any, ...]) -> str:
    return ", ".join(f"{key}={value}" for key, value in zip(keys, values, strict=True))


def _axes(over: list[str] | None) -> dict[str, list[Any]]:
    """Return the values of all ``--over`` options, by key."""
    axes = [parse_axis(text) for text in over or []]
    keys = [key for key, _ in axes]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InvalidInputError(f"--over: {twice[0]!r} is given twice; give all its values at once")
    return dict(axes)
