"""Running experiments: single runs, sweeps, and the fastest run of a path."""

from .simulation import build_diagram as build_diagram
from .result import Result as Result
from .simulation import (
    check_experiment as check_experiment,
    resume as resume,
    simulate as simulate,
)
