"""Groups of metrics, each taken from the parts of a run as they come."""

from .bounds import AT_BOUND, BoundMetrics
from .displacement import DisplacementMetrics
from .drift import DriftMetrics
from .following import FollowingMetrics
from .gap import GapMetrics
from .group import Found, Group
from .held_jerk import HELD_JERK, HeldJerkMetrics
from .higher import HigherMetrics, difference_time
from .network import NetworkMetrics

__all__ = [
    "AT_BOUND",
    "HELD_JERK",
    "BoundMetrics",
    "DisplacementMetrics",
    "DriftMetrics",
    "FollowingMetrics",
    "Found",
    "GapMetrics",
    "Group",
    "HeldJerkMetrics",
    "HigherMetrics",
    "NetworkMetrics",
    "difference_time",
]
