"""What a group of metrics is."""

from __future__ import annotations

from typing import Protocol

from ...arrays.namespace import AnyArray
from ..motion import Motion

#: Metrics by name, each of shape (...): nothing for one run, or the number of robots. They are not
#: finite where one does not apply, or where its event did not occur.
Found = dict[str, AnyArray]


class Group(Protocol):
    """Metrics that must remember more of earlier steps than a `Gathering` does."""

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of one step or more; it does not outlast the call."""

    def found(self) -> Found:
        """Return the metrics of all parts so far, by name."""
