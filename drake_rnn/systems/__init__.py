"""The systems that diagrams are built from, one per file."""

from .body import Body as Body, Feedback as Feedback, start_posture as start_posture
from .contact import Contact as Contact
from .contact_force import ContactForce as ContactForce
from .contact_reference import ContactReference as ContactReference, ForceProfile as ForceProfile
from .controllers import (
    ContinuousController as ContinuousController,
    Controller as Controller,
    SampledController as SampledController,
)
from .dynamics import Dynamics as Dynamics
from .force_sensor import ForceSensor as ForceSensor, SensorSettings as SensorSettings
from .force_watch import ForceWatch as ForceWatch
from .ideal_arm import IdealArm as IdealArm
from .joint_reference import (
    JointReference as JointReference,
    followed_path as followed_path,
    held_posture as held_posture,
)
from .joint_sensor import JointSensor as JointSensor
from .kinematics import Kinematics as Kinematics
from .leading_controller import LeadingController as LeadingController
from .led_source import LedSource as LedSource
from .neighbour_source import NeighbourSource as NeighbourSource
from .normal_force import NormalForce as NormalForce
from .obstacle_source import (
    ObstacleMotions as ObstacleMotions,
    ObstacleSource as ObstacleSource,
)
from .path_source import PathSource as PathSource
from .plant_arm import PlantArm as PlantArm
from .plant_settings import PlantSettings as PlantSettings
from .pose_sensor import PoseSensor as PoseSensor
from .robot_arm import RobotArm as RobotArm
from .sensing_settings import SensingSettings as SensingSettings
from .spring_contact import SpringContact as SpringContact
from .target_source import TargetSource as TargetSource
from .tool_force import ToolForce as ToolForce
from .tunable_controller import TunableController as TunableController

#: Classes of bodies, by an experiment's ``level``.
BODIES: dict[str, type[Body]] = {body.level: body for body in (IdealArm, PlantArm, RobotArm)}
