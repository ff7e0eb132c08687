"""The arm in the scene, and the posture it should reach as a transparent image of it.

- A picture of an arm in a posture, rendered by Drake without a window.
- The looks of an arm by another model of it, its maker's, whose links are drawn.
- What a source wants of an arm behind a shield, and what keeps the arm from it.
"""

from __future__ import annotations

import ctypes
import logging
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    ClippingRange,
    ColorRenderCamera,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometryInstance,
    IllustrationProperties,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    Role,
    RoleAssign,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageRgba8U

from .. import colours
from ..errors import InvalidInputError
from ..features.feature import Frames, LegendEntry, SceneItem, Stage
from ..features.obstacles import shape_of
from ..inputs.fields import Array
from ..inputs.packages import import_name
from ..robot.arm import Arm
from ..robot.kinematics import joints_to
from ..robot.model import read_model
from ..robot.model.meshes import simplify
from ..robot.model.model import one_line, quiet_drake
from ..runs.folder import replacing, require_output
from ..shield.report import AHEAD, AT_WORK, IN_THE_WAY, LIMITS, WANTED
from ..systems.block import release

#: Numbers or flags.
AnyNumbers = NDArray[Any]

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
    axes = [_axis(context, joint) for joint in own]
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
        return [_axis(self._context, joint) for joint in self._chain]

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


