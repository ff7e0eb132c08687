"""The screws of an arm, read from Drake's model of it."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.tree import Joint, PrismaticJoint, RevoluteJoint

from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from .arm import Arm
from .screws import Screws
from .structure import joints_to

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
