"""The systems that diagrams are built from, one per file."""

from .body import Body as Body, Feedback as Feedback, start_posture as start_posture
from .contact import Contact as Contact
from .plant_arm import ContactForce as ContactForce
from .contact import (
    ContactReference as ContactReference,
    ForceProfile as ForceProfile,
)
from .controllers import (
    ContinuousController as ContinuousController,
    Controller as Controller,
    SampledController as SampledController,
)
from .body import Dynamics as Dynamics
from .contact import (
    ForceSensor as ForceSensor,
    SensorSettings as SensorSettings,
)
from .contact import ForceWatch as ForceWatch
from .body import IdealArm as IdealArm
from .sources import (
    JointReference as JointReference,
    followed_path as followed_path,
    held_posture as held_posture,
)
from .sensors import JointSensor as JointSensor
from .body import Kinematics as Kinematics
from .sources import LedSource as LedSource
from .sources import NeighbourSource as NeighbourSource
from .contact import NormalForce as NormalForce
from .sources import (
    ObstacleMotions as ObstacleMotions,
    ObstacleSource as ObstacleSource,
)
from .sources import PathSource as PathSource
from .plant_arm import PlantArm as PlantArm
from .plant import PlantSettings as PlantSettings
from .sensors import PoseSensor as PoseSensor
from .body import RobotArm as RobotArm
from .sensors import SensingSettings as SensingSettings
from .body import SpringContact as SpringContact
from .sources import TargetSource as TargetSource
from .plant_arm import ToolForce as ToolForce

#: Classes of bodies, by an experiment's ``level``.
BODIES: dict[str, type[Body]] = {body.level: body for body in (IdealArm, PlantArm, RobotArm)}
