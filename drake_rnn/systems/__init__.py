"""The blocks that diagrams are made of, one a file."""

from .contact_force import ContactForce
from .contact_reference import ContactReference, ForceProfile
from .controllers import ContinuousController, SampledController
from .delayed_path_source import DelayedPathSource
from .dither import Dither, DitherSettings
from .dynamics import Dynamics
from .force_sensor import ForceSensor, SensorSettings
from .force_watch import ForceWatch
from .joint_reference import JointReference, followed_path, held_posture
from .kinematics import Kinematics
from .mirror import Mirror
from .moving_average import FilterSettings, MovingAverage
from .normal_force import NormalForce
from .path_source import PathSource
from .plant import PlantSettings
from .plant_arm import PlantArm
from .spring_contact import SpringContact
from .tool_force import ToolForce

__all__ = [
    "ContactForce",
    "ContactReference",
    "ContinuousController",
    "DelayedPathSource",
    "Dither",
    "DitherSettings",
    "Dynamics",
    "FilterSettings",
    "ForceProfile",
    "ForceSensor",
    "ForceWatch",
    "JointReference",
    "Kinematics",
    "Mirror",
    "MovingAverage",
    "NormalForce",
    "PathSource",
    "PlantArm",
    "PlantSettings",
    "SampledController",
    "SensorSettings",
    "SpringContact",
    "ToolForce",
    "followed_path",
    "held_posture",
]
