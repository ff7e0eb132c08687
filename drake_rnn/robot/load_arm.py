"""Arms by their shipped names, or from model files.

- The screws of an arm, read from Drake's model of it.
- A report on an arm from its model: limits, reach, inertia, weight, and missing data.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint, RevoluteJoint

from ..errors import InvalidInputError
from ..inputs.documents import read_yaml
from ..inputs.fields import Array, checked, instance, whole
from ..inputs.files import is_file
from ..inputs.messages import metres_hint, nearest, plural, require_type
from ..models import MODELS
from .arm import MODEL_SUFFIXES, Arm, named_arm
from .arm import shipped_arms as shipped_arms
from .clearance.arm_clearance import clearance_of
from .kinematics import joints_to
from .limits import JointLimits
from .limits_file import read_limits
from .model import read_model
from .model.model import quiet_drake
from .postures import conditioning, proposed_home, random_postures, structural_rank
from .screws import PairScrews, Screws

# Ends the names of files of limits that are not an arm's own.
_LIMITS = ".limits.yaml"


def shipped_limits() -> dict[str, Path]:
    """Return the files of limits that come with this package, by name.

    These are the limits of each shipped arm, by the arm's name, and others of the same arms, such
    as ``fer``, the file ``fer.limits.yaml`` in the folder of ``panda``.
    """
    others = {path.name.removesuffix(_LIMITS): path for path in MODELS.glob(f"*/*{_LIMITS}")}
    return {name: MODELS / name / "limits.yaml" for name in shipped_arms()} | others


def named_limits(name: str, arm: Arm) -> JointLimits:
    """Return shipped limits for an arm, joint by joint from the base, whatever its joints' names.

    Args:
        name: A key of `shipped_limits`.
        arm: The arm.

    Raises:
        InvalidInputError: If there are no such limits, or they are of another number of joints.
    """
    files = shipped_limits()
    if name not in files:
        hint = "a file of limits is given in arm.limits"
        if Path(name).suffix.lower() not in {".yaml", ".yml"}:
            hint = nearest(name, [*sorted(files), "none"])
        raise InvalidInputError(f"limits: no limits {name!r}; {hint}")
    joints = read_yaml(files[name])["joints"]
    if len(joints) != arm.n:
        raise InvalidInputError(
            f"limits: {name} are those of {plural(len(joints), 'joint')}; {arm.name} has {arm.n}"
        )
    sheet = read_limits(files[name], joints, joints)
    return sheet.over(JointLimits.unlimited(arm.n), joints, str(files[name]))


def load_arm(model: str | Path, **changes: Any) -> Arm:
    """Return an arm by its shipped name, or from a model file.

    Args:
        model: A name from `shipped_arms`, or a URDF, SDF or MJCF file.
        changes: Fields of `ArmDescription` to set; a model file needs at least ``frame``. Limits
            beside a model file, ``my.limits.yaml`` for ``my.urdf``, are read unless ``limits`` is
            given; None takes those of the model alone.

    Raises:
        InvalidInputError: If there is no such arm, or as `Arm` does.
    """
    name = str(model)
    is_file_name = name not in shipped_arms() and Path(name).suffix.lower() in MODEL_SUFFIXES
    if is_file_name and changes.get("frame") is None:
        raise FrameMissingError(f"arm.frame: must be given{_ends(Path(name), changes)}")
    return named_arm(name, changes)


class FrameMissingError(InvalidInputError):
    """A model file whose frame is not given."""


def _ends(file: Path, fields: Mapping[str, Any]) -> str:
    """Return the ends of a model's chains, as a part of a sentence about its frames."""
    if not is_file(file):
        return ""
    plant = MultibodyPlant(0.0)
    with quiet_drake(logging.ERROR):
        pairs = (fields.get(key) or {} for key in ("packages", "xacro_arguments"))
        read_model(file, *pairs).add_to(plant)
    plant.Finalize()
    joints = map(plant.get_joint, plant.GetJointIndices())
    carry = {joint.parent_body().index() for joint in joints}
    bodies = map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies())))
    names = [body.name() for body in bodies if body.index() not in carry]
    return f"; the chains of {file.name} end in {', '.join(names[:12])}"


# Rounding errors that sines of pi leave in the frames of a model, whose entries are about 1.
_ROUNDING = 1e-15


def screws_of(arm: Arm) -> Screws | PairScrews:
    """Return the joints and the task frame of an arm where all joints are at zero.

    Tool, base and held joints are included as fixed parts.

    Args:
        arm: The arm, of revolute and prismatic joints.

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`, no joint moves E, or a joint of another kind
            does.
    """
    require_type("arm", arm, Arm)
    plant = arm.plant()
    first, *others = (_screws_to(arm, plant, frame) for frame in arm.frames)
    if not others:
        return first
    tools = arm.kinematics().tools
    assert tools is not None
    return PairScrews(first, others[0], tools.task_frame, tools.R_21)


