"""The arm in the scene, and the posture it should reach as a transparent image of it.

- The looks of an arm by another model of it, its maker's, whose links are drawn.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometryInstance,
    IllustrationProperties,
    Mesh,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    RoleAssign,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint
from pydrake.systems.framework import DiagramBuilder

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.kinematics import joints_to
from ..robot.model import read_model
from ..robot.model.conversion import simplify
from ..robot.model.model import quiet_drake
from ..systems.block import release

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
    context, bodies, meshes = _match(arm, plant)
    few = simplify([Path(str(each.mesh.source().path())) for each in meshes], arm.triangles)
    return [
        (
            bodies[each.joint],
            plant.EvalBodyPoseInWorld(context, bodies[each.joint]).inverse() @ each.X_WG,
            Mesh(str(mesh), each.mesh.scale3()),
        )
        for each, mesh in zip(meshes, few, strict=True)
    ]


def require_looks(arm: Arm) -> None:
    """Raise an InvalidInputError if an arm's ``looks`` is a file that cannot be drawn for it."""
    if arm.looks is not None:
        _match(arm, arm.plant())


def _match(arm: Arm, plant: MultibodyPlant) -> tuple[Any, list[Any], list[DrawnMesh]]:
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
    if not (meshes := maker.meshes()):
        raise InvalidInputError(f"arm.looks: {file.name} has no meshes that can be read")
    return context, bodies, meshes


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
                text = str(error).replace("arm.model: ", "", 1)
                raise InvalidInputError(f"arm.looks: {text}") from None
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
        drawn_meshes = []
        for body, joints in zip(self._bodies, self._moved_by, strict=True):
            if not self._belongs(body, joints):
                continue
            X_WB = self._plant.EvalBodyPoseInWorld(self._context, body)
            for geometry in self._plant.GetVisualGeometriesForBody(body):
                shape = inspector.GetShape(geometry)
                if isinstance(shape, Mesh):
                    X_WG = X_WB @ inspector.GetPoseInFrame(geometry)
                    drawn_meshes.append(DrawnMesh(len(joints), X_WG, shape))
        return drawn_meshes

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


TARGET_OPACITY = 0.4
# Begins the names of meshes that are drawn in place of the model's shapes.
_LOOKS = "looks_"
# Shapes whose only colour is the one in the model.
_PRIMITIVE = (Box, Capsule, Cylinder, Ellipsoid, Sphere)
# Weights of red, green and blue in the luminance, luminances and the greys that these are drawn in,
# and the share of a colour's difference from grey that is kept.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_LEVELS = (0.0, 0.6, 0.95)
_GREYS = np.array(
    [colours.components(each) for each in (colours.ARM_DARK, colours.ARM, colours.ARM_LIGHT)]
)
_TINT = 0.35

# Where arm and target posture coincide, only the arm should be seen, without flicker: the target
# is drawn as if it were some millimetres farther away, in units of the depth buffer.
_BEHIND = {
    "castShadow": False,
    "material.polygonOffset": True,
    "material.polygonOffsetFactor": 4.0,
    "material.polygonOffsetUnits": 100.0,
}
# A first layer fills the depth buffer and leaves no colour. The tint that is drawn after it is then
# that of the near side alone, without the parts inside.
_DEPTH_ONLY = {**_BEHIND, "material.colorWrite": False, "renderOrder": 1.0}


