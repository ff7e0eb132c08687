"""A metric of a run, and the bound that it is expected to keep."""

from __future__ import annotations

from dataclasses import dataclass

from ..experiment.document import Acceptance


@dataclass(frozen=True)
class Verdict:
    """A metric beside the bound that it is expected to keep.

    Attributes:
        metric: Name of the metric.
        bound: The bound.
        value: Its value; None if the run does not have it, as when it did not settle.
    """

    metric: str
    bound: Acceptance
    value: float | None

    @property
    def met(self) -> bool:
        """Whether the bound is kept."""
        return self.value is not None and self.bound.holds(self.value)
