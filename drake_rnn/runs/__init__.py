"""Running experiments: single runs, sweeps, and the fastest run of a path."""

from .result import Result as Result
from .simulation import (
    build_diagram as build_diagram,
    check_experiment as check_experiment,
    resume as resume,
    simulate as simulate,
)
