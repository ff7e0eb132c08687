"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems."""

from importlib.metadata import version

from .diagrams import AddLoop, Loop
from .environments import (
    ENVIRONMENTS,
    ContactModel,
    ElasticSurface,
    ModelSurface,
    Plate,
    Surface,
    TipMaterial,
)
from .errors import DrakeRnnError, InvalidInputError, SimulationError
from .experiment import (
    Experiment,
    ExperimentDocument,
    check_reach,
    load_experiment,
    make_experiment,
    shipped_experiments,
)
from .figures import write_figures
from .inputs.fields import Finite, NonNegative, Positive, Vector, validated
from .laws import (
    LAWS,
    Circumstances,
    ContinuousLaw,
    JointDriftFree,
    Law,
    Layout,
    MotionForce,
    NullSpaceAdjustment,
    PostureLaw,
    Pseudoinverse,
    RecedingHorizon,
    Recursive,
    SampledLaw,
    SimultaneousLearning,
    StateAdjustment,
)
from .laws.parts.contact_loss import ContactLoss
from .laws.parts.online_stiffness import OnlineStiffness
from .laws.parts.warm_up import WarmUp
from .measures import METRICS
from .paths import (
    PATHS,
    Cat,
    Circle,
    Clover,
    Deltoid,
    FourRing,
    Nephroid,
    Parallelogram,
    Path,
    Planar,
    Points,
    Rest,
    Square,
)
from .playback import write_playback
from .robot.arm import Arm, ArmDescription, load_arm, shipped_arms
from .robot.kinematics import ArmKinematics
from .robot.limits import JointLimits
from .robot.self_motion import SelfMotion
from .runs import Result, build_diagram, check_experiment, simulate
from .runs.fastest import Fastest, fastest
from .runs.sweep import sweep
from .systems import (
    Contact,
    ContinuousController,
    Dither,
    DitherSettings,
    Dynamics,
    FilterSettings,
    ForceProfile,
    IdealArm,
    JointReference,
    Kinematics,
    MovingAverage,
    PathSource,
    PlantArm,
    PlantSettings,
    SampledController,
    SensorSettings,
)

__version__ = version("drake-rnn")

__all__ = [
    "ENVIRONMENTS",
    "LAWS",
    "METRICS",
    "PATHS",
    "AddLoop",
    "Arm",
    "ArmDescription",
    "ArmKinematics",
    "Cat",
    "Circle",
    "Circumstances",
    "Clover",
    "Contact",
    "ContactLoss",
    "ContactModel",
    "ContinuousController",
    "ContinuousLaw",
    "Deltoid",
    "Dither",
    "DitherSettings",
    "DrakeRnnError",
    "Dynamics",
    "ElasticSurface",
    "Experiment",
    "ExperimentDocument",
    "Fastest",
    "FilterSettings",
    "Finite",
    "ForceProfile",
    "FourRing",
    "IdealArm",
    "InvalidInputError",
    "JointDriftFree",
    "JointLimits",
    "JointReference",
    "Kinematics",
    "Law",
    "Layout",
    "Loop",
    "ModelSurface",
    "MotionForce",
    "MovingAverage",
    "Nephroid",
    "NonNegative",
    "NullSpaceAdjustment",
    "OnlineStiffness",
    "Parallelogram",
    "Path",
    "PathSource",
    "Planar",
    "PlantArm",
    "PlantSettings",
    "Plate",
    "Points",
    "Positive",
    "PostureLaw",
    "Pseudoinverse",
    "RecedingHorizon",
    "Recursive",
    "Rest",
    "Result",
    "SampledController",
    "SampledLaw",
    "SelfMotion",
    "SensorSettings",
    "SimulationError",
    "SimultaneousLearning",
    "Square",
    "StateAdjustment",
    "Surface",
    "TipMaterial",
    "Vector",
    "WarmUp",
    "build_diagram",
    "check_experiment",
    "check_reach",
    "fastest",
    "load_arm",
    "load_experiment",
    "make_experiment",
    "shipped_arms",
    "shipped_experiments",
    "simulate",
    "sweep",
    "validated",
    "write_figures",
    "write_playback",
]
