"""A metric of a run, and the bound that it is expected to keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..experiment import Experiment, expected_bounds
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


def verdicts_of(experiment: Experiment, metrics: Mapping[str, float]) -> list[Verdict]:
    """Return the metrics of a run that are expected to keep bounds, with their bounds.

    These are the document's ``accept``, and the limits that the law keeps by construction as far as
    the run has metrics of them.

    Args:
        experiment: What was run.
        metrics: Its metrics.
    """
    accepted = experiment.document.accept
    return [
        Verdict(name, bound, metrics.get(name))
        for name, bound in expected_bounds(experiment).items()
        if name in metrics or name in accepted
    ]
