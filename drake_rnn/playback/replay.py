"""The parts of a run that a page replays: the motion, and the contact with a surface.

- The surface that a tool presses against: drawn in the scene, and points brought onto it.
- Numbers as a page holds them.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from .. import colours
from ..environments import ModelSurface, Plate, Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.task import pose_of
from ..runs.result import Result
from ..systems.block import release

_PLATE = Rgba(*colours.components(colours.SURFACE))
_STAND = Rgba(*colours.components(colours.ARM_DARK))
# Radius of a post below a plate, relative to the plate's edge.
_POST = 0.06
# A surface without a thickness is drawn as a transparent sheet: its thickness, and how much wider
# than the drawing it is [m].
_SHEET = Rgba(*colours.components(colours.SURFACE), 0.6)
_SHEET_THICKNESS, _SHEET_MARGIN = 0.005, 0.16
_CORNERS = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)

# The surface of a model is searched for up to this distance from the model's plane [m].
_REACH = 0.3
_TOLERANCE = 1e-6
_MOST_STEPS = 60


def draw_surface(meshcat: Meshcat, surface: Surface, p_WS: Array, drawing: Array) -> Array:
    """Draw a surface below "/surface".

    Args:
        meshcat: Meshcat with the scene.
        surface: The surface.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        drawing: Points of what is drawn on it, shape (k, 3) [m]: a surface without edges is shown
            as far as they reach.

    Returns:
        Corners of boxes round the surface, shape (k, 3) [m].
    """
    if isinstance(surface, ModelSurface):
        corners = _draw_model(meshcat, surface, p_WS)
        if len(corners):
            return corners
    plate = surface if isinstance(surface, Plate) else _sheet(surface.normal_W, p_WS, drawing)
    box = Box(plate.size, plate.size, plate.thickness)
    pose = plate.pose(p_WS)
    meshcat.SetObject("/surface/plate", box, _PLATE if plate is surface else _SHEET)
    meshcat.SetTransform("/surface/plate", pose)
    return _corners(pose, box.size() / 2.0)


def draw_stand(meshcat: Meshcat, surface: Surface, p_WS: Array, floor: float) -> None:
    """Draw a post from the ground to the middle of a plate, which shows how the plate is inclined.

    Args:
        meshcat: Meshcat with the scene.
        surface: The surface; only a plate gets a post.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        floor: Height of the ground [m].
    """
    if not isinstance(surface, Plate):
        return
    x, y, z = surface.pose(p_WS).translation()
    if (height := float(z) - floor) > surface.thickness:
        radius = _POST * surface.size
        meshcat.SetObject("/stand", Cylinder(radius, height), _STAND)
        meshcat.SetTransform("/stand", RigidTransform([x, y, floor + height / 2.0]))


def clipped_to_edges(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Move points of a surface that lie beyond a plate's edges to the edges.

    A ball that rolls over an edge touches the plate there.

    Args:
        points: Points in the plane of the surface, shape (k, 3) [m].
        surface: The surface; only a plate has edges.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Returns:
        Shape (k, 3) [m].
    """
    if not isinstance(surface, Plate):
        return points
    pose = surface.pose(p_WS)
    p_P = (points - pose.translation()) @ pose.rotation().matrix()
    p_P[:, :2] = np.clip(p_P[:, :2], -surface.size / 2.0, surface.size / 2.0)
    return np.asarray(p_P @ pose.rotation().matrix().T + pose.translation())


