"""Public names of drake_rnn, and the modules that they are lent from when they are first used."""

from .arrays.algebra import functions_of as functions_of, require_jax as require_jax
from .batch import (
    CompiledRuns as CompiledRuns,
    CompiledStep as CompiledStep,
    Many as Many,
    Slopes as Slopes,
    run_many as run_many,
    value_and_gradient as value_and_gradient,
    why_not as why_not,
)
from .diagrams import AddLoop as AddLoop, Loop as Loop, wiring_graph as wiring_graph
from .drive import (
    FR3 as FR3,
    IIWA as IIWA,
    Command as Command,
    Connection as Connection,
    DrivenRun as DrivenRun,
    DriveOutcome as DriveOutcome,
    DriveSettings as DriveSettings,
    Faults as Faults,
    FollowingRobot as FollowingRobot,
    IiwaLcm as IiwaLcm,
    Motion as Motion,
    PacedConnection as PacedConnection,
    Robot as Robot,
    RobotStatus as RobotStatus,
    RobotTask as RobotTask,
    SimulatedIiwa as SimulatedIiwa,
    drive_diagram as drive_diagram,
    drive_experiment as drive_experiment,
    driven_experiment as driven_experiment,
    lock_step as lock_step,
)
from .drive.command_memory import CommandReader as CommandReader
from .drive.guard import Guard as Guard, GuardCommand as GuardCommand
from .environments import (
    ENVIRONMENTS as ENVIRONMENTS,
    ContactModel as ContactModel,
    ElasticSurface as ElasticSurface,
    ModelSurface as ModelSurface,
    Plate as Plate,
    Surface as Surface,
    TipMaterial as TipMaterial,
)
from .errors import (
    DrakeRnnError as DrakeRnnError,
    InvalidInputError as InvalidInputError,
    RobotError as RobotError,
    SimulationError as SimulationError,
    UnprotectedWarning as UnprotectedWarning,
)
from .experiment import (
    Experiment as Experiment,
    ExperimentDocument as ExperimentDocument,
    Goal as Goal,
    check_reach as check_reach,
    load_experiment as load_experiment,
    make_experiment as make_experiment,
    plan_motion as plan_motion,
    shipped_experiments as shipped_experiments,
)
from .exports import export as export
from .features import METRICS as METRICS
from .features.camera import (
    CameraSwap as CameraSwap,
    ImageSource as ImageSource,
    Pinhole as Pinhole,
    ToolCamera as ToolCamera,
)
from .features.contact import (
    Contact as Contact,
    ForceProfile as ForceProfile,
    SensorSettings as SensorSettings,
)
from .features.detour import DetourSettings as DetourSettings, DetourSource as DetourSource
from .features.filter import FilterSettings as FilterSettings, MovingAverage as MovingAverage
from .features.joint_noise import (
    DisturbanceSettings as DisturbanceSettings,
    Dither as Dither,
    DitherSettings as DitherSettings,
)
from .features.locks import JointLock as JointLock, JointLocks as JointLocks
from .features.sensing import SensingSettings as SensingSettings
from .figures import Paper as Paper, figure as figure, write_figures as write_figures
from .film import FilmSettings as FilmSettings, write_film as write_film
from .inputs.fields import (
    Array as Array,
    Finite as Finite,
    NonNegative as NonNegative,
    Positive as Positive,
    Vector as Vector,
    validated as validated,
)
from .inputs.keys import Meaning as Meaning, Only as Only
from .inputs.packages import __version__ as __version__
from .jobs import (
    CampaignDocument as CampaignDocument,
    CampaignResult as CampaignResult,
    read_campaign as read_campaign,
    run_campaign as run_campaign,
    sweep as sweep,
)
from .laws import (
    LAWS as LAWS,
    OBJECTIVES as OBJECTIVES,
    Adaptive as Adaptive,
    Avoidance as Avoidance,
    Circumstances as Circumstances,
    ContinuousLaw as ContinuousLaw,
    ContinuousReading as ContinuousReading,
    JointDriftFree as JointDriftFree,
    JointPreview as JointPreview,
    JointStream as JointStream,
    JointTorque as JointTorque,
    Law as Law,
    Layout as Layout,
    Moment as Moment,
    MotionForce as MotionForce,
    MutualAvoidance as MutualAvoidance,
    NullSpaceAdjustment as NullSpaceAdjustment,
    Objective as Objective,
    PostureLaw as PostureLaw,
    Projection as Projection,
    Pseudoinverse as Pseudoinverse,
    RecedingHorizon as RecedingHorizon,
    Recursive as Recursive,
    Safety as Safety,
    SampledLaw as SampledLaw,
    SampledReading as SampledReading,
    Signals as Signals,
    SimultaneousLearning as SimultaneousLearning,
    StateAdjustment as StateAdjustment,
    Zeroing as Zeroing,
)
from .laws.parts.jacobian import Measurement as Measurement
from .laws.parts.secondary import Secondary as Secondary
from .laws.parts.surface_task import (
    ContactLoss as ContactLoss,
    ForceControl as ForceControl,
    OnlineStiffness as OnlineStiffness,
)
from .laws.simultaneous_learning import WarmUp as WarmUp
from .live.play import ShieldView as ShieldView
from .paths import (
    PATHS as PATHS,
    Cat as Cat,
    Circle as Circle,
    Clover as Clover,
    Curve as Curve,
    Deltoid as Deltoid,
    Drawing as Drawing,
    FourRing as FourRing,
    Line as Line,
    Nephroid as Nephroid,
    Parallelogram as Parallelogram,
    Part as Part,
    Passage as Passage,
    Path as Path,
    PlacedPath as PlacedPath,
    Planar as Planar,
    Points as Points,
    RelativePath as RelativePath,
    Rest as Rest,
    Sequence as Sequence,
    Spline as Spline,
    Square as Square,
    Svg as Svg,
    Text as Text,
    TrajectoryPath as TrajectoryPath,
    Waypoints as Waypoints,
)
from .playback import write_playback as write_playback
from .robot.arm import Arm as Arm
from .robot.arm_description import (
    ArmDescription as ArmDescription,
    ToolDescription as ToolDescription,
)
from .robot.clearance import Clearance as Clearance
from .robot.clearance.arm_clearance import arm_clearance as arm_clearance
from .robot.clearance.model_obstacle import make_obstacles as make_obstacles
from .robot.kinematics import ArmKinematics as ArmKinematics
from .robot.limits import JointLimits as JointLimits
from .robot.load_arm import (
    ArmReport as ArmReport,
    arm_report as arm_report,
    load_arm as load_arm,
    screws_of as screws_of,
    shipped_arms as shipped_arms,
)
from .robot.postures import SelfMotion as SelfMotion, proposed_home as proposed_home
from .robot.screws import (
    LinkErrors as LinkErrors,
    Screws as Screws,
    random_link_errors as random_link_errors,
    side_by_side as side_by_side,
    with_link_errors as with_link_errors,
)
from .robot.task import TASKS as TASKS
from .runs import (
    Result as Result,
    build_diagram as build_diagram,
    check_experiment as check_experiment,
    resume as resume,
    simulate as simulate,
)
from .runs.limit_use import Fastest as Fastest, fastest as fastest
from .shield.arms import DualArmShield as DualArmShield
from .shield.pose_filter import PoseFilter as PoseFilter
from .shield.process import Shield as Shield
from .shield.shield import ShieldSettings as ShieldSettings, ShieldStatus as ShieldStatus
from .systems import (
    BODIES as BODIES,
    ArmInPlant as ArmInPlant,
    Body as Body,
    ContinuousController as ContinuousController,
    Controller as Controller,
    Dynamics as Dynamics,
    Feedback as Feedback,
    IdealArm as IdealArm,
    JointReference as JointReference,
    Kinematics as Kinematics,
    PathSource as PathSource,
    PlantArm as PlantArm,
    PlantSettings as PlantSettings,
    RobotArm as RobotArm,
    SampledController as SampledController,
    TorqueArm as TorqueArm,
    add_motors as add_motors,
)
from .tuning import TuningOutcome as TuningOutcome, tune as tune
