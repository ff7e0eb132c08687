"""The blocks that diagrams are made of, one a file."""

from .controllers import ContinuousController, SampledController
from .dither import Dither, DitherSettings
from .dynamics import Dynamics
from .kinematics import Kinematics
from .mirror import Mirror
from .path_source import PathSource

__all__ = [
    "ContinuousController",
    "Dither",
    "DitherSettings",
    "Dynamics",
    "Kinematics",
    "Mirror",
    "PathSource",
    "SampledController",
]
