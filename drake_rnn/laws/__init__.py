"""Neural dynamics, one scheme a file: arrays in, arrays out, no Drake."""

from .joint_drift_free import JointDriftFree
from .law import ContinuousLaw, Law, Layout, Signals
from .motion_force import MotionForce
from .null_space_adjustment import NullSpaceAdjustment
from .pseudoinverse import Pseudoinverse
from .receding_horizon import RecedingHorizon
from .recursive import Recursive
from .simultaneous_learning import SimultaneousLearning
from .state_adjustment import StateAdjustment

#: The laws an experiment may name, by their ``kind``.
LAWS: dict[str, type[Law]] = {
    "joint_drift_free": JointDriftFree,
    "motion_force": MotionForce,
    "null_space_adjustment": NullSpaceAdjustment,
    "pseudoinverse": Pseudoinverse,
    "receding_horizon": RecedingHorizon,
    "recursive": Recursive,
    "simultaneous_learning": SimultaneousLearning,
    "state_adjustment": StateAdjustment,
}

__all__ = [
    "LAWS",
    "ContinuousLaw",
    "JointDriftFree",
    "Law",
    "Layout",
    "MotionForce",
    "NullSpaceAdjustment",
    "Pseudoinverse",
    "RecedingHorizon",
    "Recursive",
    "Signals",
    "SimultaneousLearning",
    "StateAdjustment",
]
