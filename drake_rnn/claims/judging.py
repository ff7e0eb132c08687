"""Verdicts on claims, computed from runs.

- Sources of the numbers for judging: runs, their metrics, and measures taken from them.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any, Literal

from ..errors import DrakeRnnError, InterruptedRunError
from ..experiment import make_experiment, read_document
from ..jobs.requests import RunRequest, request_of
from ..runs.result import Result
from ..runs.simulation import simulate
from .claims import Claim, Claims, Criterion, Part, Quantity


class RunSource(ABC):
    """Runs of shipped experiments, each of which is made once, however often it is asked for."""

    def __init__(self) -> None:
        self._requests: dict[str, RunRequest] = {}

    def request(self, name: str, changes: Mapping[str, Any] | None = None) -> RunRequest:
        """Return the request of the run of an experiment with changes by dotted key.

        Raises:
            InvalidInputError: If the changes are none of this experiment.
        """
        values = dict(changes or {})
        text = json.dumps([name, values], sort_keys=True)
        if text not in self._requests:
            contents = read_document(name, values)
            self._requests[text] = request_of(contents, experiment=name, changes=values)
        return self._requests[text]

    @abstractmethod
    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """

    def metrics(self, name: str, changes: Mapping[str, Any] | None = None, /) -> dict[str, float]:
        """Return the metrics of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        return self.run(name, changes).metrics

    def measure(self, claims: Claims, quantity: Quantity) -> float:
        """Return the number of a quantity that a measure gives.

        Args:
            claims: The paper's claims, with its measures.
            quantity: The quantity.

        Raises:
            DrakeRnnError: If a run that it looks at is refused or fails.
        """
        return float(claims.measures[str(quantity.measure)](self.run, **quantity.given))


class SimulatedRuns(RunSource):
    """Runs that this process makes and keeps in memory, those that fail too."""

    def __init__(self) -> None:
        super().__init__()
        self._known: dict[str, Result | DrakeRnnError] = {}

    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        request = self.request(name, changes)
        if (key := request.key) not in self._known:
            try:
                self._known[key] = simulate(make_experiment(request.document))
            except InterruptedRunError:
                raise
            except DrakeRnnError as error:
                # Without the traceback, which would keep the whole run in memory.
                self._known[key] = error.with_traceback(None)
        result = self._known[key]
        if isinstance(result, DrakeRnnError):
            raise result.with_traceback(None)
        return result


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
        if self._is_met("as stated"):
            return "holds"
        if self._is_met("with the correction"):
            return "holds with correction"
        return "does not hold"

    def _is_met(self, part: Part) -> bool:
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
            return self.runs.measure(self.claims, quantity)
        metrics, name = self.runs.metrics(str(quantity.run), quantity.set), str(quantity.metric)
        if name not in metrics:
            # Such as a time of settling, of a run that did not settle.
            raise _NoNumberError(f"no {name} in this run")
        return metrics[name]
