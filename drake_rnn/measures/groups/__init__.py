"""Groups of metrics, each taken from the parts of a run as they come."""

from .bounds import BoundMetrics
from .drift import DisplacementMetrics, DriftMetrics
from .following import FollowingMetrics
from .gap import GapMetrics
from .group import Found, Group
from .higher import HeldJerkMetrics, HigherMetrics
from .network import NetworkMetrics

__all__ = [
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
]