def _axis(context: Any, joint: Any) -> tuple[Array, Array]:
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
# A mark is seen before what it marks.
_MARK = 0.6
_BEFORE = {
    "castShadow": False,
    "material.polygonOffset": True,
    "material.polygonOffsetFactor": -4.0,
    "material.polygonOffsetUnits": -100.0,
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
        for place, X_WB in self.target_poses(q).items():
            self._meshcat.SetTransform(place, X_WB)
        for body, number, geometry in self._moving:
            path = f"{_target_place(body)}/{number:03d}"
            shape = _without_colour(self.inspector.GetShape(geometry))
            self._meshcat.SetTransform(path, self.inspector.GetPoseInFrame(geometry))
            layers = (("depth", 1.0, _DEPTH_ONLY), ("tint", TARGET_OPACITY, _BEHIND))
            for layer, opacity, look in layers:
                rgba = Rgba(*colours.components(colours.TARGET), opacity)
                self._meshcat.SetObject(f"{path}/{layer}", shape, rgba)
                for name, value in look.items():
                    self._meshcat.SetProperty(f"{path}/{layer}/<object>", name, value)

    def target_poses(self, q: Array) -> dict[str, RigidTransform]:
        """Return the poses of the bodies of `draw_target` in a posture, by scene path."""
        self.set_posture(q)
        return {_target_place(body): self.X_WB(body) for body, _, _ in self._moving}

    def draw_mark(self, body: Any) -> str | None:
        """Draw a dark layer over a body, not yet seen, and return its scene path; None of none."""
        place, rgba = f"{self.place(body)}/mark", Rgba(*colours.components(colours.BOUND), _MARK)
        own = [(k, geometry) for each, k, geometry in self._moving if each.index() == body.index()]
        for number, geometry in own:
            path = f"{place}/{number:03d}"
            shape = _without_colour(self.inspector.GetShape(geometry))
            self._meshcat.SetObject(path, shape, rgba)
            self._meshcat.SetTransform(path, self.inspector.GetPoseInFrame(geometry))
            for name, value in _BEFORE.items():
                self._meshcat.SetProperty(f"{path}/<object>", name, value)
        if own:
            self._meshcat.SetProperty(place, "visible", False)
        return place if own else None

    @cached_property
    def _moving(self) -> list[tuple[Any, int, GeometryId]]:
        """Drawn geometries that move, each with its body and a number."""
        names = [_scene_name(body) for body in self._beyond_task_frame]
        return [
            (body, number, geometry)
            for number, (body, geometry) in enumerate(self.geometries())
            if not self.plant.IsAnchored(body) and _scene_name(body) not in names
        ]

    @cached_property
    def _beyond_task_frame(self) -> list[Any]:
        """Bodies between the frame and the tip of a tool, which are not drawn."""
        tips = (self.arm.tip, *(tool.tip for tool in self.arm.tools if tool != self.arm.tool))
        both = zip(self.arm.frames, tips, strict=False)
        return [body for frame, tip in both if tip for body in self._between(frame, tip)]

    def _between(self, frame: str, tip: str) -> list[Any]:
        task_body = self.plant.GetFrameByName(frame).body().index()
        parents = {
            joint.child_body().index(): joint.parent_body()
            for joint in map(self.plant.get_joint, self.plant.GetJointIndices())
        }
        body, bodies = self.plant.GetFrameByName(tip).body(), []
        while body.index() != task_body:
            bodies.append(body)
            if body.index() not in parents:
                return []  # the tip is not beyond the task frame
            body = parents[body.index()]
        return bodies


def _target_place(body: Any) -> str:
    return f"/target/{_scene_name(body)}"


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


# Radius of a point of the way ahead [m]; time for which a mark is seen at least [s].
_POINT, _LEAST_TIME = 0.006, 0.2


class WantedArm(SceneItem):
    """What a source wants of an arm behind a shield, and what keeps the arm from it.

    The posture that is wanted is a ghost below "/target", points of the way ahead are below
    "/ahead", and links and obstacles that a limit or a pair holds back have marks.

    Args:
        stage: Where it is drawn; the run has the series of `drake_rnn.shield.report.series_of`.
        arm: The arm.
    """

    legend = (
        LegendEntry("ghost", "wanted by the source", colour=colours.TARGET),
        LegendEntry("held", "held back by a limit or a pair", "■", colours.BOUND),
    )

    def __init__(self, stage: Stage, arm: DrawnArm) -> None:
        self._stage, self._arm = stage, arm
        series, clearance = stage.motion.result.series, stage.experiment.clearance
        count = len(stage.motion.time)
        self._wanted = series[WANTED][:count]
        self._limits, self._pairs = series[AT_WORK][:count], series[IN_THE_WAY][:count]
        self._ahead = series[AHEAD][:count] if AHEAD in series else None
        self.pair_names = () if clearance is None else tuple(dict.fromkeys(clearance.names))
        count = 0 if self._ahead is None else self._ahead.shape[1]
        self.points = [f"/ahead/{k}" for k in range(count)]
        self._marks: dict[str, str] = {}

    @property
    def corners(self) -> Array:
        """Where the tool is wanted, shape (k, 3) [m]."""
        kinematics = self._stage.experiment.arm.kinematics()
        every = self._wanted[:: max(1, len(self._wanted) // 100)]
        return np.array([kinematics.p_WE(q) for q in every])

    def draw(self) -> list[str]:
        """Draw the ghost, the points, and marks that are not yet seen."""
        meshcat = self._stage.meshcat
        self._arm.draw_target(self._wanted[0])
        for place in self.points:
            meshcat.SetObject(place, Sphere(_POINT), Rgba(*colours.components(colours.TARGET)))
        for name, body in self._bodies().items():
            if (mark := self._arm.draw_mark(body)) is not None:
                self._marks[name] = mark
        for number, obstacle in enumerate(self._stage.experiment.obstacles):
            self._marks[obstacle.name] = place = f"/obstacles/{number}/mark"
            rgba = Rgba(*colours.components(colours.BOUND), _MARK)
            meshcat.SetObject(place, shape_of(obstacle), rgba)
            for name, value in _BEFORE.items():
                meshcat.SetProperty(f"{place}/<object>", name, value)
            meshcat.SetProperty(place, "visible", False)
        return []

    def _bodies(self) -> dict[str, Any]:
        """Return bodies by the names of joints that move them, and of links of pairs."""
        plant = self._arm.plant
        bodies = {name: plant.GetJointByName(name).child_body() for name in self._arm.arm.joints}
        for name in {each for pair in self.pair_names for each in pair}:
            if plant.HasBodyNamed(name):
                bodies[name] = plant.GetBodyByName(name)
        return bodies

    def record(self, frames: Frames) -> None:
        """Record the ghost, the points and the marks, each mark for a while at least."""
        recording, motion = frames.recording, self._stage.motion
        for frame, q in enumerate(motion.at(frames.time, self._wanted)):
            for place, X_WB in self._arm.target_poses(q).items():
                recording.SetTransform(frame, place, X_WB)
        seen: dict[str, bool] = {}
        for frame, t in enumerate(frames.time.tolist()):
            for place, is_marked in self.marks(*self.held_since(t)).items():
                if seen.get(place) != is_marked:
                    seen[place] = is_marked
                    recording.SetProperty(frame, place, "visible", is_marked)
        self._record_points(frames)

    def _record_points(self, frames: Frames) -> None:
        if self._ahead is None:
            return
        motion = self._stage.motion
        at = np.clip(np.searchsorted(motion.time, frames.time), 0, len(motion.time) - 1)
        ahead = self._ahead[at]
        for number, place in enumerate(self.points):
            there = np.isfinite(ahead[:, number]).all(axis=1)
            frames.move(place, np.where(there[:, None], ahead[:, number], 0.0))
            changes = np.flatnonzero(np.diff(there, prepend=~there[0]))
            for frame in changes.tolist():
                frames.recording.SetProperty(frame, place, "visible", bool(there[frame]))

    def held_since(self, t: float) -> tuple[Array, Array]:
        """Return limits and pairs at work lately, of a time since the first sample [s].

        Returns:
            Numbers as in a `drake_rnn.shield.report.ShieldRecord`, shape (n,), and whether each
            pair is in the way, shape (p,).
        """
        times = self._stage.motion.time
        end = max(1, int(np.searchsorted(times, t + 1e-9, side="right")))
        at = slice(int(np.searchsorted(times[:end], t - _LEAST_TIME)), end)
        at = slice(min(at.start, end - 1), end)
        limits = self._limits[at]
        # Of a joint, the newest of its limits.
        newest = len(limits) - 1 - (limits[::-1] != 0.0).argmax(axis=0)
        return limits[newest, np.arange(limits.shape[1])], self._pairs[at].max(axis=0, initial=0.0)

    def marks(self, limits: AnyNumbers, pairs: AnyNumbers) -> dict[str, bool]:
        """Return whether each mark is seen, by scene path; arguments as of `restraint_text`."""
        near = [self.pair_names[k] for k in np.flatnonzero(pairs).tolist()]
        marked = {self._arm.arm.joints[k] for k in np.flatnonzero(limits).tolist()}.union(*near)
        places = dict.fromkeys(self._marks.values(), False)
        return places | {place: True for name, place in self._marks.items() if name in marked}

    def as_data(self, frames: Array) -> list[tuple[float, str]]:
        """Return what holds the arm back in words, from each time on; ``frames`` are times [s]."""
        told: list[tuple[float, str]] = []
        for t in frames.tolist():
            text = restraint_text(*self.held_since(t), self.pair_names)
            if not told or text != told[-1][1]:
                told.append((t, text))
        return told


def restraint_text(limits: AnyNumbers, pairs: AnyNumbers, names: Sequence[tuple[str, str]]) -> str:
    """Return in words what holds an arm back; empty for nothing.

    Args:
        limits: Limits at work, numbers as in a `drake_rnn.shield.report.ShieldRecord`, (n,).
        pairs: Whether each pair is in the way, shape (p,).
        names: Names of the pairs.
    """
    parts = [
        f"{one} near {other}" for one, other in (names[k] for k in np.flatnonzero(pairs).tolist())
    ]
    for number, name in enumerate(LIMITS, start=1):
        joints = (1 + np.flatnonzero(np.abs(limits) == number)).tolist()
        if joints:
            word = "joint" if len(joints) == 1 else "joints"
            parts.append(f"{name} of {word} {', '.join(map(str, joints))}")
    return f"held back: {'; '.join(parts)}" if parts else ""


# Size of the picture [pixels], vertical field of view [rad], and the room around the arm.
_WIDTH, _HEIGHT, _FIELD_OF_VIEW, _MARGIN = 900, 900, 0.6, 1.15
# Direction from the arm to the camera, for an arm that stands upright.
_FROM = np.array([0.75, -1.0, 0.45])
_SKY, _GROUND = np.array([0.93, 0.95, 0.97]), np.array([0.8, 0.83, 0.86, 1.0])
# Lights: direction and brightness, in the world frame.
_LIGHTS = (((-0.4, 0.6, -1.0), 1.9), ((-1.0, 0.2, -0.2), 1.2), ((0.6, 1.0, 0.2), 0.8))
# Length of the axes of E as a share of the size of the arm, and their radius over their length.
_AXES, _THICKNESS = 0.12, 0.04
_RENDERER = "picture"
# Of EGL: a display of a device, and how many devices are looked at.
_EGL_PLATFORM_DEVICE_EXT, _MOST_DEVICES = 0x313F, 16


class NoPictureError(InvalidInputError):
    """A picture that Drake cannot draw, for the machine or for a shape of the model."""


def write_arm_picture(arm: Arm, q: Array, file: str | Path) -> Path:
    """Write a picture of an arm, with the axes of its task frame E in red, green and blue.

    Args:
        arm: The arm.
        q: Posture, shape (n,) [rad].
        file: PNG file to write; its folder is created if it does not exist.

    Returns:
        The file.

    Raises:
        NoPictureError: If nothing here can draw, or Drake cannot draw the arm.
        InvalidInputError: If the file cannot be written.
    """
    if why := rendering_fault():
        raise NoPictureError(f"picture {file}: {why}")
    file = Path(file)
    require_output(file, "picture")
    # Drake warns of materials in meshes, when it reads them and when it draws them.
    with quiet_drake(logging.ERROR):
        try:
            image = _draw_arm(arm, q)
        # Drake exits where a condition of its own code fails.
        except (RuntimeError, SystemExit) as error:
            raise NoPictureError(
                f"picture {file}: Drake cannot draw {arm.name}: {one_line(error)}"
            ) from None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as new:
            picture = import_name("PIL.Image:fromarray")(np.asarray(image.data)[..., :3])
            picture.save(new, "PNG", optimize=True)
    except OSError as error:
        raise InvalidInputError(f"picture {file}: {error.strerror}") from None
    return file


def _draw_arm(arm: Arm, q: Array) -> ImageRgba8U:
    """Return the picture of an arm at a posture, shape (n,) [rad]."""
    skeleton = arm.kinematics().skeleton(q)
    size = max(float(np.ptp(skeleton, axis=0).max()), 0.1)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
    arm.add_to(plant)
    _add_axes(plant, arm, _AXES * size)
    ground = RigidTransform([0.0, 0.0, float(skeleton[:, 2].min()) - 0.012 * size])
    shape = Cylinder(0.45 * size, 0.004 * size)
    plant.RegisterVisualGeometry(plant.world_body(), ground, shape, "ground", _GROUND)
    plant.Finalize()
    scene_graph.AddRenderer(_RENDERER, MakeRenderEngineVtk(_parameters()))
    diagram = builder.Build()
    release(diagram)
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), arm.posture(plant, q))
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    middle = (skeleton.min(axis=0) + skeleton.max(axis=0)) / 2.0
    radius = _MARGIN * float(np.linalg.norm(np.ptp(skeleton, axis=0)) / 2.0 + 0.1 * size)
    return query.RenderColorImage(
        _camera(radius), scene_graph.world_frame_id(), _view(middle, radius)
    )


def rendering_fault() -> str:
    """Return why Drake cannot draw on this machine; empty if it can.

    On Linux it draws with EGL. Without a driver, as in a slim container, it would end the process.
    """
    if sys.platform != "linux" or _egl_starts():
        return ""
    return (
        "Drake finds no EGL to draw with; on Debian and Ubuntu: "
        "apt-get install libegl1 libgl1-mesa-dri"
    )


def _egl_starts() -> bool:
    """Return whether EGL is installed, and starts on a device."""
    pointer = ctypes.c_void_p
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    address = ctypes.CFUNCTYPE(pointer, ctypes.c_char_p)(("eglGetProcAddress", egl))
    query, display = address(b"eglQueryDevicesEXT"), address(b"eglGetPlatformDisplayEXT")
    if not (query and display):
        return False
    devices, count = (pointer * _MOST_DEVICES)(), ctypes.c_int()
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, pointer, pointer)(query)
    display_of = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display)
    initialize = ctypes.CFUNCTYPE(ctypes.c_uint, pointer, pointer, pointer)(("eglInitialize", egl))
    if not query_devices(_MOST_DEVICES, devices, ctypes.byref(count)):
        return False
    displays = (display_of(_EGL_PLATFORM_DEVICE_EXT, each, None) for each in devices[: count.value])
    return any(display and initialize(display, None, None) for display in displays)


