"""What the papers claim, and whether it holds: verdicts computed from runs."""

from .claim import Claim, Criterion, Paper, Quantity
from .judging import Finding, Judge, Judgement, Verdict
from .reading import SCHEMES, Claims, read_claims

__all__ = [
    "SCHEMES",
    "Claim",
    "Claims",
    "Criterion",
    "Finding",
    "Judge",
    "Judgement",
    "Paper",
    "Quantity",
    "Verdict",
    "read_claims",
]
