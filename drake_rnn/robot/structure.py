"""What a plant consists of: the joints that hold its bodies, and its frames."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Body, BodyIndex, FrameIndex, Joint, ModelInstanceIndex

from ..inputs.complaints import nearest


def holders(plant: MultibodyPlant) -> dict[BodyIndex, Joint]:
    """Return the joint that holds each body of a plant, by the index of the body."""
    joints = map(plant.get_joint, plant.GetJointIndices())
    return {joint.child_body().index(): joint for joint in joints}


def joints_to(plant: MultibodyPlant, body: Body) -> list[Joint]:
    """Return the joints from the world to a body, welds included, in that order."""
    known, joints = holders(plant), list[Joint]()
    while (joint := known.get(body.index())) is not None:
        joints.insert(0, joint)
        body = joint.parent_body()
    return joints


def nearest_frame(
    plant: MultibodyPlant, name: str, instance: ModelInstanceIndex | None = None
) -> str:
    """Return a hint which frame to name in place of one that a plant does not have.

    Args:
        plant: The plant.
        name: The name that was given.
        instance: Model whose frames are named; by default all models of the plant.
    """
    every = map(plant.get_frame, map(FrameIndex, range(plant.num_frames())))
    names = {frame.name() for frame in every if instance in (None, frame.model_instance())}
    return nearest(name, sorted(names - {""}))
