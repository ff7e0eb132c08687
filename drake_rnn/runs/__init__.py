"""Running experiments: one, many, or the fastest."""

from .fastest import Fastest, fastest
from .result import Result
from .simulation import build_diagram, check_experiment, simulate
from .sweep import Row, sweep

__all__ = [
    "Fastest",
    "Result",
    "Row",
    "build_diagram",
    "check_experiment",
    "fastest",
    "simulate",
    "sweep",
]
