"""How far a campaign is, and the time that remains."""

from __future__ import annotations

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

from ..campaigns import Outcome, Plan
from ..campaigns.campaign import Progress as Done
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
            self._kept = ended
            return
        # Rows of a batch end at once: its first row says nothing of how quick the others are.
        if now - self._told < _TELL_AGAIN or out.quiet or known <= self._kept:
            return
        self._told = now
        left = (before - self._began) / (known - self._kept) * (runs - known)
        err.print(escape(f"{self._name}: {known} of {runs} runs finished; about {left:.0f} s left"))
