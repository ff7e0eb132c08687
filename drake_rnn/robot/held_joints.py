"""Joints that an arm does not control: each becomes a weld where the joint stands."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, WeldJoint

from .model import Mimic


def poses_where_held(
    plant: MultibodyPlant,
    controlled: Collection[str],
    lock: Mapping[str, float],
    mimics: Mapping[str, Mimic],
) -> dict[str, RigidTransform]:
    """Return the pose of each joint that is not controlled: its child's frame in its parent's.

    Args:
        plant: Finalized plant of the whole model.
        controlled: Names of the controlled joints.
        lock: Positions of some of the other joints [rad or m]. Joints that mimic one of these are
            held where they follow it, the rest at the model's default.
        mimics: Joints that follow others.
    """
    stands = dict(lock)
    for name, mimic in mimics.items():
        if name not in lock and mimic.joint in lock:
            stands[name] = mimic.multiplier * lock[mimic.joint] + mimic.offset
    joints = map(plant.get_joint, plant.GetJointIndices())
    held = [joint for joint in joints if joint.num_positions() and joint.name() not in controlled]
    context = plant.CreateDefaultContext()
    positions = plant.GetPositions(context)
    for joint in held:
        if joint.name() in stands:
            positions[joint.position_start()] = stands[joint.name()]
    plant.SetPositions(context, positions)
    return {
        joint.name(): joint.frame_on_child().CalcPose(context, joint.frame_on_parent())
        for joint in held
    }


def weld_joints(
    plant: MultibodyPlant, instance: ModelInstanceIndex, poses: Mapping[str, RigidTransform]
) -> None:
    """Replace joints of a model by welds of the same name, before the plant is finalized.

    Motors of these joints are removed. The plant must have no constraints.
    """
    for motor in map(plant.get_joint_actuator, plant.GetJointActuatorIndices()):
        if motor.model_instance() == instance and motor.joint().name() in poses:
            plant.RemoveJointActuator(motor)
    for name, X_PC in poses.items():
        joint = plant.GetJointByName(name, instance)
        parent, child = joint.frame_on_parent(), joint.frame_on_child()
        plant.RemoveJoint(joint)
        plant.AddJoint(WeldJoint(name, parent, child, X_PC))
