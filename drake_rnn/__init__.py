"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems."""

from importlib.metadata import version

from .arms import Arm, ArmDescription, load_arm, shipped_arms
from .environments import ContactModel, ElasticSurface, ModelSurface, Plate, TipMaterial
from .errors import DrakeRnnError, InvalidInputError, SimulationError
from .experiment import Experiment, load_experiment, make_experiment, shipped_experiments
from .laws import (
    ContinuousLaw,
    JointDriftFree,
    Law,
    Layout,
    MotionForce,
    NullSpaceAdjustment,
    Pseudoinverse,
    RecedingHorizon,
    Recursive,
    SimultaneousLearning,
    StateAdjustment,
)
from .laws.contact_loss import ContactLoss
from .laws.online_stiffness import OnlineStiffness
from .limits import JointLimits
from .paths import PATHS, Path
from .reach import check_reach
from .result import Result
from .self_motion import SelfMotion
from .simulation import build_diagram, check_experiment, simulate
from .systems import (
    ContinuousController,
    Dither,
    DitherSettings,
    Dynamics,
    ForceProfile,
    Kinematics,
    Mirror,
    MovingAverage,
    PathSource,
    PlantArm,
    PlantSettings,
    SampledController,
    SensorSettings,
)

__version__ = version("drake-rnn")

__all__ = [
    "PATHS",
    "Arm",
    "ArmDescription",
    "ContactLoss",
    "ContactModel",
    "ContinuousController",
    "ContinuousLaw",
    "Dither",
    "DitherSettings",
    "DrakeRnnError",
    "Dynamics",
    "ElasticSurface",
    "Experiment",
    "ForceProfile",
    "InvalidInputError",
    "JointDriftFree",
    "JointLimits",
    "Kinematics",
    "Law",
    "Layout",
    "Mirror",
    "ModelSurface",
    "MotionForce",
    "MovingAverage",
    "NullSpaceAdjustment",
    "OnlineStiffness",
    "Path",
    "PathSource",
    "PlantArm",
    "PlantSettings",
    "Plate",
    "Pseudoinverse",
    "RecedingHorizon",
    "Recursive",
    "Result",
    "SampledController",
    "SelfMotion",
    "SensorSettings",
    "SimulationError",
    "SimultaneousLearning",
    "StateAdjustment",
    "TipMaterial",
    "build_diagram",
    "check_experiment",
    "check_reach",
    "load_arm",
    "load_experiment",
    "make_experiment",
    "shipped_arms",
    "shipped_experiments",
    "simulate",
]
