"""Values of wrong kinds for each argument of what is public: refused by the argument's name."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.trajectories import PiecewisePolynomial

import drake_rnn
import drake_rnn as d
from drake_rnn import InvalidInputError

ARM = d.load_arm("panda")
LIMITS = ARM.limits.replace(acceleration=10.0)
KINEMATICS = ARM.kinematics()
EXPERIMENT = d.load_experiment("pinv_line")
PAIR = d.load_arm("planar6", pair={"arm": "planar6", "base": {"translation": [3.0, 0.0, 0.0]}})
STREAM = d.JointStream(limits=LIMITS, home=ARM.home)
# A flag for `compiled` builds it.
TWO = d.JointLimits(
    position_lower=[-1, -1], position_upper=[1, 1], velocity=[1, 1], acceleration=[1, 1]
)
LINE = PiecewisePolynomial.FirstOrderHold([0.0, 1.0, 2.0], np.eye(3))
DRAWING = Path(drake_rnn.__file__).parent / "diagrams/experiments/pseudoinverse/robot.svg"
CIRCLE = d.Circle(size=0.02, period=2.0)
CAMERA = d.ToolCamera(position=[1.0, 0.0, 0.5], look_at=[0.5, 0.0, 0.5])
SURFACE = d.ElasticSurface(stiffness=1000.0)
FORCE = d.ForceProfile(value=5.0)
SCREWS = d.screws_of(ARM)
GOES_ROUND = d.Adaptive(
    limits=LIMITS, home=ARM.home, detours=True, clearance=d.arm_clearance(ARM, [], ARM.home)[0]
)
LAW = {"limits": LIMITS}
SETTLED = {"limits": LIMITS, "home": ARM.home}
DRAWN = {"size": 0.02, "period": 2.0}


def plant_with(arm, finalized):
    """A plant with an arm and its motors, and the arm's instance."""
    plant = MultibodyPlant(1e-3)
    instance = arm.add_to(plant)
    d.add_motors(plant, instance, arm)
    if finalized:
        plant.Finalize()
    return {"arm": arm, "plant": plant, "instance": instance}


def of(cls):
    """An object of a class that nothing has made."""
    return object.__new__(cls)


ON_IIWA = d.driven_experiment("slc_nephroid_known", d.IIWA)
RESULT = of(d.Result)
FOLLOWER = d.FollowingRobot(ARM.home)
#: An experiment that is refused when it is looked at.
NOTHING = {"arm": "panda"}
ROBOT = {"name": "r", "arm": "panda", "inside": 0.1, "clipped": 0.1}

