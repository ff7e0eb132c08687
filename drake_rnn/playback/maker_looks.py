"""The looks of an arm by another model of it, its maker's, whose links are drawn."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Mesh, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.drake_log import quiet_drake
from ..robot.model import read_model
from ..robot.model.simplified import simplified
from ..robot.structure import joints_to

# Distance [m] and sine of the angle by which the joints of the two models may differ.
_NEAR, _ALONG = 2e-3, 1e-2


@dataclass(frozen=True)
class DrawnMesh:
    """A mesh of a link.

    Attributes:
        joint: Number of joints that move the link.
        X_WG: Pose of the mesh in the base frame, all joints at zero.
        mesh: The mesh.
    """

    joint: int
    X_WG: RigidTransform
    mesh: Mesh


def meshes_of(arm: Arm, plant: MultibodyPlant) -> list[tuple[Any, RigidTransform, Mesh]]:
    """Return what is drawn in place of an arm's own links: body, pose in it, and mesh.

    The poses are such that both models coincide where all joints are at zero: frames of links may
    differ.

    Args:
        arm: The arm, whose ``looks`` is a file.
        plant: Finalized plant with the arm.

    Raises:
        InvalidInputError: If the joints of the two models do not lie in the same places.
    """
    context, bodies, found = _matched(arm, plant)
    few = simplified([Path(str(each.mesh.source().path())) for each in found], arm.triangles)
    return [
        (
            bodies[each.joint],
            plant.EvalBodyPoseInWorld(context, bodies[each.joint]).inverse() @ each.X_WG,
            Mesh(str(mesh), each.mesh.scale3()),
        )
        for each, mesh in zip(found, few, strict=True)
    ]


def require_looks(arm: Arm) -> None:
    """Raise an InvalidInputError if an arm's ``looks`` is a file that cannot be drawn for it."""
    if arm.looks is not None:
        _matched(arm, arm.plant())


def _matched(arm: Arm, plant: MultibodyPlant) -> tuple[Any, list[Any], list[DrawnMesh]]:
    """Return a context with all joints at zero, the arm's bodies, and the meshes of the maker's."""
    file = Path(str(arm.looks))
    maker = _Maker(file, arm.description.packages, arm.n)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    own = [plant.GetJointByName(name) for name in arm.joints]
    axes = [_axis(plant, context, joint) for joint in own]
    for name, axis, other in zip(arm.joints, axes, maker.axes(), strict=True):
        _require_same(f"arm.looks: {file.name}: {name}", axis, other)
    bodies = [joints_to(plant, own[0].child_body())[0].child_body()]
    bodies += [joint.child_body() for joint in own]
    if not (found := maker.meshes()):
        raise InvalidInputError(f"arm.looks: {file.name} has no meshes that can be read")
    return context, bodies, found


class _Maker:
    """The maker's model, all joints at zero.

    Args:
        file: The model's file.
        packages: Folders of packages that it names.
        n: Number of its joints that the arm has too, from the base.

    Raises:
        InvalidInputError: If it has fewer joints in a chain.
    """

    def __init__(self, file: Path, packages: Mapping[str, str], n: int) -> None:
        self._scene_graph = SceneGraph()
        self._plant = plant = MultibodyPlant(0.0)
        plant.RegisterAsSourceForSceneGraph(self._scene_graph)
        with quiet_drake(logging.ERROR):
            try:
                read_model(file, packages).add_to(plant)
            except InvalidInputError as error:
                told = str(error).replace("arm.model: ", "", 1)
                raise InvalidInputError(f"arm.looks: {told}") from None
            plant.Finalize()
        self._context = plant.CreateDefaultContext()
        bodies = [plant.get_body(BodyIndex(k)) for k in range(1, plant.num_bodies())]
        self._moved_by = [_moving(joints_to(plant, body)) for body in bodies]
        longest = max(self._moved_by, key=len)
        if len(longest) < n:
            raise InvalidInputError(
                f"arm.looks: {file.name} has {len(longest)} joints in a chain; the arm has {n}"
            )
        self._bodies, self._chain = bodies, longest[:n]
        positions = plant.GetPositions(self._context)
        for joint in _moving(map(plant.get_joint, plant.GetJointIndices())):
            positions[joint.position_start()] = 0.0
        plant.SetPositions(self._context, positions)

    def axes(self) -> list[tuple[Array, Array]]:
        """Return a point on the axis of each joint and its direction."""
        return [_axis(self._plant, self._context, joint) for joint in self._chain]

    def meshes(self) -> list[DrawnMesh]:
        """Return the meshes of all links up to the flange."""
        inspector = self._scene_graph.model_inspector()
        found = []
        for body, joints in zip(self._bodies, self._moved_by, strict=True):
            if not self._belongs(body, joints):
                continue
            X_WB = self._plant.EvalBodyPoseInWorld(self._context, body)
            for geometry in self._plant.GetVisualGeometriesForBody(body):
                shape = inspector.GetShape(geometry)
                if isinstance(shape, Mesh):
                    X_WG = X_WB @ inspector.GetPoseInFrame(geometry)
                    found.append(DrawnMesh(len(joints), X_WG, shape))
        return found

    def _belongs(self, body: Any, joints: list[Joint]) -> bool:
        """Return whether a body is a link of the arm: not of a hand, nor beside the chain."""
        if len(joints) >= len(self._chain):
            return bool(body.index() == self._chain[-1].child_body().index())
        moves = [joint.index() for joint in joints]
        return moves == [joint.index() for joint in self._chain[: len(joints)]]


def _moving(joints: Iterable[Joint]) -> list[Joint]:
    return [joint for joint in joints if joint.num_positions() == 1]


def _axis(plant: MultibodyPlant, context: Any, joint: Any) -> tuple[Array, Array]:
    """Return a point on a joint's axis and the axis' direction, each of shape (3,), in W."""
    X_WJ = joint.frame_on_child().CalcPoseInWorld(context)
    slides = isinstance(joint, PrismaticJoint)
    axis = joint.translation_axis() if slides else joint.revolute_axis()
    return X_WJ.translation(), X_WJ.rotation() @ axis


def _require_same(what: str, one: tuple[Array, Array], other: tuple[Array, Array]) -> None:
    """Raise an InvalidInputError unless two axes are the same line, in the same sense."""
    (p, a), (q, b) = one, other
    away = float(np.linalg.norm(np.cross(q - p, a)))
    if a @ b < 0.0 or np.linalg.norm(np.cross(a, b)) > _ALONG or away > _NEAR:
        raise InvalidInputError(
            f"{what} is {away * 1e3:.3g} mm off the arm's axis, and has the direction "
            f"{np.round(b, 3).tolist()}, not {np.round(a, 3).tolist()}; it is no model of this arm"
        )
