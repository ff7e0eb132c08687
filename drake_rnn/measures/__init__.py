"""Recording of a run, and the metrics taken from it."""

from .groups import FollowingMetrics, Found, GapMetrics
from .metric import Metric, violation_metric
from .metrics import ARRIVED, METRIC_NAMES, METRICS, shown_in
from .motion import Motion, Pressing
from .recorder import PART, Recorder, Steps, Take
from .run_metrics import RunMetrics, of_one_run
from .series import UNITS
from .ticks import last_end
from .units import LEAST, PREFIXED_UNITS, PREFIXES, prefixed, raised, told
from .yardsticks import Yardsticks

__all__ = [
    "ARRIVED",
    "LEAST",
    "METRICS",
    "METRIC_NAMES",
    "PART",
    "PREFIXED_UNITS",
    "PREFIXES",
    "UNITS",
    "FollowingMetrics",
    "Found",
    "GapMetrics",
    "Metric",
    "Motion",
    "Pressing",
    "Recorder",
    "RunMetrics",
    "Steps",
    "Take",
    "Yardsticks",
    "last_end",
    "of_one_run",
    "prefixed",
    "raised",
    "shown_in",
    "told",
    "violation_metric",
]