#: What is public and takes arguments, with arguments that are right.
RIGHT = {
    "Adaptive": {**SETTLED, "jacobian": "known"},
    "ArmInPlant": plant_with(ARM, True), "add_motors": plant_with(ARM, False),
    "ArmDescription": {"model": "panda", "frame": "tip"},
    "Avoidance": {},
    "CameraSwap": {"position": [1.0, 0, 0.5], "time": 1.0},
    "Cat": DRAWN, "Circle": DRAWN, "Clover": DRAWN, "Deltoid": DRAWN, "FourRing": DRAWN,
    "Nephroid": DRAWN,
    "Parallelogram": {"sides": [[0.1, 0], [0, 0.1]], "period": 4.0},
    "Square": DRAWN, "Rest": {"period": 1.0},
    "Contact": {"surface": SURFACE, "force": FORCE},
    "MutualAvoidance": {},
    "ContactLoss": {}, "DriveSettings": {}, "Faults": {}, "FilmSettings": {}, "FilterSettings": {},
    "ContinuousController": {"law": d.SimultaneousLearning(**SETTLED, jacobian="known")},
    "DisturbanceSettings": {"kind": "sine", "size": 1.0},
    "Dither": {"size": 7, "sigma": 0.1, "hold": 0.1},
    "DitherSettings": {"sigma": 0.1, "hold": 0.1},
    "Dynamics": {"arm": ARM},
    "ElasticSurface": {"stiffness": 1000.0},
    "FollowingRobot": {"position": ARM.home},
    "ForceControl": {"stiffness": 1000.0}, "ForceProfile": {"value": 5.0},
    "Guard": {"law": d.JointStream(limits=TWO, home=[0, 0]), "period": 1e-3, "start": [0, 0]},
    "Shield": {"arm": ARM, "period": 0.01, "start": ARM.home, "limits": STREAM.limits},
    "DualArmShield": {"arm": PAIR, "period": 0.01},
    "ShieldSettings": {}, "PoseFilter": {},
    "IdealArm": {"arm": ARM}, "PlantArm": {"arm": ARM}, "RobotArm": {"arm": ARM},
    "TorqueArm": {"arm": ARM},
    "IiwaLcm": {"lcm": DrakeLcm("memq://")},
    "ImageSource": {
        "path": CIRCLE.placed(np.zeros(3), np.eye(3)), "camera": CAMERA, "preview": 0.1,
    },
    "JointDriftFree": {**SETTLED, "scheme": "moaljdf", "alpha": 0.5},
    "JointLimits": {"position_lower": [-1.0], "position_upper": [1.0], "velocity": [1.0]},
    "JointLock": {"joint": 1, "time": 1.0},
    "JointLocks": {
        "times": np.full(7, np.inf), "told": np.full(7, np.inf), "at_once": np.zeros(7, bool),
    },
    "JointPreview": {"interval": 0.1, "count": 3},
    "JointReference": {
        "positions_at": lambda times: np.zeros((len(times), 7)),
        "n": 7, "interval": 0.1, "count": 3,
    },
    "JointTorque": {**SETTLED, "torque_limits": np.full(7, 80.0)},
    "JointStream": SETTLED, "functions_of": {},
    "Kinematics": {"arm": ARM},
    "Layout": {"v": (7,)},
    "Line": {"by": [0.1, 0, 0], "period": 1.0},
    "LinkErrors": {"translation": np.zeros((1, 8, 3)), "rotation": np.zeros((1, 8, 3))},
    "Measurement": {}, "OnlineStiffness": {}, "Paper": {}, "PlantSettings": {}, "Plate": {},
    "MotionForce": {**LAW, "stiffness": 1000.0},
    "MovingAverage": {
        "limits": ARM.limits.replace(acceleration=10.0, jerk=100.0), "period": 1e-3,
    },
    "NullSpaceAdjustment": {**LAW, "target": ARM.home},
    "Goal": {"q": [0.0] * 7},
    "Part": {"path": CIRCLE},
    "PathSource": {"path": CIRCLE, "p_WE": np.zeros(3)},
    "DetourSettings": {},
    "DetourSource": {
        "arm": ARM, "law": GOES_ROUND, "path": d.PathSource(CIRCLE, np.zeros(3)), "period": 0.01,
    },
    "Pinhole": {"position": [1.0, 0, 0.5]},
    "Points": {"points": [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], "period": 2.0},
    "Projection": SETTLED, "Pseudoinverse": LAW, "RecedingHorizon": {
        "limits": ARM.limits.replace(acceleration=10.0, jerk=1e2, snap=1e4, crackle=1e6)
    },
    "Recursive": {**LAW, "gains": [1.0, 10.0]},
    "Robot": ROBOT,
    "Safety": {"limits": LIMITS},
    "SampledController": {"law": d.Pseudoinverse(limits=LIMITS), "period": 1e-3},
    "Secondary": {}, "SensingSettings": {}, "SensorSettings": {}, "TipMaterial": {},
    "SelfMotion": {"arm": ARM, "start": ARM.home},
    "Sequence": {"parts": [d.Part(path=CIRCLE)]},
    "SimulatedIiwa": {"lcm": DrakeLcm("memq://")},
    "SimultaneousLearning": SETTLED,
    "Spline": {"points": [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], "period": 2.0},
    "StateAdjustment": {**LAW, "target": ARM.home},
    "Svg": {"file": str(DRAWING), "size": 0.1, "period": 1.0},
    "Text": {"text": "l", "size": 0.1, "period": 1.0},
    "ToolCamera": {"position": [1.0, 0, 0.5]}, "ToolDescription": {}, "WarmUp": {},
    "TrajectoryPath": {"trajectory": LINE},
    "Waypoints": {"positions": [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], "period": 2.0},
    "Zeroing": SETTLED,
    "Arm": {"description": ARM.description, "name": "panda"},
    "ArmKinematics": {"plant": ARM.plant(), "frame": ARM.frame, "joints": list(ARM.joints)},
    "arm_clearance": {"arm": ARM, "obstacles": (), "posture": ARM.home},
    "arm_report": {"arm": ARM, "postures": 1},
    "build_diagram": {"experiment": EXPERIMENT},
    "check_experiment": {"experiment": EXPERIMENT}, "check_reach": {"experiment": EXPERIMENT},
    "proposed_home": {"arm": ARM},
    "plan_motion": {
        "arm": ARM.with_limits(LIMITS), "goal": d.Goal(q=ARM.home), "start": ARM.home,
        "period": 0.1,
    },
    "load_arm": {"model": "panda"}, "load_experiment": {"experiment": "pinv_line"},
    "make_experiment": {"document": EXPERIMENT.document},
    "make_obstacles": {"sections": []},
    "random_link_errors": {"screws": SCREWS, "rng": np.random.default_rng(0), "robots": 2},
    "read_campaign": {"campaign": "line_starts"},
    "screws_of": {"arm": ARM}, "side_by_side": {"arms": [SCREWS]},
    "with_link_errors": {
        "screws": SCREWS,
        "errors": d.random_link_errors(SCREWS, np.random.default_rng(0), 2),
    },
    "sweep": {"experiment": "pinv_line", "over": {}},
    "simulate": {"experiment": NOTHING}, "run_many": {"experiments": [NOTHING]},
    "CompiledStep": {"experiment": NOTHING}, "CompiledRuns": {"experiments": [NOTHING]},
    "Slopes": {"experiment": NOTHING, "keys": ["law.damping"], "metric": "position_error_max_m"},
    "value_and_gradient": {
        "experiment": NOTHING, "keys": ["law.damping"], "metric": "position_error_max_m",
    },
    "tune": {"experiment": NOTHING, "over": ["law.damping"], "least": "position_error_max_m"},
    "why_not": {"experiment": "pinv_line"},
    "run_campaign": {"campaign": NOTHING, "folder": "none"},
    "resume": {"contents": "none"}, "fastest": {"experiment": EXPERIMENT},
    "export": {"result": RESULT, "place": "none"}, "figure": {"result": RESULT},
    "write_figures": {"result": RESULT, "folder": "none"},
    "write_film": {"result": RESULT, "file": "none"},
    "write_playback": {"result": RESULT, "file": "none"},
    "wiring_graph": {"diagram": d.IdealArm(ARM)},
    "drive_experiment": {"experiment": ON_IIWA, "robot": d.IIWA, "connection": FOLLOWER},
    "drive_diagram": {"task": of(d.RobotTask), "robot": d.IIWA, "connection": FOLLOWER},
    "RobotTask": {
        "simulator": Simulator(d.IdealArm(ARM)), "arm": d.RobotArm(ARM),
        "duration": 1.0, "period": 0.01,
    },
    "lock_step": {"robot": of(d.SimulatedIiwa), "lcm": DrakeLcm("memq://")},
    "validated": {"cls": type("Own", (), {"__annotations__": {"a": int}})},
    "driven_experiment": {"experiment": "slc_nephroid_known", "robot": d.IIWA},
}  # fmt: skip

