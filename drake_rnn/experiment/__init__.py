"""An experiment: the document that describes it, and the objects made from it."""

from .arms import Arms
from .changes import parse_change, require_none_lost, set_key
from .document import Acceptance, ExperimentDocument, IntegratorSettings
from .expected_bounds import expected_bounds
from .experiment import Experiment, make_experiment
from .files import (
    Described,
    load_experiment,
    read_document,
    shipped_experiments,
)
from .key_meanings import key_meanings, section_meanings, unit_of_key
from .reach import MISS, Forecast, Reach, check_reach, follow, forecasts
from .sections import OUTSIDE, Sections, read_sections

__all__ = [
    "MISS",
    "OUTSIDE",
    "Acceptance",
    "Arms",
    "Described",
    "Experiment",
    "ExperimentDocument",
    "Forecast",
    "IntegratorSettings",
    "Reach",
    "Sections",
    "check_reach",
    "expected_bounds",
    "follow",
    "forecasts",
    "key_meanings",
    "load_experiment",
    "make_experiment",
    "parse_change",
    "read_document",
    "read_sections",
    "require_none_lost",
    "section_meanings",
    "set_key",
    "shipped_experiments",
    "unit_of_key",
]
