"""The blocks that diagrams are made of, one a file."""

from .controllers import ContinuousController, SampledController
from .dither import Dither, DitherSettings
from .kinematics import Kinematics
from .mirror import Mirror
from .path_source import PathSource

__all__ = [
    "ContinuousController",
    "Dither",
    "DitherSettings",
    "Kinematics",
    "Mirror",
    "PathSource",
    "SampledController",
]