#: What compiles a law.
NEED_JAX = {
    "CompiledStep",
    "Guard",
    "SampledController",
    "ShieldSettings",
    "Slopes",
    "drive_experiment",
    "value_and_gradient",
}

#: Calls of which the right ones take long, such as those that draw, search or drive.
TAKE_LONG = {"DualArmShield", "Svg", "Text", "drive_experiment", "proposed_home"}

#: Records that the package makes, base classes, names of types, and entry points tried elsewhere.
NOT_CALLED = {
    "AddLoop", "ArmReport", "Array", "Body", "CampaignDocument", "CampaignResult",
    "Circumstances", "Clearance", "Command", "CommandReader", "Connection", "ContactModel",
    "ContinuousLaw", "ContinuousReading", "Controller", "Curve", "DrakeRnnError", "Drawing",
    "DriveOutcome", "DrivenRun",
    "Experiment", "ExperimentDocument", "Fastest", "Feedback", "Finite", "GuardCommand",
    "InvalidInputError", "Law",
    "Loop", "Many", "Meaning", "ModelSurface", "Moment", "Motion", "NonNegative", "Objective",
    "Only", "PacedConnection", "Passage", "Path",
    "PlacedPath", "Planar", "Positive", "PostureLaw", "RelativePath", "Result", "RobotError",
    "RobotStatus",
    "SampledLaw", "SampledReading", "Screws", "ShieldStatus", "ShieldView", "Signals",
    "SimulationError",
    "Surface",
    "TuningOutcome", "UnprotectedWarning",
    "Vector", "require_jax", "shipped_arms", "shipped_experiments",
}  # fmt: skip

