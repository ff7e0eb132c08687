"""Campaigns and sweeps.

- Campaigns.
- What a terminal shows of a campaign: how far it is, and what came out.
- Sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import load_experiment, read_document, unit_of_key
from ..figures import Paper, drawn_for
from ..figures.campaign import (
    groups_figure,
    interval_text,
    strongest,
    write_campaign_figures,
    write_campaign_page,
)
from ..figures.style import current
from ..figures.sweep import learning_figure, sweep_figure
from ..inputs.documents import construct, read_yaml
from ..inputs.files import is_file
from ..inputs.messages import drawn_of
from ..jobs import CampaignResult, Plan, cluster_at, plan_campaign, plan_sweep, read_campaign
from ..jobs.campaign import (
    InterruptedSweepError,
    parse_axis,
    run_campaign,
    run_sweep,
    write_csv,
)
from ..jobs.plan import StatisticsSettings
from ..jobs.pool import Jobs, require_address
from ..jobs.requests import RecordStore, Row, RunRecord
from ..jobs.summary import (
    Group,
    Interval,
    Line,
    Summary,
    group_lines,
    grouped,
    read_lines,
    telling_metrics,
    write_lines,
)
from ..measures import METRICS
from ..tables import Cell, Column, Heading, Sheet, metric_heading
from .arguments import Campaign, Sweep
from .changing import changes_of, claimed_folder, tell_of_window
from .console import err, errors, finish, out, print_table, silenced, status
from .drawing import paper_of
from .running import jobs_progress, print_data
from .tables import (
    chosen_metrics,
    groups_sheet,
    listed,
    print_sheet,
    require_tables,
    shown,
    sweep_sheet,
    varying_metrics,
    write_tables,
)


def status_text(result: CampaignResult) -> str:
    """Return in one line how many rows there are, and how they ended."""
    told = [f"{count} {status}" for status, count in result.summary.statuses.items()]
    if result.missing:
        told.append(f"{result.missing} not run")
    if count := result.summary.methods.get("batch", 0):
        told.append(f"{count} in batches")
    before = f", {result.kept} of them from before" if result.kept else ""
    return f"{len(result.plan.rows)} rows: {', '.join(told)}{before}"


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
    kept = Column(Heading(f"rows that keep its bound [{summary.confidence:.0%}]"), right=True)
    rows = []
    for metric, row in zip(summary.metrics, sheet.rows, strict=True):
        share = shares.pop(metric.name, None)
        rows.append((*row, "" if share is None else interval_text(share, percent=True)))
    for name, share in shares.items():
        empty = ("",) * (len(sheet.columns) - 1)
        rows.append((metric_heading(name), *empty, interval_text(share, percent=True)))
    title = f"{summary.name}, {summary.rows} rows"
    return Sheet((*sheet.columns, kept), rows, title)


def interval_cell(interval: Interval) -> Cell:
    """Return an estimate with its bounds; bounds that are not known are left out."""
    bounds = (interval.low, interval.high)
    known = tuple(bound for bound in bounds if not math.isinf(bound))
    low, high = ("?" if math.isinf(bound) else "{}" for bound in bounds)
    return Cell((interval.value, *known), f"{{}} [{low}, {high}]")


# Files that a campaign writes, besides rows and figures.
_TABLE = "table.csv"
_WRITTEN = (
    "experiment.yaml",
    "campaign.yaml",
    _TABLE,
    "campaign.json",
    "summary.html",
    "groups.csv",
)
# Rows that did not finish that are told of one by one.
_TOLD = 10


def campaign(asked: Campaign) -> None:
    """Run the rows of a campaign that have not ended, and write what all of them say."""
    with silenced(asked.quiet or asked.as_json), errors():
        require_tables(asked.tables)
        paper, metrics = paper_of(asked), chosen_metrics(asked.metrics)
        if is_campaign(asked.campaign):
            _group_again(asked, metrics, paper)
            return
        if asked.scheduler is not None:
            require_address(asked.scheduler)
        given: dict[str, Any] = {"samples": asked.samples, "method": asked.method}
        given = {key: value for key, value in given.items() if value is not None}
        given |= {"metrics": metrics} if metrics else {}
        with status(f"{asked.campaign}: checking the rows"):
            changed = changes_of(asked.changes, None, asked.duration)
            read = read_campaign(asked.campaign, **given)
            plan = plan_campaign(read, changed, anyway=asked.anyway)
            by = _keys_by(asked)
            grouped([Line(0, plan.rows[0].changes, RunRecord("complete"))], by, ())
        tell_of_window(plan.campaign.experiment, {**plan.campaign.changes, **changed})
        folder = asked.out_folder / f"campaign_{plan.campaign.name or 'unnamed'}"
        if asked.dry_run:
            rows = f"{plan.campaign.name}: {len(plan.rows)} rows"
            _print_plan(plan, rows, folder, folder / "rows", asked)
            return
        with claimed_folder(folder, *_WRITTEN):
            result, page = _run(plan, folder, asked)
            _print(result, page)
            _hint(result.lines, by)
            _print_figures(result, folder, paper)
            sheet = written_sheet(result.summary)
            if by and result.lines:
                names = [metric.name for metric in result.summary.metrics]
                sheet = _print_groups(asked, result.groups(*by), names, folder, paper)
        write_tables(sheet, asked.tables)
        if asked.as_json:
            groups = [_group_contents(by, group) for group in result.groups(*by)]
            print_data(_contents(result, page) | ({"groups": groups} if by else {}))
    if result.missing:
        told = f"{result.missing} of {len(result.plan.rows)} rows"
        err.print(
            f"[red]not run[/] {told}: {escape(result.reason)}; run the same command again to "
            "continue"
        )
    finish(
        not result.missing and result.summary.complete == len(result.lines),
        not asked.check or not any(line.record.not_met for line in result.lines),
    )


def _run(plan: Plan, folder: Path, asked: Campaign) -> tuple[CampaignResult, Path]:
    workers = None if asked.scheduler is None else cluster_at(asked.scheduler)
    with jobs_progress(plan.campaign.name) as done:
        result = run_campaign(
            plan, folder, jobs=asked.jobs, executor=workers, done=done, again=asked.again
        )
    with status(f"{asked.campaign}: drawing the summary"):
        return result, write_campaign_page(result, folder / "summary.html")


def _print(result: CampaignResult, page: Path) -> None:
    out.print(escape(f"{result.summary.name}: {status_text(result)}"), soft_wrap=True)
    if result.lines:
        print_table(shown(shares_sheet(result.summary)))
    if result.summary.metrics:
        print_sheet(statistics_sheet(result.summary))
    for row, ended, failure, command in result.summary.unlike[:_TOLD]:
        err.print(f"[red]{ended}[/] {escape(f'row {row}: {failure}; {command}')}")
    if (left := len(result.summary.unlike) - _TOLD) > 0:
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
    told = document if isinstance(document, dict) else {}
    settings = construct(StatisticsSettings, told.get("statistics") or {}, "statistics")
    name, metrics = str(told.get("name") or Path(folder).name), told.get("metrics") or []
    known = [each for each in metrics if each in METRICS.names]
    return KeptCampaign(name, read_lines(Path(folder, _TABLE)), known, list(settings.quantiles))


def _keys_by(asked: Campaign) -> list[str]:
    return [] if asked.by is None else listed(asked.by)


def _group_again(asked: Campaign, metrics: list[str], paper: Paper) -> None:
    """Print and write the groups of a campaign that was kept."""
    folder, by = Path(asked.campaign), _keys_by(asked)
    name, lines, own, quantiles = campaign_in(folder)
    ended = [line for line in lines if line.record.complete]
    names = metrics or own or telling_metrics(ended)
    groups = grouped(lines, by, names, quantiles)
    with claimed_folder(folder, "groups.csv"):
        out.print(escape(f"{name}: {len(lines)} rows, from before"), soft_wrap=True)
        sheet = _print_groups(asked, groups, names, folder, paper)
    write_tables(sheet, asked.tables)
    if asked.as_json:
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
    asked: Campaign, groups: list[Group], metrics: list[str], folder: Path, paper: Paper
) -> Sheet:
    """Print groups, write their numbers and their figure, and return their table."""
    by = _keys_by(asked)
    sheet = groups_sheet(by, groups, metrics, asked.statistic)
    print_groups(sheet, len(by))
    head, *lines = group_lines(by, groups)
    write_lines(folder / "groups.csv", head, lines)
    out.print(escape(f"groups   {folder / 'groups.csv'}"), soft_wrap=True)
    with drawn_for(paper), drawn_of("groups"):
        file = folder / f"groups.{current().form}"
        named = {", ".join(group.values) or "all": group.metrics for group in groups}
        if groups_figure(named, metrics, asked.statistic, file):
            out.print(escape(f"figure   {file}"), soft_wrap=True)
    return sheet


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


def _print_plan(plan: Plan, what: str, folder: Path, rows: Path, asked: Campaign | Sweep) -> None:
    """Print what would be run.

    Args:
        plan: The plan.
        what: Number of its runs, in words.
        folder: Folder that they would be written to.
        rows: Folder with the records of those that have ended.
        asked: The command.
    """
    jobs = Jobs(plan.rows, RecordStore(rows) if rows.is_dir() else None)
    left = plan.time * (1.0 - jobs.kept / len(jobs.requests)) / asked.jobs
    if asked.as_json:
        contents = {
            "folder": str(folder),
            "rows": len(plan.rows),
            "runs": len(jobs.requests),
            "kept": jobs.kept,
            "expected_time_s": left if plan.time else None,
        }
        print_data(contents)
    known = f", {jobs.kept} of them finished" if jobs.kept else ""
    time = f"about {left:.2g} s with {asked.jobs} in parallel" if plan.time else ""
    told = f"{what}{known}; {time or 'there is no estimate'}; {folder}"
    out.print(escape(told), soft_wrap=True)


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


def sweep(asked: Sweep) -> None:
    """Run an experiment with several values, and write what came out."""
    experiment = asked.experiment
    with silenced(asked.quiet or asked.as_json), errors():
        require_tables(asked.tables)
        metrics, paper = chosen_metrics(asked.metrics), paper_of(asked)
        changed = changes_of(asked.changes, asked.seed, asked.duration)
        axes = _axes(asked.over) or load_experiment(experiment, changed).document.over
        if not axes:
            raise InvalidInputError(f"--over: must be given; {experiment} has no values of its own")
        keys = list(axes)
        plan = plan_sweep(experiment, axes, changed, anyway=asked.anyway)
        document = read_document(experiment, changed)
        units = {key: unit_of_key(document, key) for key in keys}
        folder = asked.out_folder / f"sweep_{Path(experiment).stem}_{'_'.join(keys)}"
        for length in axes.get("duration", [None]):
            swept = {} if length is None else {"duration": length}
            tell_of_window(experiment, changed | swept)
        if asked.dry_run:
            _print_plan(plan, f"{len(plan.rows)} runs", folder, folder / ".rows", asked)
            return
        names = ("sweep.csv", f"sweep.{paper.form}", f"learning.{paper.form}")
        with claimed_folder(folder, *names):
            rows, missing = _rows(keys, plan, asked.jobs, folder)
            sheet = sweep_sheet(keys, rows, metrics or varying_metrics(rows), units)
            with drawn_for(paper):
                _print_and_write(keys, rows, folder, document, sheet)
        write_tables(sheet, asked.tables)
        if asked.as_json:
            print_data(
                {"folder": str(folder), "runs": [_sweep_contents(keys, row) for row in rows]}
            )
        if missing:
            told = "; ".join(_named(keys, values) for values in missing)
            err.print(f"[red]not run[/] {escape(told)}; run the same command again to continue")
    finish(
        not missing and not any(row.failure for row in rows),
        not asked.check or not any(row.not_met for row in rows),
    )


def _rows(
    keys: list[str], plan: Plan, jobs: int, folder: Path
) -> tuple[list[Row], list[tuple[Any, ...]]]:
    """Return the rows that have ended, and the values of those that have not."""

    def done(row: Row) -> None:
        if not out.quiet or row.failure:
            err.print(escape(f"{_named(keys, row.values)}: {row.failure or 'done'}"))

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


def _named(keys: list[str], values: tuple[Any, ...]) -> str:
    return ", ".join(f"{key}={value}" for key, value in zip(keys, values, strict=True))


def _axes(over: list[str] | None) -> dict[str, list[Any]]:
    """Return the values of all ``--over`` options, by key."""
    named = [parse_axis(text) for text in over or []]
    keys = [key for key, _ in named]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InvalidInputError(f"--over: {twice[0]!r} is given twice; give all its values at once")
    return dict(named)
