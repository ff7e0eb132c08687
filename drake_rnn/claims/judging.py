"""Verdicts on claims, computed from runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Literal

from ..errors import DrakeRnnError
from .claim import Claim, Criterion, Part, Quantity
from .reading import Claims
from .run_source import RunSource, SimulatedRuns


class _NoNumberError(DrakeRnnError):
    """A number that a run does not have."""


ClaimVerdict = Literal[
    "holds", "holds with correction", "does not hold", "cannot be checked", "failed"
]


@dataclass(frozen=True)
class Finding:
    """The number measured for one criterion, and whether it is met.

    Attributes:
        criterion: The criterion.
        holds: Whether it is met.
        value: The number; NaN if there is none.
        failure: Why there is no number: the run does not have it.
        error: Error of a run or a measure that was expected to work; empty if there was none.
    """

    criterion: Criterion
    holds: bool
    value: float = nan
    failure: str = ""
    error: str = ""

    def __str__(self) -> str:
        return self.error or self.failure or f"{self.value:.3g}"


@dataclass(frozen=True)
class Judgement:
    """The findings on one claim, and the verdict that follows.

    A claim holds if all its criteria as stated are met; else it holds with correction if it has
    corrected criteria and all of them are met; else it does not hold, whatever holds instead. Where
    a run or a measure failed that was expected to work, the judgement itself has failed: it says
    nothing of the claim.

    Attributes:
        claim: The claim.
        parts: Findings on each part of its criteria, criterion by criterion.
    """

    claim: Claim
    parts: Mapping[Part, tuple[Finding, ...]] = field(default_factory=dict)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, part by part."""
        return tuple(finding for part in self.parts.values() for finding in part)

    @property
    def verdict(self) -> ClaimVerdict:
        """The verdict."""
        if any(finding.error for finding in self.findings):
            return "failed"
        if self.claim.unchecked:
            return "cannot be checked"
        if self._met("as stated"):
            return "holds"
        if self._met("with the correction"):
            return "holds with correction"
        return "does not hold"

    def _met(self, part: Part) -> bool:
        findings = self.parts.get(part, ())
        return bool(findings) and all(finding.holds for finding in findings)


@dataclass(frozen=True)
class Judge:
    """Judges the claims of a paper.

    Args:
        claims: The paper's claims.
        runs: Where its runs come from; by default they are made here.
    """

    claims: Claims
    runs: RunSource = field(default_factory=SimulatedRuns, repr=False)

    def judge(self, claim: Claim) -> Judgement:
        """Return the judgement of a claim.

        Raises:
            DrakeRnnError: If a run is refused or fails: the claim says nothing then.
        """
        return Judgement(
            claim,
            {part: tuple(map(self.find, criteria)) for part, criteria in claim.parts.items()},
        )

    def find(self, criterion: Criterion) -> Finding:
        """Return the finding on one criterion.

        Raises:
            DrakeRnnError: If a run is refused or fails.
        """
        try:
            value = self._value(criterion)
            if criterion.per is not None:
                if (divisor := self._value(criterion.per)) == 0.0:
                    raise _NoNumberError("no ratio: divided by 0")
                value /= divisor
        except _NoNumberError as error:
            return Finding(criterion, False, failure=str(error))
        return Finding(criterion, criterion.bounds.holds(value), value)

    def _value(self, quantity: Quantity) -> float:
        if quantity.measure is not None:
            return self.runs.measured(self.claims, quantity)
        metrics, name = self.runs.metrics(str(quantity.run), quantity.set), str(quantity.metric)
        if name not in metrics:
            # Such as a time of settling, of a run that did not settle.
            raise _NoNumberError(f"no {name} in this run")
        return metrics[name]
