"""Recording of a run, and the metrics taken from it."""

from .groups import ARRIVED, ContactMetrics, FollowingMetrics
from .metrics import METRIC_NAMES, METRICS, Metric, shown_in, violation_metric
from .motion import Motion, Pressing
from .recorder import PART, Recorder, Steps, Take
from .run_metrics import RunMetrics
from .series import UNITS
from .ticks import last_end
from .units import LEAST, PREFIXED_UNITS, PREFIXES, prefixed, raised, told

__all__ = [
    "ARRIVED",
    "LEAST",
    "METRICS",
    "METRIC_NAMES",
    "PART",
    "PREFIXED_UNITS",
    "PREFIXES",
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
    "prefixed",
    "raised",
    "shown_in",
    "told",
    "violation_metric",
]
