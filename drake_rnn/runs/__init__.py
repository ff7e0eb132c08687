"""Running experiments: one, many, or the fastest."""

from .result import Result
from .simulation import build_diagram, check_experiment, simulate

__all__ = [
    "Result",
    "build_diagram",
    "check_experiment",
    "simulate",
]
