"""Campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.markup import escape

from ..campaigns import (
    CampaignResult,
    Plan,
    cluster_at,
    kept_rows,
    plan_campaign,
    read_campaign,
    run_campaign,
)
from ..campaigns.cluster import require_address
from ..campaigns.plan import unique_orders
from ..campaigns.store import RowStore
from ..figures import Paper, drawn_for
from ..figures.campaign_page import write_campaign_figures, write_campaign_page
from .announcing import print_data
from .asked import Campaign
from .campaign_shown import (
    campaign_progress,
    shares_sheet,
    statistics_sheet,
    status_text,
    written_sheet,
)
from .changing import changes_of, claimed_folder, tell_of_window
from .console import err, errors, finish, out, print_table, print_whole, silenced, status
from .printed import paper_of
from .written_tables import require_tables, shown, write_tables

# Files that a campaign writes, besides rows and figures.
_WRITTEN = ("experiment.yaml", "campaign.yaml", "table.csv", "campaign.json", "summary.html")
# Rows that did not finish that are told of one by one.
_TOLD = 10


def campaign(asked: Campaign) -> None:
    """Run the rows of a campaign that have not ended, and write what all of them say."""
    with silenced(asked.quiet or asked.as_json), errors():
        require_tables(asked.tables)
        paper = paper_of(asked)
        if asked.scheduler is not None:
            require_address(asked.scheduler)
        given = {"samples": asked.samples, "method": asked.method}
        given = {key: value for key, value in given.items() if value is not None}
        with status(f"{asked.campaign}: checking the rows"):
            changed = changes_of(asked.changes, None, asked.duration)
            read = read_campaign(asked.campaign, **given)
            plan = plan_campaign(read, changed, anyway=asked.anyway)
        tell_of_window(plan.campaign.experiment, {**plan.campaign.changes, **changed})
        folder = asked.out_folder / f"campaign_{plan.campaign.name or 'unnamed'}"
        if asked.dry_run:
            _print_plan(plan, folder, asked)
            return
        with claimed_folder(folder, *_WRITTEN):
            result, page = _run(plan, folder, asked)
            _print(result, page)
            _print_figures(result, folder, paper)
        write_tables(written_sheet(result.summary), asked.tables)
        if asked.as_json:
            print_data(_contents(result, page))
    if result.missing:
        told = f"{result.missing} of {len(result.plan.rows)} rows"
        err.print(
            f"[red]not run[/] {told}: {escape(result.reason)}; run the same command again to "
            "continue"
        )
    finish(
        not result.missing and result.summary.complete == len(result.lines),
        not asked.check or not any(line.outcome.not_met for line in result.lines),
    )


def _run(plan: Plan, folder: Path, asked: Campaign) -> tuple[CampaignResult, Path]:
    workers = None if asked.scheduler is None else cluster_at(asked.scheduler)
    with campaign_progress(plan) as done:
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
        print_whole(shown(statistics_sheet(result.summary)))
    for row, ended, failure, command in result.summary.unlike[:_TOLD]:
        err.print(f"[red]{ended}[/] {escape(f'row {row}: {failure}; {command}')}")
    if (left := len(result.summary.unlike) - _TOLD) > 0:
        err.print(f"[red]and {left} more rows[/] did not finish")
    out.print(escape(f"table    {result.folder / 'table.csv'}"), soft_wrap=True)
    out.print(escape(f"summary  {page}"), soft_wrap=True)


def _print_figures(result: CampaignResult, folder: Path, paper: Paper) -> None:
    """Write the figures of the page as files too, if they are asked for in any way of their own."""
    if paper == Paper():
        return
    with drawn_for(paper):
        for file in write_campaign_figures(result, folder):
            out.print(escape(f"figure   {file}"), soft_wrap=True)


def _print_plan(plan: Plan, folder: Path, asked: Campaign) -> None:
    orders = unique_orders(plan.rows)
    rows = folder / "rows"
    kept = len(kept_rows(RowStore(rows), orders)) if rows.is_dir() else 0
    left = plan.time * (len(orders) - kept) / len(orders) / asked.jobs
    if asked.as_json:
        contents = {
            "folder": str(folder),
            "rows": len(plan.rows),
            "runs": len(orders),
            "kept": kept,
            "expected_time_s": left,
        }
        print_data(contents)
    known = f", {kept} of them finished" if kept else ""
    out.print(
        escape(
            f"{plan.campaign.name}: {len(plan.rows)} rows{known}; about {left:.2g} s with "
            f"{asked.jobs} in parallel; {folder}"
        ),
        soft_wrap=True,
    )


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
