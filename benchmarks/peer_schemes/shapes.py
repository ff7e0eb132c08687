"""What an arm and its obstacles look like to other libraries: the same capsules, balls and boxes.

Each capsule of the arm, and each obstacle, is a link of its own that a fixed joint holds, so that
pairs can be named by links. Pinocchio takes a cylinder for a capsule if its link says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from xml.etree import ElementTree

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drake_rnn import Array, InvalidInputError
from drake_rnn.robot.clearance.obstacles import BallObstacle, BoxObstacle
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.urdf import without_shapes


@dataclass(frozen=True)
class Shape:
    """A capsule, ball or box on a link.

    Attributes:
        name: Its name, and that of its own link.
        link: Link of the arm that carries it.
        X_LS: Its pose on that link; a capsule lies along z.
        radius: Radius of a capsule or ball [m]; 0 of a box.
        length: Length of a capsule's segment [m]; 0 of a ball.
        size: Edges of a box, shape (3,) [m]; None of others.
    """

    name: str
    link: str
    X_LS: RigidTransform
    radius: float = 0.0
    length: float = 0.0
    size: Array | None = None


@dataclass(frozen=True)
class Shapes:
    """The shapes of a task.

    Attributes:
        task: The task.
    """

    task: ObstacleTask

    @cached_property
    def arm(self) -> list[Shape]:
        """The arm's capsules, in the order of `ArmCapsules`."""
        return list(self._of_arm())

    @cached_property
    def obstacles(self) -> list[Shape]:
        """The obstacles, in the order of `Solids.names`.

        Raises:
            InvalidInputError: If one is neither a ball nor a box.
        """
        base, found = self._links[0], {}
        for obstacle in self.task.obstacles:
            name = obstacle.name.replace(" ", "_")
            if isinstance(obstacle, BallObstacle):
                X_LS = RigidTransform(obstacle.center)
                found[obstacle.name] = Shape(name, base, X_LS, radius=obstacle.radius)
            elif isinstance(obstacle, BoxObstacle):
                X_LS = RigidTransform(RotationMatrix(obstacle.R_WO), obstacle.center)
                found[obstacle.name] = Shape(name, base, X_LS, size=obstacle.size)
            else:
                raise InvalidInputError(f"{obstacle.name}: must be a ball or a box for peers")
        return [found[name] for name in self.task.clearance.solids.names]

    @cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """Names of the shapes of each pair, in the order of `Clearance.gaps`."""
        clearance = self.task.clearance
        own = [(self.arm[a].name, self.arm[b].name) for a, b in clearance.own]
        moved = np.flatnonzero(clearance.arm.carried_by_joint.any(axis=1))
        return [*own, *((self.arm[a].name, o.name) for o in self.obstacles for a in moved)]

    @cached_property
    def urdf(self) -> str:
        """The arm's URDF with these shapes and no others."""
        robot = ElementTree.fromstring(without_shapes(self.task.arm))
        for shape in (*self.arm, *self.obstacles):
            _add_link(robot, shape)
        return ElementTree.tostring(robot, encoding="unicode")

    @cached_property
    def _links(self) -> list[str]:
        """The base and the links that the joints move, from base to tip."""
        arm = self.task.arm
        joints = [arm.plant().GetJointByName(name) for name in arm.joints]
        return [joints[0].parent_body().name(), *(joint.child_body().name() for joint in joints)]

    def _of_arm(self) -> Iterator[Shape]:
        arm, placed = self.task.arm, self.task.clearance.arm
        plant = arm.plant()
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
        for number, (link, ends, radius) in enumerate(
            zip(placed.links, placed.ends, placed.radii, strict=True)
        ):
            body = plant.GetBodyByName(self._links[link])
            p, q = (body.EvalPoseInWorld(context).inverse() @ end for end in ends)
            length = float(np.linalg.norm(q - p))
            R = RotationMatrix.MakeFromOneVector(q - p, 2) if length > 0.0 else RotationMatrix()
            X_LS = RigidTransform(R, 0.5 * (p + q))
            yield Shape(f"capsule_{number}", self._links[link], X_LS, float(radius), length)


def _add_link(robot: ElementTree.Element, shape: Shape) -> None:
    link = ElementTree.SubElement(robot, "link", name=shape.name)
    collision = ElementTree.SubElement(link, "collision", name=shape.name)
    geometry = ElementTree.SubElement(collision, "geometry")
    if shape.size is not None:
        ElementTree.SubElement(geometry, "box", size=_words(shape.size))
    elif shape.length == 0.0:
        ElementTree.SubElement(geometry, "sphere", radius=repr(shape.radius))
    else:
        about = {"radius": repr(shape.radius), "length": repr(shape.length)}
        ElementTree.SubElement(geometry, "cylinder", about)
        checking = ElementTree.SubElement(link, "collision_checking")
        ElementTree.SubElement(checking, "capsule", name=shape.name)
    joint = ElementTree.SubElement(robot, "joint", name=f"{shape.name}_held", type="fixed")
    ElementTree.SubElement(joint, "parent", link=shape.link)
    ElementTree.SubElement(joint, "child", link=shape.name)
    rpy = RollPitchYaw(shape.X_LS.rotation()).vector()
    xyz = shape.X_LS.translation()
    ElementTree.SubElement(joint, "origin", xyz=_words(xyz), rpy=_words(rpy))


def _words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
