"""Verdicts on claims, computed from runs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any, Literal

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError
from ..experiment import load_experiment
from ..runs.result import Result
from ..runs.simulation import simulate
from .claim import Claim, Criterion, Quantity
from .reading import Claims


class MissingValueError(DrakeRnnError):
    """A number that a run does not have."""


ClaimVerdict = Literal["holds", "holds with correction", "does not hold", "cannot be checked"]


@dataclass(frozen=True)
class Finding:
    """What was found of one criterion.

    Attributes:
        criterion: The criterion.
        holds: Whether it is met.
        value: The number; NaN if there is none.
        failure: Why there is no number: the run does not have it, or is refused as expected.
    """

    criterion: Criterion
    holds: bool
    value: float = nan
    failure: str = ""

    def __str__(self) -> str:
        return self.failure or f"{self.value:.3g}"


@dataclass(frozen=True)
class Judgement:
    """What was found of one claim.

    A claim holds if all its criteria as stated are met; else it holds with correction if it has
    corrected criteria and all of them are met; else it does not hold.

    Attributes:
        claim: The claim.
        as_stated, corrected: Findings, criterion by criterion.
    """

    claim: Claim
    as_stated: tuple[Finding, ...] = ()
    corrected: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> ClaimVerdict:
        """The verdict."""
        if self.claim.unchecked:
            return "cannot be checked"
        if all(finding.holds for finding in self.as_stated):
            return "holds"
        if self.corrected and all(finding.holds for finding in self.corrected):
            return "holds with correction"
        return "does not hold"


@dataclass(frozen=True)
class Judge:
    """Judges the claims of a paper; a run that several of them need is made once.

    Args:
        claims: The paper's claims.
    """

    claims: Claims
    _runs: dict[str, Result | DrakeRnnError] = field(default_factory=dict, repr=False)

    def judge(self, claim: Claim) -> Judgement:
        """Return what is found of a claim.

        Raises:
            DrakeRnnError: If a run is refused or fails that was expected to run: the claim says
                nothing then.
        """
        return Judgement(
            claim,
            tuple(map(self._find, claim.as_stated)),
            tuple(map(self._find, claim.corrected)),
        )

    def run(self, name: str, changes: Mapping[str, Any] | None = None) -> Result:
        """Return the result of a shipped experiment with changes.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        key = json.dumps([name, dict(changes or {})], sort_keys=True)
        if key not in self._runs:
            try:
                self._runs[key] = simulate(load_experiment(name, changes))
            except InterruptedRunError:
                raise
            except DrakeRnnError as error:
                # Without the traceback, which would keep the whole run in memory.
                self._runs[key] = error.with_traceback(None)
        found = self._runs[key]
        if isinstance(found, DrakeRnnError):
            raise found
        return found

    def _find(self, criterion: Criterion) -> Finding:
        try:
            value = self._value(criterion)
            if criterion.per is not None:
                value = _ratio(value, self._value(criterion.per))
        except MissingValueError as error:
            return Finding(criterion, False, failure=str(error))
        except InvalidInputError as error:
            if criterion.refused and criterion.refused in str(error):
                return Finding(criterion, False, failure=f"refused: {error}")
            raise
        return Finding(criterion, criterion.bounds.holds(value), value)

    def _value(self, quantity: Quantity) -> float:
        if quantity.measure is not None:
            return float(self.claims.measures[quantity.measure](self.run, **quantity.given))
        metrics, name = self.run(str(quantity.run), quantity.set).metrics, str(quantity.metric)
        if name not in metrics:
            # Such as a time of settling, of a run that did not settle.
            raise MissingValueError(f"no {name} in this run")
        return metrics[name]


def _ratio(value: float, per: float) -> float:
    if per == 0.0:
        raise MissingValueError("no ratio: divided by 0")
    return value / per
