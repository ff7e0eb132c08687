"""Arms by their shipped names, or from model files.

The screws of an arm, read from Drake's model of it.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint, RevoluteJoint

from ..errors import InvalidInputError
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array
from ..inputs.files import is_file
from ..inputs.messages import nearest, require_type
from ..models import MODELS
from .arm import Arm
from .arm_description import ArmDescription
from .drake_settings import quiet_drake
from .kinematics import joints_to
from .limits import JointLimits
from .limits_file import limits_beside, read_limits
from .model import read_model
from .screws import Screws

# Ends the names of files of limits that are not an arm's own.
_LIMITS = ".limits.yaml"


def shipped_arms() -> list[str]:
    """Return the names of the arms that come with this package."""
    return sorted(path.parent.name for path in MODELS.glob("*/arm.yaml"))


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
        raise InvalidInputError(
            f"limits: no limits {name!r}; {nearest(name, [*sorted(files), 'none'])}"
        )
    joints = read_yaml(files[name])["joints"]
    if len(joints) != arm.n:
        raise InvalidInputError(
            f"limits: {name} are those of {len(joints)} joints; {arm.name} has {arm.n}"
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
    folder = MODELS / name
    if name in shipped_arms():
        description = read_yaml(folder / "arm.yaml")
        description["model"] = str(folder / description["model"])
        description["limits"] = str(folder / "limits.yaml")
        description["capsules"] = str(folder / "capsules.yaml")
        arm = Arm(construct(ArmDescription, description, "arm"), name)
        return arm.replace(**changes) if changes else arm
    if Path(name).suffix.lower() not in {".urdf", ".sdf", ".xml", ".xacro"}:
        raise InvalidInputError(
            f"arm: no arm {name!r}; {nearest(name, shipped_arms())}, or a .urdf, .sdf, .xml "
            "or .xacro file"
        )
    fields = {"model": name, **changes}
    if "limits" not in changes and (beside := limits_beside(Path(name))) is not None:
        fields["limits"] = str(beside)
    if fields.get("frame") is None:
        raise InvalidInputError(f"arm.frame: must be given{_ends(Path(name), fields)}")
    return Arm(construct(ArmDescription, fields, "arm"), Path(name).stem)


def _ends(file: Path, fields: Mapping[str, Any]) -> str:
    """Return the ends of a model's chains, as a part of a sentence about its frames."""
    if not is_file(file):
        return ""
    plant = MultibodyPlant(0.0)
    with quiet_drake(logging.ERROR):
        read_model(file, fields.get("packages") or {}).add_to(plant)
    plant.Finalize()
    joints = map(plant.get_joint, plant.GetJointIndices())
    carry = {joint.parent_body().index() for joint in joints}
    bodies = map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies())))
    names = [body.name() for body in bodies if body.index() not in carry]
    return f"; the chains of {file.name} end in {', '.join(names[:12])}"


# Rounding errors that sines of pi leave in the frames of a model, whose entries are about 1.
_ROUNDING = 1e-15


def screws_of(arm: Arm) -> Screws:
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
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    E = plant.GetFrameByName(arm.frame)
    joints = [joint for joint in joints_to(plant, E.body()) if joint.num_positions()]
    if not joints:
        raise InvalidInputError(f"arm.frame: no joint moves {arm.frame!r}")
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
        axes=_rounded(np.array(axes)),
        offsets=_rounded(np.diff(points, axis=0)),
        R_WE=_rounded(X_WE.rotation().matrix()),
        R_WF=_rounded(np.array(frames)),
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


def _rounded(values: Array) -> Array:
    """Return values, with those that differ from 0, 1 or -1 only by rounding set to it."""
    near = np.round(np.clip(values, -1.0, 1.0))
    return np.where(np.abs(values - near) < _ROUNDING, near, values)
