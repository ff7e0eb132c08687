"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems."""

from importlib.metadata import version

from .arms import Arm, ArmDescription, load_arm, shipped_arms
from .errors import DrakeRnnError, InvalidInputError, SimulationError
from .experiment import Experiment, load_experiment, make_experiment, shipped_experiments
from .laws import (
    ContinuousLaw,
    JointDriftFree,
    Law,
    Layout,
    NullSpaceAdjustment,
    Pseudoinverse,
    RecedingHorizon,
    Recursive,
    SimultaneousLearning,
    StateAdjustment,
)
from .limits import JointLimits
from .paths import PATHS, Path
from .reach import check_reach
from .result import Result
from .self_motion import SelfMotion
from .simulation import build_diagram, simulate
from .systems import (
    ContinuousController,
    Dither,
    DitherSettings,
    Dynamics,
    Kinematics,
    Mirror,
    MovingAverage,
    PathSource,
    SampledController,
)

__version__ = version("drake-rnn")

__all__ = [
    "PATHS",
    "Arm",
    "ArmDescription",
    "ContinuousController",
    "ContinuousLaw",
    "Dither",
    "DitherSettings",
    "DrakeRnnError",
    "Dynamics",
    "Experiment",
    "InvalidInputError",
    "JointDriftFree",
    "JointLimits",
    "Kinematics",
    "Law",
    "Layout",
    "Mirror",
    "MovingAverage",
    "NullSpaceAdjustment",
    "Path",
    "PathSource",
    "Pseudoinverse",
    "RecedingHorizon",
    "Recursive",
    "Result",
    "SampledController",
    "SelfMotion",
    "SimulationError",
    "SimultaneousLearning",
    "StateAdjustment",
    "build_diagram",
    "check_reach",
    "load_arm",
    "load_experiment",
    "make_experiment",
    "shipped_arms",
    "shipped_experiments",
    "simulate",
]