def project(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Move points along the normal onto a surface.

    Args:
        points: Shape (k, 3) [m].
        surface: A plane, or a model that may be curved; beyond the model, the model's plane.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Returns:
        Shape (k, 3) [m].
    """
    n = surface.normal_W
    plane = points - np.outer((points - p_WS) @ n, n)
    if not isinstance(surface, ModelSurface):
        return plane
    builder, _, scene_graph = _model_scene(surface, p_WS)
    diagram = builder.Build()
    release(diagram)
    root = diagram.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))

    def height(point: Array) -> float:
        """Return the height of the model above its plane [m]; 0 where there is no model."""
        above = 0.0
        for _ in range(_MOST_STEPS):
            # Sphere tracing: a step as long as the distance never passes the surface.
            distances = query.ComputeSignedDistanceToPoint(point + above * n)
            distance = min((each.distance for each in distances), default=np.inf)
            above -= distance
            if abs(distance) < _TOLERANCE:
                return above
            if abs(above) > _REACH:
                break
        return 0.0

    return plane + np.outer([height(point) for point in plane], n)


def _sheet(n: Array, p_WS: Array, drawing: Array) -> Plate:
    """Return a thin plate with normal ``n``, wide enough for the drawing on it."""
    middle = (drawing.min(axis=0) + drawing.max(axis=0)) / 2.0
    offset = middle - p_WS
    return Plate(
        normal=n,
        size=2.0 * float(np.linalg.norm(drawing - middle, axis=1).max()) + _SHEET_MARGIN,
        thickness=_SHEET_THICKNESS,
        offset=offset - n.dot(offset) * n,
    )


def _draw_model(meshcat: Meshcat, surface: ModelSurface, p_WS: Array) -> Array:
    """Draw a model's illustration geometry, or its collision geometry if it has no other.

    Returns:
        Corners of boxes round its parts, shape (k, 3) [m]; none if it has no geometry.
    """
    builder, plant, scene_graph = _model_scene(surface, p_WS)
    inspector = scene_graph.model_inspector()
    parameters = MeshcatVisualizerParams()
    parameters.prefix = "/surface"
    parameters.default_color = _PLATE
    for role in (Role.kIllustration, Role.kProximity):
        geometries = [
            (frame, geometry)
            for frame in inspector.GetAllFrameIds()
            for geometry in inspector.GetGeometries(frame, role)
        ]
        if geometries:
            parameters.role = role
            break
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()
    release(diagram)
    context = diagram.CreateDefaultContext()
    diagram.ForcedPublish(context)
    plant_context = plant.GetMyContextFromRoot(context)
    corners = [np.zeros((0, 3))]
    for frame, geometry in geometries:
        if (box := inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_WB = plant.GetBodyFromFrameId(frame).EvalPoseInWorld(plant_context)
            X_BG = inspector.GetPoseInFrame(geometry)
            corners.append(_corners(X_WB @ X_BG @ box.pose(), box.half_width()))
    return np.concatenate(corners)


def _model_scene(surface: ModelSurface, p_WS: Array) -> tuple[DiagramBuilder, Any, SceneGraph]:
    """Return a builder, the plant and the scene graph that contain the model alone."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
    surface.add_to(plant, p_WS)
    plant.Finalize()
    return builder, plant, scene_graph


def _corners(X_WB: RigidTransform, half: Array) -> Array:
    """Return the corners of a box from its pose and half its extents, shape (8, 3) [m]."""
    return np.asarray(X_WB.multiply((_CORNERS * half).T).T)


# Extent below which a path is a point [m].
_STILL = 1e-6
# Heights of the desired and of the traced line above the surface [m]: far enough apart for a
# browser to draw one over the other.
_DESIRED_ABOVE = 4e-4
_TRACED_ABOVE = 8e-4


@dataclass(frozen=True)
class ReplayedMotion:
    """The motion of a run in the world frame: k samples, n joints, j points of a path.

    Attributes:
        result: The run.
        time: Time since the first sample, shape (k,) [s].
        position: Joint positions, shape (k, n) [rad].
        traced: Position of the end effector, shape (k, 3) [m].
        desired: Desired position of the end effector, shape (k, 3) [m].
        course: The desired path passed once, shape (j, 3) [m].
        ends: Whether the course shows an open path to its end.
    """

    result: Result
    time: Array
    position: Array
    traced: Array
    desired: Array
    course: Array
    ends: bool

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.time[-1])

    @property
    def rests(self) -> bool:
        """Whether the desired path is a single point."""
        return bool(np.ptp(self.course, axis=0).max() < _STILL)

    @property
    def turns(self) -> bool:
        """Whether the desired path turns the end effector."""
        return self.result.experiment.desired.turns

    def pen_is_down(self, points: Array) -> NDArray[np.bool_]:
        """Return which points of the desired path a pen draws, see `Path.pen_is_down`."""
        return self.result.experiment.path.pen_is_down(points)

    def path_time(self, time: float) -> float:
        """Return the time along the path, ``time`` [s] after the first sample [s]."""
        return float(self.result.time[0]) + time - self.result.experiment.path_delay

    def at(self, time: Array, values: Array) -> Array:
        """Return ``values``, shape (k, m), linearly interpolated at ``time``, shape (f,) [s]."""
        return np.column_stack([np.interp(time, self.time, column) for column in values.T])


