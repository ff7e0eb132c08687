"""The systems that diagrams are built from."""

from typing import Any

from ..inputs.packages import moved_name
from .body import (
    Body as Body,
    Dynamics as Dynamics,
    Feedback as Feedback,
    IdealArm as IdealArm,
    Kinematics as Kinematics,
    RobotArm as RobotArm,
    SpringContact as SpringContact,
    start_posture as start_posture,
)
from .controllers import (
    ContinuousController as ContinuousController,
    Controller as Controller,
    SampledController as SampledController,
)
from .plant import PlantSettings as PlantSettings, add_motors as add_motors
from .plant_arm import (
    ArmInPlant as ArmInPlant,
    ContactForce as ContactForce,
    PlantArm as PlantArm,
    ToolForce as ToolForce,
    TorqueArm as TorqueArm,
)
from .sources import (
    JointReference as JointReference,
    PathSource as PathSource,
    TargetSource as TargetSource,
    followed_path as followed_path,
    held_posture as held_posture,
)

#: Classes of bodies, by an experiment's ``level``.
BODIES: dict[str, type[Body]] = {
    body.level: body for body in (IdealArm, PlantArm, TorqueArm, RobotArm)
}

# Names that were here, which belong to features; they work for one release, with a warning.
_PLACES = {
    **dict.fromkeys(("JointSensor", "PoseSensor", "SensingSettings"), "features.sensing"),
    **dict.fromkeys(("ObstacleMotions", "ObstacleSource"), "features.obstacles"),
    **dict.fromkeys(("LedSource", "NeighbourSource"), "features.second"),
    **dict.fromkeys(
        (
            *("Contact", "ContactReference", "ForceProfile", "ForceSensor", "ForceWatch"),
            *("NormalForce", "SensorSettings"),
        ),
        "features.contact",
    ),
}


def __getattr__(name: str) -> Any:
    return moved_name(__name__, name, _PLACES)
