"""The claims of the papers, and verdicts on them that are computed from runs."""

from .claims import (
    Claim,
    Criterion,
    Paper,
    Part,
    Quantity,
)
from .claims import ClaimVerdict, Finding, Judge, Judgement
from .claims import (
    SCHEMES,
    Claims,
    read_claims,
    schemes_in,
)
from .claims import RunSource, SimulatedRuns

__all__ = [
    "SCHEMES",
    "Claim",
    "ClaimVerdict",
    "Claims",
    "Criterion",
    "Finding",
    "Judge",
    "Judgement",
    "Paper",
    "Part",
    "Quantity",
    "RunSource",
    "SimulatedRuns",
    "read_claims",
    "schemes_in",
]