@dataclass(frozen=True)
class ReplayedContact:
    """The contact of a run in the world frame: k samples, j points of a path.

    Attributes:
        surface: Surface that the tool presses against.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        desired_force: Desired force once it has risen [N].
        force: Force on the tool, shape (k, 3) [N].
        contact: Point of the surface closest to the tool, shape (k, 3) [m].
        course: The desired path passed once, as a line on the surface, shape (j, 3) [m].
        desired: Desired point on the surface, shape (k, 3) [m].
        trace: Line that a pen in place of the tool would draw, shape (k, 3) [m].
    """

    surface: Surface
    p_WS: Array
    desired_force: float
    force: Array
    contact: Array
    course: Array
    desired: Array
    trace: Array

    @property
    def normal(self) -> Array:
        """Unit normal out of the surface, shape (3,)."""
        return self.surface.normal_W

    @property
    def R_WS(self) -> RotationMatrix:
        """Axes of the surface, z along the normal."""
        return RotationMatrix.MakeFromOneVector(self.normal, 2)

    def strokes(self) -> Iterator[slice]:
        """Yield each interval of samples in which the surface pushes against the tool."""
        yield from stretches(self.force @ self.normal > 0.0)


def stretches(where: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield each interval of samples at which something holds."""
    changes = np.diff(where.astype(int), prepend=0, append=0)
    begins, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
    yield from map(slice, begins.tolist(), ends.tolist())


def name_of(result: Result) -> str:
    """Return the name of a run; of a run without a name, the name of its arm."""
    return result.experiment.name or result.experiment.arm.name


def replayed_motion(result: Result) -> ReplayedMotion:
    """Return the motion of a run, up to its last finite posture.

    Raises:
        InvalidInputError: If the run contains no finite posture.
    """
    experiment = result.experiment
    # A run that diverged is shown up to where it did.
    finite = np.isfinite(result.series["position"]).all(axis=1)
    count = finite.size if finite.all() else int(np.argmin(finite))
    if count == 0:
        raise InvalidInputError("playback: the run holds no posture")
    time = result.time[:count] - result.time[0]
    position = result.series["position"][:count]
    kinematics = experiment.arm.kinematics()
    # A planar task leaves the height as it is at the start.
    path = np.tile(experiment.desired.position(0.0)[0], (count, 1))
    path[:, list(experiment.task.axes)] = result.desired_position[:count]
    traced = np.array([kinematics.p_WE(q) for q in position])
    if (frame := path_frame(experiment)) is not None:
        R, p = frame.rotation().matrix(), frame.translation()
        path, traced = path @ R.T + p, traced @ R.T + p
    first_pass_end = experiment.desired.traversal + experiment.path_delay
    return ReplayedMotion(
        result=result,
        time=time,
        position=position,
        traced=traced,
        desired=path,
        course=path[time <= first_pass_end * (1.0 + 1e-9)],
        ends=not experiment.desired.closed and bool(time[-1] >= first_pass_end * (1.0 - 1e-9)),
    )


def path_frame(experiment: Any) -> RigidTransform | None:
    """Return where a path is drawn that one tool of two makes as the other one sees it.

    That is where the other one starts; None for any other path, which is in the world.
    """
    kinematics = experiment.arm.kinematics()
    if kinematics.tools is None or kinematics.tools.task_frame != "relative":
        return None
    pose = pose_of(kinematics, experiment.start, "first")
    return RigidTransform(RotationMatrix(pose.R), pose.p_WE)


def replayed_contact(motion: ReplayedMotion) -> ReplayedContact | None:
    """Return the contact of a motion; None for an experiment without one."""
    experiment = motion.result.experiment
    if experiment.contact is None:
        return None
    surface = experiment.contact.surface
    n = surface.normal_W
    p_WS = experiment.contact.place(experiment.arm, experiment.start)
    # Distance from the end effector to the tool's end, which touches the surface.
    standoff = float(n @ (experiment.p_WE_start - p_WS)) - surface.gap

    below = project(motion.traced - standoff * n, surface, p_WS)
    points = clipped_to_edges(below, surface, p_WS)
    desired_points = project(motion.desired, surface, p_WS) + _DESIRED_ABOVE * n
    return ReplayedContact(
        surface=surface,
        p_WS=p_WS,
        desired_force=experiment.contact.force.value,
        # A run that diverged may have postures without a finite force.
        force=np.nan_to_num(motion.result.series["contact_force"][: len(motion.time)]),
        contact=points,
        course=desired_points[: len(motion.course)],
        desired=desired_points,
        trace=points + _TRACED_ABOVE * n,
    )


# Cameras and labels need points to a tenth of a millimetre.
_DECIMALS = 4


def pack(values: ArrayLike) -> str:
    """Return numbers of any shape as base64 of 32-bit floats, low byte first; NaN is kept."""
    with np.errstate(over="ignore"):
        return b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def round_points(points: ArrayLike, decimals: int = _DECIMALS) -> Any:
    """Return points as nested lists of rounded numbers."""
    return np.round(np.asarray(points, dtype=float), decimals).tolist()
