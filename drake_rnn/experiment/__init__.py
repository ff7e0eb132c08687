"""An experiment: the document that describes it, and the objects made from it."""

from .document import Acceptance, ExperimentDocument, IntegratorSettings
from .expected_bounds import expected_bounds
from .experiment import OUTSIDE, Experiment, make_experiment
from .files import (
    Described,
    load_experiment,
    parse_change,
    read_document,
    set_key,
    shipped_experiments,
)
from .reach import Forecast, Reach, check_reach, follow, forecasts

__all__ = [
    "OUTSIDE",
    "Acceptance",
    "Described",
    "Experiment",
    "ExperimentDocument",
    "Forecast",
    "IntegratorSettings",
    "Reach",
    "check_reach",
    "expected_bounds",
    "follow",
    "forecasts",
    "load_experiment",
    "make_experiment",
    "parse_change",
    "read_document",
    "set_key",
    "shipped_experiments",
]
