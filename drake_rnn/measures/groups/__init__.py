"""Groups of metrics, each taken from the parts of a run as they come."""

from .bounds import BoundMetrics as BoundMetrics
from .drift import DisplacementMetrics as DisplacementMetrics, DriftMetrics as DriftMetrics
from .following import FollowingMetrics as FollowingMetrics
from .gap import GapMetrics as GapMetrics
from .group import Found as Found, Group as Group
from .higher import HeldJerkMetrics as HeldJerkMetrics, HigherMetrics as HigherMetrics
from .network import NetworkMetrics as NetworkMetrics
from .rest import RestMetrics as RestMetrics
