"""What a group of metrics is."""

from __future__ import annotations

from typing import Protocol

from ..motion import Motion

#: Metrics by name; None for one that does not apply, or whose event did not occur.
Found = dict[str, float | None]


class Group(Protocol):
    """Metrics that are taken together from the parts of a run."""

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of one step or more; it does not outlast the call."""

    def found(self) -> Found:
        """Return the metrics of all parts so far, by name."""
