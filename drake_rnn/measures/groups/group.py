"""What a group of metrics is."""

from __future__ import annotations

from typing import Protocol

from ...arrays.namespace import AnyArray
from ..motion import Motion

#: Metrics by name: a number for one run, shape (robots,) for robots side by side. A metric that
#: does not apply, or whose event did not occur, is not finite.
Found = dict[str, AnyArray]


class Group(Protocol):
    """Metrics that must remember more of earlier steps than a `Gathering` does."""

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of at least one step; its arrays are reused afterwards."""

    def found(self) -> Found:
        """Return the metrics of all parts so far, by name."""
