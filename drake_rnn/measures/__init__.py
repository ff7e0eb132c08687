"""Recording of a run, and the metrics computed from it."""

from .metrics import METRIC_NAMES, METRICS, Metric, shown_in, violation_metric
from .motion import Motion, Pressing
from .motion_metrics import ARRIVED, law_metrics, motion_metrics
from .recorder import Recorder
from .series import UNITS

__all__ = [
    "ARRIVED",
    "METRICS",
    "METRIC_NAMES",
    "UNITS",
    "Metric",
    "Motion",
    "Pressing",
    "Recorder",
    "law_metrics",
    "motion_metrics",
    "shown_in",
    "violation_metric",
]
