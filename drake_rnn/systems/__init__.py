"""The blocks that diagrams are made of, one a file."""

from .controllers import ContinuousController, SampledController
from .delayed_path_source import DelayedPathSource
from .dither import Dither, DitherSettings
from .dynamics import Dynamics
from .joint_reference import JointReference, followed_path, held_posture
from .kinematics import Kinematics
from .mirror import Mirror
from .moving_average import FilterSettings, MovingAverage
from .path_source import PathSource

__all__ = [
    "ContinuousController",
    "DelayedPathSource",
    "Dither",
    "DitherSettings",
    "Dynamics",
    "FilterSettings",
    "JointReference",
    "Kinematics",
    "Mirror",
    "MovingAverage",
    "PathSource",
    "SampledController",
    "followed_path",
    "held_posture",
]
