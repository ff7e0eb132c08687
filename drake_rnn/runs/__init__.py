"""Running experiments: single runs, sweeps, and the fastest run of a path."""

from .result import Result
from .simulation import build_diagram, check_experiment, simulate

__all__ = [
    "Result",
    "build_diagram",
    "check_experiment",
    "simulate",
]
