"""The systems that diagrams are built from, one per file."""

from .body import Body, Feedback, start_posture
from .contact import Contact
from .contact_force import ContactForce
from .contact_reference import ContactReference, ForceProfile
from .controllers import ContinuousController, Controller, SampledController
from .dither import Dither, DitherSettings
from .dynamics import Dynamics
from .force_sensor import ForceSensor, SensorSettings
from .force_watch import ForceWatch
from .ideal_arm import IdealArm
from .joint_reference import JointReference, followed_path, held_posture
from .joint_sensor import JointSensor
from .kinematics import Kinematics
from .moving_average import FilterSettings, MovingAverage
from .normal_force import NormalForce
from .path_source import PathSource
from .plant_arm import PlantArm
from .plant_settings import PlantSettings
from .pose_sensor import PoseSensor
from .sensing_settings import SensingSettings
from .spring_contact import SpringContact
from .tool_force import ToolForce

#: Classes of bodies, by an experiment's ``level``.
BODIES: dict[str, type[Body]] = {body.level: body for body in (IdealArm, PlantArm)}

__all__ = [
    "BODIES",
    "Body",
    "Contact",
    "ContactForce",
    "ContactReference",
    "ContinuousController",
    "Controller",
    "Dither",
    "DitherSettings",
    "Dynamics",
    "Feedback",
    "FilterSettings",
    "ForceProfile",
    "ForceSensor",
    "ForceWatch",
    "IdealArm",
    "JointReference",
    "JointSensor",
    "Kinematics",
    "MovingAverage",
    "NormalForce",
    "PathSource",
    "PlantArm",
    "PlantSettings",
    "PoseSensor",
    "SampledController",
    "SensingSettings",
    "SensorSettings",
    "SpringContact",
    "ToolForce",
    "followed_path",
    "held_posture",
    "start_posture",
]
