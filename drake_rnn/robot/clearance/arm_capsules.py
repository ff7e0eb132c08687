"""The capsules of an arm: fitted to its geometry, or read from a file, and placed in its model."""

# No postponed annotations: pydantic resolves those of fields.
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pydantic import Field
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, PrismaticJoint

from ...errors import InvalidInputError
from ...inputs.documents import construct, read_yaml
from ...inputs.fields import validated
from ...inputs.messages import nearest
from ..arm import Arm
from ..kinematics import joints_to
from .arm_shapes import ArmShapes, Part, arm_shapes, enclosing_capsule
from .capsules import ArmCapsules, Capsule, LinkPoses, number_names

# Least radius of a fitted capsule [m].
_THINNEST = 1e-5


@validated
class CapsulesFile:
    """The contents of a file of capsules.

    Args:
        capsules: The capsules; a body may have several.
        left_out: Pairs of bodies that are not looked at, because they cannot collide, or because
            their capsules touch where they do not. ``link 2`` is the second capsule of a body that
            has several.
        tools: Bodies of tools. What is stated of one counts only where the arm has it.
        source: The meshes that they hold, where these are not the model's own.
    """

    capsules: list[Capsule]
    left_out: list[tuple[str, str]] = Field(default_factory=list)
    tools: list[str] = Field(default_factory=lambda: ["tool"])
    source: list[str] = Field(default_factory=list)


def fitted_capsules(parts: Iterable[Part]) -> list[Capsule]:
    """Return a capsule round each part of an arm, which holds all of its points."""
    capsules = []
    for part in parts:
        ends, radius = part.exact or enclosing_capsule(part.points)
        wide = max(radius, _THINNEST)
        capsules.append(Capsule(body=part.body, ends=(ends[0], ends[1]), radius=wide))
    return capsules


def capsules_of(
    arm: Arm, shapes: ArmShapes | None = None
) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return the capsules of an arm, and the pairs of bodies that its file leaves out.

    Without a file all of them are fitted. To bodies that a file does not have, such as a tool that
    was added, capsules are fitted.

    Args:
        arm: The arm.
        shapes: The shapes of its bodies, if they are known already.

    Raises:
        InvalidInputError: If the file cannot be read, a field is wrong, a body does not exist, or a
            body without a capsule has a shape that has no bounds.
    """
    shapes = arm_shapes(arm) if shapes is None else shapes
    own_capsules, left_out = _read_capsules(arm)
    bodies = {capsule.body for capsule in own_capsules}
    for body, kind in shapes.endless.items():
        if body not in bodies:
            raise InvalidInputError(
                f"arm: {body!r} has a {kind}, round which no capsule fits; give the body a capsule "
                "in a file: arm.capsules"
            )
    others = [part for part in shapes.parts if part.body not in bodies]
    return [*own_capsules, *fitted_capsules(others)], left_out


def stated_bodies(arm: Arm) -> frozenset[str]:
    """Return the names of the bodies to which an arm's file gives capsules.

    Raises:
        InvalidInputError: As `capsules_of` does.
    """
    return frozenset(capsule.body for capsule in _read_capsules(arm)[0])


def _read_capsules(arm: Arm) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return what an arm's file states of bodies that the arm has."""
    if (file := arm.description.capsules) is None:
        return [], []
    read = construct(CapsulesFile, read_yaml(Path(file)), file)
    names = _names(arm.plant())
    absent = set(read.tools) - set(names)
    bodies = [capsule.body for capsule in read.capsules if capsule.body in names]
    names_of_file = {*names, *absent, *number_names(bodies)}
    for name in (name for pair in read.left_out for name in pair):
        if name not in names_of_file:
            raise InvalidInputError(
                f"{file}: left_out: no body {name!r} in {arm.model.name}; {nearest(name, names)}"
            )
    left_out = [pair for pair in read.left_out if not absent & set(pair)]
    return [capsule for capsule in read.capsules if capsule.body not in absent], left_out


def _names(plant: MultibodyPlant) -> list[str]:
    """Return the names of all bodies of a plant but the world."""
    bodies = map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies())))
    return [body.name() for body in bodies]


def place_capsules(arm: Arm, capsules: list[Capsule]) -> ArmCapsules:
    """Return an arm's capsules where all of its joints are at zero.

    Raises:
        InvalidInputError: If a body does not exist, or joints that are controlled do not follow one
            after the other from base to tip.
    """
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
    axes, points, slides = [], [], []
    for name in arm.joints:
        joint = plant.GetJointByName(name)
        X_WF = joint.frame_on_parent().CalcPoseInWorld(context)
        slides.append(isinstance(joint, PrismaticJoint))
        axis = joint.translation_axis() if slides[-1] else joint.revolute_axis()
        axes.append(X_WF.rotation().matrix() @ axis)
        points.append(X_WF.translation())
    names = _names(plant)
    links, ends = [], []
    for capsule in capsules:
        if capsule.body not in names:
            raise InvalidInputError(
                f"arm.capsules: no body {capsule.body!r} in {arm.model.name}; "
                + nearest(capsule.body, names)
            )
        body = plant.GetBodyByName(capsule.body)
        joint_names = [joint.name() for joint in joints_to(plant, body) if joint.num_positions()]
        if joint_names != list(arm.joints[: len(joint_names)]):
            raise InvalidInputError(
                f"arm.joints: {capsule.body!r} is moved by {', '.join(joint_names)}, which are not "
                "the first of the controlled joints; capsules need joints one after the other"
            )
        X_WB = body.EvalPoseInWorld(context)
        links.append(len(joint_names))
        ends.append([X_WB @ end for end in capsule.ends])
    farthest = np.maximum(np.abs(arm.limits.position_lower), np.abs(arm.limits.position_upper))
    travels = np.where(slides, farthest, 0.0)
    return ArmCapsules(
        poses=LinkPoses(np.array(axes), np.array(points), tuple(slides), travels),
        bodies=tuple(capsule.body for capsule in capsules),
        links=np.array(links),
        ends=np.array(ends).reshape(-1, 2, 3),
        radii=np.array([capsule.radius for capsule in capsules]),
    )
