"""What a terminal shows of a campaign."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..campaigns import CampaignResult
from ..campaigns.summary import Summary
from ..figures.campaign import strongest
from ..figures.campaign_page import interval_text


def status_text(result: CampaignResult) -> str:
    """Return in one line how many rows there are, and how they ended."""
    told = [f"{count} {status}" for status, count in result.summary.statuses.items()]
    if result.missing:
        told.append(f"{result.missing} not run")
    if count := result.summary.methods.get("batch", 0):
        told.append(f"{count} in batches")
    before = f", {result.kept} of them from before" if result.kept else ""
    return f"{len(result.plan.rows)} rows: {', '.join(told)}{before}"


def shares_table(summary: Summary) -> Table:
    """Return a table of the shares of rows that keep bounds."""
    table = Table(box=SIMPLE_HEAD)
    table.add_column("keeps", no_wrap=True)
    table.add_column(escape(f"share of the rows [{summary.confidence:.0%}]"), justify="right")
    for name, interval in summary.shares.items():
        table.add_row(name, escape(interval_text(interval, percent=True)))
    return table


def statistics_table(summary: Summary) -> Table | None:
    """Return a table of the metrics; None without any."""
    if not summary.metrics:
        return None
    table = Table(box=SIMPLE_HEAD)
    table.add_column("metric", overflow="fold")
    for probability in summary.metrics[0].quantiles:
        table.add_column(f"{probability:g} quantile", justify="right")
    for column in ("worst", "row", "follows most"):
        table.add_column(column, justify="right")
    for metric in summary.metrics:
        worst = metric.worst[0] if metric.worst else None
        key = strongest(metric)
        table.add_row(
            metric.name,
            *(escape(interval_text(interval)) for interval in metric.quantiles.values()),
            "-" if worst is None else f"{worst.value:.4g}",
            "-" if worst is None else str(worst.row),
            escape(f"{key} ({metric.correlations[key]:.2f})") if key else "-",
        )
    return table