def _screws_to(arm: Arm, plant: MultibodyPlant, frame: str) -> Screws:
    """Return the joints of an arm that lead to a frame, see `screws_of`."""
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    E = plant.GetFrameByName(frame)
    joints = [joint for joint in joints_to(plant, E.body()) if joint.num_positions()]
    if not joints:
        raise InvalidInputError(f"arm.frame: no joint moves {frame!r}")
    axes, points, frames = [], [np.zeros(3)], []
    for joint in joints:
        X_WF = joint.frame_on_parent().CalcPoseInWorld(context)
        R_WF = X_WF.rotation().matrix()
        axes.append(R_WF @ _axis(joint))
        points.append(X_WF.translation())
        frames.append(R_WF)
    X_WE = E.CalcPoseInWorld(context)
    points.append(X_WE.translation())
    return Screws(
        axes=_round(np.array(axes)),
        offsets=_round(np.diff(points, axis=0)),
        R_WE=_round(X_WE.rotation().matrix()),
        R_WF=_round(np.array(frames)),
        slides=tuple(isinstance(joint, PrismaticJoint) for joint in joints),
        columns=tuple(arm.joints.index(joint.name()) for joint in joints),
        n=arm.n,
    )


def _axis(joint: Joint) -> Array:
    """Return the axis of a joint in its frame on the parent."""
    if isinstance(joint, RevoluteJoint):
        return np.asarray(joint.revolute_axis())
    if isinstance(joint, PrismaticJoint):
        return np.asarray(joint.translation_axis())
    raise InvalidInputError(
        f"arm.joints: {joint.name()!r} is a {joint.type_name()} joint; kinematics for many know "
        "only revolute and prismatic ones"
    )


def _round(values: Array) -> Array:
    """Return values, with those that differ from 0, 1 or -1 only by rounding set to it."""
    near = np.round(np.clip(values, -1.0, 1.0))
    return np.where(np.abs(values - near) < _ROUNDING, near, values)


# A home posture closer than this to a limit [rad], or with a singular value of the Jacobian this
# small relative to the largest one, makes a poor start.
_NEAR = 0.05
_SINGULAR = 0.02
# Smallest eigenvalue of the mass matrix relative to the largest below which a body has no mass.
_MASSLESS = 1e-7


@dataclass(frozen=True, eq=False)
class ArmReport:
    """Figures of an arm; those of many postures are over random ones within the position limits.

    Attributes:
        arm: The arm.
        home: Its home posture; if it has none, the one that `proposed_home` proposes, shape (n,)
            [rad].
        home_is_proposed: Whether the arm has no home posture.
        p_WE_home: Position of E there in the base frame, shape (3,) [m].
        reach: Smallest and largest distance of E from the base's origin [m].
        mass: Mass of the whole model, base and tool included [kg].
        inertia: Smallest and largest eigenvalue of the mass matrix [kg m^2].
        weight_torque: Largest torque that gravity exerts on each joint, shape (n,) [Nm].
        weight_at_home: Torques that gravity exerts in the home posture, shape (n,) [Nm].
        postures: Number of random postures.
        warnings: Missing data and likely problems, each in one sentence.
    """

    arm: Arm
    home: Array
    home_is_proposed: bool
    p_WE_home: Array
    reach: tuple[float, float]
    mass: float
    inertia: tuple[float, float]
    weight_torque: Array
    weight_at_home: Array
    postures: int
    warnings: tuple[str, ...]

    @property
    def weight_share(self) -> Array:
        """Largest torque of the weight over each motor's limit, shape (n,); 0 without a limit."""
        return self.weight_torque / self.arm.effort

    @property
    def carries_itself(self) -> bool:
        """Whether the motors hold the arm and its tool in all of the random postures."""
        return bool((self.weight_share <= 1.0).all())


# Random postures of which figures are taken.
_MOST_POSTURES = 10**6


