"""Neural dynamics as functions of arrays, without Drake; one file per scheme."""

from typing import Any

from ..inputs.kinds import Kinds
from ..inputs.packages import moved_name
from .adaptive import Adaptive
from .guard import JointStream
from .joint_drift_free import JointDriftFree
from .law import (
    Circumstances,
    ContinuousLaw,
    ContinuousReading,
    JointPreview,
    Law,
    Layout,
    Reading,
    SampledLaw,
    SampledReading,
    Signals,
)
from .motion_force import MotionForce
from .parts.safe_velocity import Avoidance
from .parts.secondary import OBJECTIVES, Moment, Objective
from .projection import Projection
from .pseudoinverse import Pseudoinverse
from .receding_horizon import RecedingHorizon
from .recursive import Recursive
from .safety import Safety
from .scheme import MutualAvoidance
from .simultaneous_learning import SimultaneousLearning
from .state_adjustment import NullSpaceAdjustment, PostureLaw, StateAdjustment
from .torque import JointTorque
from .zeroing import Zeroing

#: The laws an experiment may name, by their ``kind``.
LAWS: Kinds[Law] = Kinds(
    "law",
    Law,
    {
        "adaptive": Adaptive,
        "joint_drift_free": JointDriftFree,
        "joint_stream": JointStream,
        "joint_torque": JointTorque,
        "motion_force": MotionForce,
        "null_space_adjustment": NullSpaceAdjustment,
        "projection": Projection,
        "pseudoinverse": Pseudoinverse,
        "receding_horizon": RecedingHorizon,
        "recursive": Recursive,
        "simultaneous_learning": SimultaneousLearning,
        "state_adjustment": StateAdjustment,
        "zeroing": Zeroing,
    },
)

__all__ = [
    "LAWS",
    "OBJECTIVES",
    "Adaptive",
    "Avoidance",
    "Circumstances",
    "ContinuousLaw",
    "ContinuousReading",
    "JointDriftFree",
    "JointPreview",
    "JointStream",
    "JointTorque",
    "Law",
    "Layout",
    "Moment",
    "MotionForce",
    "MutualAvoidance",
    "NullSpaceAdjustment",
    "Objective",
    "PostureLaw",
    "Projection",
    "Pseudoinverse",
    "Reading",
    "RecedingHorizon",
    "Recursive",
    "Safety",
    "SampledLaw",
    "SampledReading",
    "Signals",
    "SimultaneousLearning",
    "StateAdjustment",
    "Zeroing",
]


def __getattr__(name: str) -> Any:
    return moved_name(__name__, name, {"Guard": "drive.guard"})