class DrawnArm:
    """An arm in the scene.

    Args:
        arm: The arm.
        meshcat: Meshcat with the scene.
        place: Scene path that it is below.
    """

    def __init__(self, arm: Arm, meshcat: Meshcat, place: str = "/arm") -> None:
        self.arm = arm
        self._meshcat = meshcat
        self._place = place
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
        arm.add_to(self.plant)
        meshes = [] if arm.looks is None else meshes_of(arm, arm.plant())
        for number, (body, X_BG, mesh) in enumerate(meshes):
            own = self.plant.GetBodyByName(body.name())
            instance = GeometryInstance(X_BG, mesh, f"{_LOOKS}{number}")
            instance.set_illustration_properties(IllustrationProperties())
            self.plant.RegisterVisualGeometry(own, instance)
        self.plant.Finalize()
        # Drake warns that visualizers that exist do not see this; there is none yet.
        with quiet_drake(logging.ERROR):
            _mute(self.plant, scene_graph)
            _hide(self.plant, scene_graph, {body.name() for body, _, _ in meshes})
        parameters = MeshcatVisualizerParams()
        parameters.default_color = Rgba(*colours.components(colours.ARM))
        parameters.role = Role.kIllustration
        parameters.prefix = place
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
        self._diagram = builder.Build()
        release(self._diagram)
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self._context)
        self.inspector: SceneGraphInspector = scene_graph.model_inspector()
        for body in self._beyond_task_frame:
            # If a tool beyond the task frame were drawn, it would seem to be what follows the path.
            meshcat.SetProperty(self.place(body), "visible", False)

    @property
    def bodies(self) -> list[Any]:
        """All bodies, the world first."""
        return [self.plant.get_body(BodyIndex(k)) for k in range(self.plant.num_bodies())]

    def geometries(self) -> Iterator[tuple[Any, GeometryId]]:
        """Yield each drawn geometry and the body it belongs to."""
        for frame in self.inspector.GetAllFrameIds():
            for geometry in self.inspector.GetGeometries(frame, Role.kIllustration):
                yield self.plant.GetBodyFromFrameId(frame), geometry

    def place(self, body: Any) -> str:
        """Return the scene path of a body."""
        return f"{self._place}/{_scene_name(body)}"

    def carrier(self, name: str) -> Any:
        """Return a body that is seen and moves as the named one does, if possible itself; or None.

        Raises:
            RuntimeError: If there is no body of that name.
        """
        invisible = {body.index() for body in self._beyond_task_frame}
        visible = {body.index() for body, _ in self.geometries()} - invisible
        own = self.plant.GetBodyByName(name)
        alike = (own, *self.plant.GetBodiesWeldedTo(own))
        return next((body for body in alike if body.index() in visible), None)

    def set_posture(self, q: Array) -> None:
        """Set the joint positions, shape (n,) [rad], without drawing."""
        posture: Any = self.arm.posture(self.plant, q)
        self.plant.SetPositions(self._plant_context, posture)

    def X_WB(self, body: Any) -> RigidTransform:
        """Return the pose of a body in the posture that is set."""
        return self.plant.EvalBodyPoseInWorld(self._plant_context, body)

    def draw(self, q: Array, time: float) -> None:
        """Draw a posture, shape (n,) [rad]; record it at ``time`` [s] if the scene records."""
        self._context.SetTime(time)
        self.set_posture(q)
        self._diagram.ForcedPublish(self._context)

    def draw_target(self, q: Array) -> None:
        """Draw a transparent image of the moving bodies in posture ``q`` below "/target"."""
        self.set_posture(q)
        names = [_scene_name(body) for body in self._beyond_task_frame]
        for number, (body, geometry) in enumerate(self.geometries()):
            if self.plant.IsAnchored(body) or _scene_name(body) in names:
                continue
            place = f"/target/{_scene_name(body)}"
            path = f"{place}/{number:03d}"
            shape = _without_colour(self.inspector.GetShape(geometry))
            self._meshcat.SetTransform(place, self.X_WB(body))
            self._meshcat.SetTransform(path, self.inspector.GetPoseInFrame(geometry))
            layers = (("depth", 1.0, _DEPTH_ONLY), ("tint", TARGET_OPACITY, _BEHIND))
            for layer, opacity, look in layers:
                rgba = Rgba(*colours.components(colours.TARGET), opacity)
                self._meshcat.SetObject(f"{path}/{layer}", shape, rgba)
                for name, value in look.items():
                    self._meshcat.SetProperty(f"{path}/{layer}/<object>", name, value)

    @cached_property
    def _beyond_task_frame(self) -> list[Any]:
        """Bodies between the task frame and the tip of the tool, which are not drawn."""
        if self.arm.tip is None:
            return []
        task_body = self.plant.GetFrameByName(self.arm.frame).body().index()
        parents = {
            joint.child_body().index(): joint.parent_body()
            for joint in map(self.plant.get_joint, self.plant.GetJointIndices())
        }
        body, bodies = self.plant.GetFrameByName(self.arm.tip).body(), []
        while body.index() != task_body:
            bodies.append(body)
            if body.index() not in parents:
                return []  # the tip is not beyond the task frame
            body = parents[body.index()]
        return bodies


def _scene_name(body: Any) -> str:
    """Return the scene path of a body relative to the arm's."""
    return str(body.scoped_name().get_full()).replace("::", "/")


def _without_colour(shape: Shape) -> Shape:
    """Return a mesh's convex hull, which has no colours of its own; any other shape as it is."""
    return Convex(shape.source(), shape.scale3()) if isinstance(shape, Mesh) else shape


def _mute(plant: Any, scene_graph: SceneGraph) -> None:
    """Draw primitive shapes in pale colours, which no path has; meshes keep theirs."""
    inspector = scene_graph.model_inspector()
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        properties = inspector.GetIllustrationProperties(geometry)
        if not isinstance(inspector.GetShape(geometry), _PRIMITIVE):
            continue
        if properties is None or not properties.HasProperty("phong", "diffuse"):
            continue
        pale = IllustrationProperties(properties)
        pale.UpdateProperty("phong", "diffuse", _pale(properties.GetProperty("phong", "diffuse")))
        scene_graph.AssignRole(plant.get_source_id(), geometry, pale, RoleAssign.kReplace)


def _hide(plant: Any, scene_graph: SceneGraph, names: Collection[str]) -> None:
    """Leave out the model's own shapes of the bodies of these names."""
    inspector = scene_graph.model_inspector()
    for name in names:
        for geometry in plant.GetVisualGeometriesForBody(plant.GetBodyByName(name)):
            if _LOOKS not in inspector.GetName(geometry):
                scene_graph.RemoveRole(plant.get_source_id(), geometry, Role.kIllustration)


def _pale(colour: Rgba) -> Rgba:
    """Return a pale image of a maker's colour: a grey as light as it is, with a tint of it."""
    rgb = np.array([colour.r(), colour.g(), colour.b()])
    luminance = float(rgb @ _LUMINANCE)
    grey = np.array([np.interp(luminance, _LEVELS, channel) for channel in _GREYS.T])
    pale = np.clip(grey + _TINT * (rgb - luminance), 0.0, 1.0)
    return Rgba(*pale, colour.a())
