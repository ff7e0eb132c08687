"""What a terminal shows of a campaign: how far it is, and what came out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..campaigns import CampaignResult, Outcome, Plan
from ..campaigns.campaign import Progress as Done
from ..campaigns.statistics import Interval
from ..campaigns.summary import Summary
from ..figures.campaign import strongest
from ..figures.campaign_page import interval_text
from ..tables import Cell, Column, Heading, Sheet, metric_heading
from .console import err, out

# Time between two lines about the progress where there is no terminal [s].
_TELL_AGAIN = 30.0


@contextmanager
def campaign_progress(plan: Plan) -> Iterator[Done]:
    """Show how many runs are finished and the time left; without a terminal, by lines."""
    if not err.is_terminal or out.quiet:
        yield _Lines(plan.campaign.name).tell
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[troubles]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    troubles = 0
    with Progress(*columns, console=err, transient=True, speed_estimate_period=120) as bar:
        task = bar.add_task(escape(plan.campaign.name), total=None, troubles="")

        def done(ended: int, runs: int, outcome: Outcome | None) -> None:
            nonlocal troubles
            troubles += outcome is not None and outcome.status != "complete"
            told = f"{troubles} not complete" if troubles else ""
            bar.update(task, completed=ended, total=runs, troubles=told)

        yield done


class _Lines:
    """A line from time to time about how many runs are finished, as for the log of a server."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._began = self._told = self._last = perf_counter()
        self._kept = self._ended = 0

    def tell(self, ended: int, runs: int, outcome: Outcome | None) -> None:
        """Tell of the progress, unless that was done just now."""
        now, before, known = perf_counter(), self._last, self._ended
        self._last, self._ended = now, ended
        if outcome is None:
            # What came before, such as planning, says nothing of how long rows take.
            self._began = self._told = now
            self._kept = ended
            return
        # Rows of a batch end at once: its first row says nothing of how quick the others are.
        if now - self._told < _TELL_AGAIN or out.quiet or known <= self._kept:
            return
        self._told = now
        left = (before - self._began) / (known - self._kept) * (runs - known)
        err.print(escape(f"{self._name}: {known} of {runs} runs finished; about {left:.0f} s left"))


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
