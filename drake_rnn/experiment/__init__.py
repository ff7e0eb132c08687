"""An experiment: the document that describes it, and the objects made from it."""

from .document import Acceptance, ExperimentDocument, IntegratorSettings
from .experiment import OUTSIDE, Experiment, make_experiment
from .files import load_experiment, parse_change, read_document, set_key, shipped_experiments
from .reach import Forecast, Reach, check_reach, follow, forecasts
from .verdicts import expected_bounds

__all__ = [
    "OUTSIDE",
    "Acceptance",
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
