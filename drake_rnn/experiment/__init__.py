"""An experiment: the document that describes it, and the objects made from it."""

from .arms import Arms
from .changes import parse_change, require_none_lost, set_key
from .document import Acceptance, ExperimentDocument, IntegratorSettings
from .expected_bounds import expected_bounds
from .experiment import OUTSIDE, Experiment, make_experiment
from .files import (
    Described,
    load_experiment,
    read_document,
    shipped_experiments,
)
from .key_meanings import key_meanings, section_meanings, unit_of_key
from .quick_check import Checked, QuickCheck
from .reach import MISS, Forecast, Reach, check_reach, follow, forecasts

__all__ = [
    "MISS",
    "OUTSIDE",
    "Acceptance",
    "Arms",
    "Checked",
    "Described",
    "Experiment",
    "ExperimentDocument",
    "Forecast",
    "IntegratorSettings",
    "QuickCheck",
    "Reach",
    "check_reach",
    "expected_bounds",
    "follow",
    "forecasts",
    "key_meanings",
    "load_experiment",
    "make_experiment",
    "parse_change",
    "read_document",
    "require_none_lost",
    "section_meanings",
    "set_key",
    "shipped_experiments",
    "unit_of_key",
]
