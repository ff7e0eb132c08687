"""What a run has come to, in a few words: whether it is accepted, and which limits it broke."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .limit_use import uses
from .result import Result


@dataclass(frozen=True)
class Conclusion:
    """A run in a line.

    Attributes:
        kind: "good" or "bad"; empty for a run of which nothing is asked.
        verdict: The verdict in words.
        criteria: How many criteria are met.
        broken: Names of the limits that are broken.
        limited: Whether any limit counts.
    """

    kind: Literal["good", "bad", ""]
    verdict: str
    criteria: str
    broken: tuple[str, ...]
    limited: bool

    def __str__(self) -> str:
        told = f"{self.verdict}: {self.criteria}"
        if self.broken:
            return f"{told}; limits broken: {', '.join(self.broken)}"
        return f"{told}; limits kept" if self.limited else told


def conclusion_of(result: Result) -> Conclusion:
    """Return what a run has come to."""
    verdicts, limits = result.verdicts, uses(result)
    met = sum(each.met for each in verdicts)
    criteria = f"{met} of {len(verdicts)} criteria met" if verdicts else "no criteria"
    kind, verdict = _verdict(result)
    broken = tuple(use.name for use in limits if use.broken)
    return Conclusion(kind, verdict, criteria, broken, bool(limits))


def _verdict(result: Result) -> tuple[Literal["good", "bad", ""], str]:
    if result.status != "complete":
        return "bad", "broke off"
    if not result.verdicts:
        return "", "ran to its end"
    if all(verdict.met for verdict in result.verdicts):
        return "good", "accepted"
    return "bad", "not accepted"