@checked(arm=instance(Arm), postures=whole(1, _MOST_POSTURES), seed=whole())
def arm_report(arm: Arm, postures: int = 1000, seed: int = 0) -> ArmReport:
    """Return figures of an arm, and warnings about missing data.

    Args:
        arm: The arm.
        postures: Number of random postures.
        seed: Seed of the random numbers.
    """
    kinematics = arm.kinematics()
    sample = random_postures(arm, postures, seed)
    home = proposed_home(arm) if arm.home is None else arm.home
    distances = [float(np.linalg.norm(kinematics.p_WE(q))) for q in sample]
    eigenvalues = np.array([np.linalg.eigvalsh(kinematics.M(q)) for q in sample])
    torques = np.abs([kinematics.gravity(q) for q in sample])
    reach = (min(distances), max(distances))
    inertia = (float(eigenvalues.min()), float(eigenvalues.max()))
    plant = arm.plant()
    warnings = [
        *arm.warnings,
        *_unknown(arm),
        *_home_doubts(arm, reach[1]),
        *_weight_doubts(arm, sample, torques),
        *_model_doubts(arm, inertia, reach[1]),
        *_shape_doubts(arm, home),
    ]
    return ArmReport(
        arm=arm,
        home=home,
        home_is_proposed=arm.home is None,
        p_WE_home=kinematics.p_WE(home),
        reach=reach,
        mass=arm.description.mass_scale * plant.CalcTotalMass(plant.CreateDefaultContext()),
        inertia=inertia,
        weight_torque=torques.max(axis=0),
        weight_at_home=kinematics.gravity(home),
        postures=postures,
        warnings=tuple(warnings),
    )


def _unknown(arm: Arm) -> list[str]:
    """Return a sentence about each kind of limit that is missing for some joints."""
    limits = arm.limits
    entries = []
    for name, bound, means in (
        ("velocity", limits.velocity, "laws that bound the velocity let them go at any speed"),
        ("effort", arm.effort, "their motors have no limit at level: dynamic"),
    ):
        if names := _names(arm, ~np.isfinite(bound)):
            entries.append(f"{name}: not known for {names}: {means}; give it in a file of limits")
    acceleration = np.full(arm.n, np.inf) if limits.acceleration is None else limits.acceleration
    if names := _names(arm, ~np.isfinite(acceleration)):
        entries.append(
            f"acceleration: not known for {names}; a law that needs it is refused without it: give "
            "it in a file of limits, or in the experiment's limits"
        )
    return entries


def _home_doubts(arm: Arm, reach: float) -> list[str]:
    if arm.home is None:
        return ["home: not given; an experiment needs it or a start, e.g. the one proposed"]
    limits, doubts = arm.limits, []
    room = np.minimum(arm.home - limits.position_lower, limits.position_upper - arm.home)
    if names := _names(arm, room < _NEAR):
        doubts.append(f"home: less than {_NEAR:g} rad from the limits of {names}")
    kinematics = arm.kinematics()
    rank = structural_rank(kinematics, random_postures(arm, 50), reach)
    smallest = float(conditioning(kinematics, arm.home, reach)[rank - 1])
    if smallest < _SINGULAR:
        doubts.append(
            f"home: near-singular; the smallest singular value of J is {smallest:.2g} of the "
            "largest"
        )
    return doubts


def _weight_doubts(arm: Arm, sample: Array, torques: Array) -> list[str]:
    doubts = []
    for k in np.flatnonzero((torques > arm.effort).any(axis=0)):
        worst = int(np.argmax(torques[:, k]))
        unit = "Nm" if arm.units[k] == "rad" else "N"
        posture = ", ".join(f"{angle:.2f}" for angle in sample[worst])
        doubts.append(
            f"effort: the motor of {arm.joints[k]} cannot hold the weight: it may exert "
            f"{arm.effort[k]:g} {unit}, and {torques[worst, k]:.4g} {unit} are needed at "
            f"[{posture}]"
        )
    return doubts


def _model_doubts(arm: Arm, inertia: tuple[float, float], reach: float) -> list[str]:
    doubts = []
    if hint := metres_hint(reach):
        doubts.append(f"model: the arm reaches {reach:.3g} m{hint}")
    if inertia[1] == 0.0:
        doubts.append(
            "inertia: none; the model states no mass, so the weights above say nothing, and level: "
            "dynamic is refused"
        )
    elif inertia[0] < _MASSLESS * inertia[1] and not hint:
        doubts.append(
            f"mass: the smallest eigenvalue of the mass matrix is {inertia[0]:.2g} kg m^2: a joint "
            "moves bodies without mass, which level: dynamic cannot simulate"
        )
    if arm.tip is None:
        doubts.append("tool: none; to press on a surface give one, e.g. tool: {length: 0.1}")
    return doubts


def _shape_doubts(arm: Arm, home: Array) -> list[str]:
    """Return what of the arm cannot be kept clear of obstacles and of the arm itself."""
    try:
        return list(clearance_of(arm, (), home)[1])
    except InvalidInputError as error:
        return [str(error)]


def _names(arm: Arm, indices: Iterable[object]) -> str:
    """Return the names of the joints that are chosen, empty for none."""
    names = [name for name, flag in zip(arm.joints, indices, strict=True) if flag]
    return "all joints" if len(names) == arm.n else ", ".join(names)
