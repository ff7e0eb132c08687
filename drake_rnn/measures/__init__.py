"""Recording of a run, and the metrics taken from it."""

from .metric_groups import (
    FollowingMetrics as FollowingMetrics,
    MetricValues as MetricValues,
    GapMetrics as GapMetrics,
)
from .motion import ImageMotion as ImageMotion
from .metric import Metric as Metric, violation_metric as violation_metric
from .metrics import (
    ARRIVAL_TOLERANCE as ARRIVAL_TOLERANCE,
    METRICS as METRICS,
    place_metrics as place_metrics,
)
from .motion import Motion as Motion, Pressing as Pressing
from .run_metrics import (
    PART as PART,
    Recorder as Recorder,
    Steps as Steps,
    Take as Take,
)
from .run_metrics import RunMetrics as RunMetrics, of_one_run as of_one_run
from .motion import last_end as last_end
from .metric import (
    LEAST as LEAST,
    PREFIXED_UNITS as PREFIXED_UNITS,
    PREFIXES as PREFIXES,
    UNITS as UNITS,
    prefix_unit as prefix_unit,
    superscript as superscript,
    format_number as format_number,
    format_quantity as format_quantity,
)
from .metric import NEAR_PX as NEAR_PX
from .metric import Yardsticks as Yardsticks