def _parameters() -> RenderEngineVtkParams:
    parameters = RenderEngineVtkParams()
    parameters.default_clear_color = _SKY
    parameters.force_to_pbr = True  # as meshes are, which otherwise look darker than shapes
    parameters.lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=brightness)
        for direction, brightness in _LIGHTS
    ]
    return parameters


def _camera(radius: float) -> ColorRenderCamera:
    """Return a camera for a scene of this radius [m]."""
    info = CameraInfo(_WIDTH, _HEIGHT, _FIELD_OF_VIEW)
    clipping = ClippingRange(0.1 * radius, 20.0 * radius)
    return ColorRenderCamera(RenderCameraCore(_RENDERER, info, clipping, RigidTransform()), False)


def _view(middle: Array, radius: float) -> RigidTransform:
    """Return the pose of a camera that shows a sphere; it looks along z, and y points down."""
    direction = _FROM / np.linalg.norm(_FROM)
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    R = RotationMatrix(np.column_stack((right, -np.cross(direction, right), -direction)))
    return RigidTransform(R, middle + radius / np.sin(_FIELD_OF_VIEW / 2.0) * direction)


def _add_axes(plant: MultibodyPlant, arm: Arm, length: float) -> None:
    """Draw the axes of E as thin cylinders in red, green and blue."""
    frame = plant.GetFrameByName(arm.frame)
    X_BE = frame.GetFixedPoseInBodyFrame()
    for k, name in enumerate("xyz"):
        axis, colour = np.eye(3)[k], np.append(0.75 * np.eye(3)[k] + 0.1, 1.0)
        X_EG = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), length / 2.0 * axis)
        shape = Cylinder(_THICKNESS * length, length)
        X_BG = X_BE.multiply(X_EG)
        plant.RegisterVisualGeometry(frame.body(), X_BG, shape, f"E_{name}", colour)
