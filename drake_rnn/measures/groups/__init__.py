"""Groups of metrics, each taken from the parts of a run as they come."""

from .contact import ContactMetrics
from .drift import DriftMetrics
from .errors import ErrorMetrics
from .following import FollowingMetrics
from .group import Found, Group
from .held_jerk import HeldJerkMetrics
from .higher import HigherMetrics
from .jacobian import JacobianMetrics
from .joints import JointMetrics
from .law import LawMetrics
from .posture import ARRIVED, PostureMetrics

__all__ = [
    "ARRIVED",
    "ContactMetrics",
    "DriftMetrics",
    "ErrorMetrics",
    "FollowingMetrics",
    "Found",
    "Group",
    "HeldJerkMetrics",
    "HigherMetrics",
    "JacobianMetrics",
    "JointMetrics",
    "LawMetrics",
    "PostureMetrics",
]
