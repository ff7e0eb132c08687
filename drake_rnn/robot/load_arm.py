"""Arms by their shipped names, or from model files."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..inputs.documents import construct, read_yaml
from ..inputs.given_file import is_file
from ..models import MODELS
from .arm import Arm
from .arm_description import ArmDescription
from .drake_log import quiet_drake
from .limits import JointLimits
from .limits_file import limits_beside, read_limits
from .model import read_model

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
