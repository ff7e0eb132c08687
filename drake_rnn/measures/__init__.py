"""Recording of a run, and the metrics taken from it."""

from .groups import ARRIVED, ContactMetrics, FollowingMetrics
from .metrics import METRIC_NAMES, METRICS, Metric, raised, shown_in, violation_metric
from .motion import Motion, Pressing
from .recorder import PART, Recorder, Steps, Take
from .run_metrics import RunMetrics
from .series import UNITS
from .ticks import last_end

__all__ = [
    "ARRIVED",
    "METRICS",
    "METRIC_NAMES",
    "PART",
    "UNITS",
    "ContactMetrics",
    "FollowingMetrics",
    "Metric",
    "Motion",
    "Pressing",
    "Recorder",
    "RunMetrics",
    "Steps",
    "Take",
    "last_end",
    "raised",
    "shown_in",
    "violation_metric",
]