HOSTILE = {
    "None": None, "a flag": True, "a complex number": 1j, "a text": "xyzzy", "NaN": float("nan"),
    "infinity": float("inf"), "-1": -1, "no entries": [], "no keys": {}, "an object": object(),
    "a matrix": np.zeros((3, 3)), "a huge number": 1e300, "bytes": b"x", "texts": ["a", "b"],
    "complex numbers": np.zeros(7, complex), "a whole number beyond floats": 10**400,
    "lists of two lengths": [[1], [2, 3]], "a set": {1}, "objects": np.array([None, 1]),
}  # fmt: skip
#: What no argument may be, unless it takes anything.
NEVER = {"a complex number", "an object", "complex numbers", "objects", "lists of two lengths"}
#: Arguments that messages know by the key of a document, or by what the document lacks.
SAID = {
    "load_arm.model": "arm", "make_obstacles.sections": "obstacles",
    "resume.contents": "there is no such",
    "Adaptive.points": "two for each point", "Points.points": "row 2", "Spline.points": "row 2",
    "Waypoints.positions": "w", "read_campaign.campaign": "experiment: must be given",
} | {
    f"{name}.experiment": "arm: must be given"
    for name in (
        "CompiledStep", "load_experiment", "simulate", "Slopes", "value_and_gradient", "tune",
        "why_not",
    )
} | {
    "make_experiment.document": "arm: must be given", "run_campaign.campaign": "must be given",
    "driven_experiment.experiment": "law: must be given",
}  # fmt: skip


def faults(name, argument):
    """What is wrong with the answers to hostile values of an argument."""
    call, right = getattr(d, name), RIGHT[name]
    usual = answer(call, right)
    for kind, value in HOSTILE.items():
        said = answer(call, right | {argument: value})
        if said == "taken":
            if kind in NEVER:
                yield f"{kind} is taken"
        elif "\n" in said or len(said) > 1000:
            yield f"{kind}: in several lines: {said}"
        elif not any(part in said for part in (argument, SAID.get(f"{name}.{argument}", usual))):
            yield f"{kind}: {said}"


def answer(call, arguments):
    """What is said of a call; "taken" if it is right."""
    try:
        call(**arguments)
    except InvalidInputError as refused:
        return str(refused)
    except Exception as other:
        if str(other) != "a run was started":
            return f"raises {type(other).__name__}, {other}"
    return "taken"


def test_everything_public_is_called():
    called = {name for name in d.__all__ if callable(getattr(d, name))}
    assert called - NOT_CALLED == RIGHT.keys()


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.long] * (each in TAKE_LONG)) for each in RIGHT]
)
@pytest.mark.filterwarnings("ignore")
def test_hostile_values_are_refused_by_the_name_of_the_argument(tmp_path, monkeypatch, name):
    if name in NEED_JAX:
        pytest.importorskip("jax", reason="needs the extra jax")
    monkeypatch.chdir(tmp_path)
    parameters = inspect.signature(getattr(d, name)).parameters.values()
    named = [p.name for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    found = [f"{key}: {each}" for key in named if key != "kind" for each in faults(name, key)]
    assert not [each for each in found if " raises " in each or "taken" in each], found
    assert not found
