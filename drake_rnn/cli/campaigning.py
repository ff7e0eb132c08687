"""Campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
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
from ..campaigns.plan import unique_orders
from ..campaigns.store import RowStore
from ..figures.campaign_page import write_campaign_page
from .announcing import print_data
from .campaign_progress import campaign_progress
from .campaign_tables import shares_table, statistics_table, status_text
from .completing import complete_campaigns
from .console import FAILED, NOT_MET, err, errors, out, silenced, status
from .options import (
    Anyway,
    Check,
    DryRun,
    Duration,
    Jobs,
    Out,
    Quiet,
    Set,
    changes_of,
    require_writable,
    tell_of_window,
)
from .tables import WIDE

# Rows that did not come to their end that are told of one by one.
_TOLD = 10


def campaign(  # noqa: PLR0913  one argument for each option
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Name of a shipped campaign, or a YAML file.",
            autocompletion=complete_campaigns,
        ),
    ],
    out_folder: Out = Path("out"),
    changes: Set = None,
    duration: Duration = None,
    samples: Annotated[
        int | None, typer.Option(min=1, help="Number of samples, in place of the campaign's.")
    ] = None,
    jobs: Jobs = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run on the Dask cluster of this scheduler."),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Try rows again that killed their worker.")
    ] = False,
    check: Check = False,
    anyway: Anyway = False,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary as JSON, nothing else.")
    ] = False,
    dry_run: DryRun = False,
) -> None:
    """Run many variations of an experiment; what has ended is kept, and not run again."""
    with silenced(quiet or as_json):
        with errors():
            given = {} if samples is None else {"samples": samples}
            with status(f"{campaign}: checking the rows"):
                changed = changes_of(changes, None, duration)
                plan = plan_campaign(read_campaign(campaign, **given), changed, anyway=anyway)
            tell_of_window(plan.campaign.experiment, {**plan.campaign.changes, **changed})
            folder = out_folder / f"campaign_{plan.campaign.name or 'unnamed'}"
            if dry_run:
                _print_plan(plan, folder, jobs, as_json)
                return
            require_writable(folder)
            workers = None if scheduler is None else cluster_at(scheduler)
            with campaign_progress(plan) as done:
                result = run_campaign(
                    plan, folder, jobs=jobs, executor=workers, done=done, again=again
                )
            with status(f"{campaign}: drawing the summary"):
                page = write_campaign_page(result, folder / "summary.html")
        _print(result, page)
        if as_json:
            print_data(_contents(result, page))
    _exit(result, check)


def _print(result: CampaignResult, page: Path) -> None:
    wide = Console(width=WIDE, highlight=False, quiet=out.quiet)
    out.print(escape(f"{result.summary.name}: {status_text(result)}"), soft_wrap=True)
    if result.lines:
        out.print(shares_table(result.summary))
    if (table := statistics_table(result.summary)) is not None:
        (out if out.is_terminal else wide).print(table)
    for row, ended, failure, command in result.summary.unlike[:_TOLD]:
        err.print(f"[red]{ended}[/] {escape(f'row {row}: {failure}; {command}')}")
    if (left := len(result.summary.unlike) - _TOLD) > 0:
        err.print(f"[red]and {left} more rows[/] that did not come to their end")
    out.print(escape(f"table    {result.folder / 'table.csv'}"), soft_wrap=True)
    out.print(escape(f"summary  {page}"), soft_wrap=True)


def _exit(result: CampaignResult, check: bool) -> None:
    """End with the status that fits, unless all is well; say what was not run."""
    if result.missing:
        told = f"{result.missing} of {len(result.plan.rows)} rows"
        err.print(
            f"[red]not run[/] {told}: {escape(result.reason)}; the same command goes on from here"
        )
    if result.missing or result.summary.complete < len(result.lines):
        raise typer.Exit(FAILED)
    if check and any(line.outcome.not_met for line in result.lines):
        raise typer.Exit(NOT_MET)


def _print_plan(plan: Plan, folder: Path, jobs: int, as_json: bool) -> None:
    orders = unique_orders(plan.rows)
    rows = folder / "rows"
    kept = len(kept_rows(RowStore(rows), orders)) if rows.is_dir() else 0
    left = plan.time * (len(orders) - kept) / len(orders) / jobs
    if as_json:
        contents = {
            "folder": str(folder),
            "rows": len(plan.rows),
            "runs": len(orders),
            "kept": kept,
            "expected_time_s": left,
        }
        print_data(contents)
    known = f", {kept} of which have ended" if kept else ""
    out.print(
        escape(
            f"{plan.campaign.name}: {len(plan.rows)} rows{known}; some {left:.2g} s with {jobs} at "
            f"a time; {folder}"
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
