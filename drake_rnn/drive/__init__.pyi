"""Robots behind messages: what drives them, what stops them, and one to try it on."""

from .driving import (
    address_of as address_of,
    connect as connect,
)
from .robots import (
    Command as Command,
    Connection as Connection,
    Motion as Motion,
    RobotStatus as RobotStatus,
)
from .approach import DrivenLaw as DrivenLaw
from .driving import (
    DrivenRun as DrivenRun,
    drive_experiment as drive_experiment,
    drive_diagram as drive_diagram,
    result_of as result_of,
    task_of as task_of,
)
from .iiwa_lcm import Faults as Faults
from .iiwa_lcm import FollowingRobot as FollowingRobot
from .iiwa_lcm import IiwaLcm as IiwaLcm, open_lcm as open_lcm
from .driving import PacedConnection as PacedConnection, read_record as read_record
from .robots import (
    FR3 as FR3,
    IIWA as IIWA,
    ROBOTS as ROBOTS,
    Robot as Robot,
    driven_experiment as driven_experiment,
)
from .session import DriveOutcome as DriveOutcome
from .robots import DriveSettings as DriveSettings
from .iiwa_lcm import (
    SimulatedIiwa as SimulatedIiwa,
    lock_step as lock_step,
    require_alone as require_alone,
)
from .approach import RobotTask as RobotTask
from .cycles import StopError as StopError
