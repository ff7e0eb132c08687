"""The parts of a run that a page replays: the motion, and the contact with a surface.

- The surface that a tool presses against: drawn in the scene, and points brought onto it.
- Numbers as a page holds them.
- Moving parts of a scene: objects that the recording moves, and traced paths that grow.
- Lines as meshes: a browser draws a plain line only one pixel wide.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatAnimation,
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
from ..robot.task_frame import pose_of
from ..runs.result import Result
from ..systems.block import release

# Sides of a tube, and corners of a ribbon's round ends.
_TUBE_SIDES, _ROUND_CORNERS = 10, 24
# Elevations of the rings that round off a tube's end [rad].
_CAP_ANGLES = np.radians([90.0, 60.0, 30.0])
# Cosine of the angle of a corner from which on one tube ends there and another begins.
_SHARP = math.cos(math.radians(40.0))
# Cosine of the angle up to which two segments of a ribbon need no round joint.
_STRAIGHT = math.cos(math.radians(5.0))
# Length below which a segment has no direction [m].
_NO_LENGTH = 1e-12
_MOST_POINTS = 3000
# Longest time between two points that are kept [s]: a line grows from one to the next.
_STEP = 1.0 / 24.0


class LineMesh(NamedTuple):
    """A line as a triangle mesh.

    Attributes:
        vertices: Shape (3, v) [m].
        faces: Indices of each triangle's corners, in order along the line, shape (3, f).
        reached: Number of faces up to each point of the line, shape (k,).
    """

    vertices: Any
    faces: Any
    reached: NDArray[np.int64]


def thin(points: Array, step: float) -> tuple[Array, list[int]]:
    """Leave out points that are closer together than ``step`` [m].

    Args:
        points: Points along a line, shape (k, 3) [m].
        step: Smallest distance [m]; larger on a line so long that it would keep too many points.

    Returns:
        The remaining points, the first and the last included, and their indices.
    """
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    step = max(step, length / _MOST_POINTS)
    indices = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[indices[-1]]) >= step:
            indices.append(k)
    if indices[-1] != len(points) - 1:
        if len(indices) > 1:
            indices.pop()
        indices.append(len(points) - 1)
    return points[indices], indices


def simplify(points: Array, deviation: float, time: Array | None = None) -> list[int]:
    """Return indices of points that a line needs, the first and the last included.

    Args:
        points: Points along a line, shape (k, 3) [m].
        deviation: How far the line through the points that are kept may be off the others [m];
            more on a line so long that it would keep too many points.
        time: Time of each point, shape (k,) [s]; with it, points are kept at least every 1/24 s
            while they move.
    """
    _, candidates = thin(points, deviation)
    indices = [0]
    for before, here in pairwise(candidates[1:]):
        since = points[indices[-1] : here + 1]
        late = time is not None and time[here] - time[indices[-1]] > _STEP
        if late or _off(since) > deviation:
            indices.append(before)
    indices += candidates[-1:] if candidates[-1] != indices[-1] else []
    return indices


def _off(points: Array) -> float:
    """Return how far points are off the line from the first to the last of them [m]."""
    along = points[-1] - points[0]
    away = points[1:-1] - points[0]
    share = np.clip(away @ along / max(float(along @ along), _NO_LENGTH**2), 0.0, 1.0)
    return float(np.linalg.norm(away - np.outer(share, along), axis=1).max(initial=0.0))


def tube(points: Array, radius: float) -> LineMesh:
    """Return a round tube with round ends along points, shape (k, 3) [m].

    At a sharp corner one tube ends and another begins. A single point is a ball.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    up = np.array([[0.0, 0.0, 1.0]])
    directions = steps / np.maximum(lengths, _NO_LENGTH) if len(steps) else up
    rings = _Rings(radius)
    indices = [0]
    rings.begin(points[0], directions[0])
    for point, (before, after) in zip(points[1:], pairwise(directions), strict=False):
        if before @ after > _SHARP:
            rings.add(point, (before + after) / np.linalg.norm(before + after), radius)
            indices.append(rings.face_count)
        else:
            rings.end(point, before)
            indices.append(rings.face_count)
            rings.begin(point, after)
    rings.end(points[-1], directions[-1])
    if len(points) > 1:
        indices.append(rings.face_count)
    return _mesh(np.concatenate(rings.vertices).T, np.concatenate(rings.faces, axis=1), indices)


class _Rings:
    """Rings of vertices that a tube consists of, each connected to the one before by faces.

    Args:
        radius: Radius of the tube [m].
    """

    def __init__(self, radius: float) -> None:
        self._radius = radius
        self._normal = np.array([0.0, 0.0, 1.0])
        self.vertices: list[Array] = []
        self.faces: list[NDArray[np.int64]] = []

    @property
    def face_count(self) -> int:
        """Number of faces so far."""
        return len(self.faces) * _TUBE_SIDES

    def begin(self, point: Array, tangent: Array) -> None:
        """Begin a tube with a round end."""
        for k, angle in enumerate(_CAP_ANGLES):
            self._add_to_cap(point, tangent, -angle, is_connected=k > 0)
        self.add(point, tangent, self._radius)

    def end(self, point: Array, tangent: Array) -> None:
        """End a tube with a round end."""
        self.add(point, tangent, self._radius)
        for angle in _CAP_ANGLES[::-1]:
            self._add_to_cap(point, tangent, angle, is_connected=True)

    def add(self, centre: Array, tangent: Array, width: float, is_connected: bool = True) -> None:
        """Add a ring of radius ``width`` [m] across the tangent, a unit vector of shape (3,)."""
        # The normal is carried along the line, so that the rings twist as little as possible.
        normal = self._normal - (self._normal @ tangent) * tangent
        if np.linalg.norm(normal) < 1e-6:
            normal = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        self._normal = normal = normal / np.linalg.norm(normal)
        binormal = np.cross(tangent, normal)
        if is_connected:
            here = len(self.vertices) * _TUBE_SIDES + np.arange(_TUBE_SIDES)
            there = len(self.vertices) * _TUBE_SIDES + (np.arange(_TUBE_SIDES) + 1) % _TUBE_SIDES
            before, before_there = here - _TUBE_SIDES, there - _TUBE_SIDES
            self.faces.append(np.stack((before, before_there, there)))
            self.faces.append(np.stack((before, there, here)))
        angles = np.linspace(0.0, math.tau, _TUBE_SIDES, endpoint=False)
        outward = np.outer(np.cos(angles), normal) + np.outer(np.sin(angles), binormal)
        self.vertices.append(centre + width * outward)

    def _add_to_cap(self, centre: Array, tangent: Array, angle: float, is_connected: bool) -> None:
        """Add a ring on the ball round ``centre``, ``angle`` [rad] above its equator."""
        shift = self._radius * math.sin(angle)
        self.add(centre + shift * tangent, tangent, self._radius * math.cos(angle), is_connected)


def ribbon(points: Array, normal: Array, width: float) -> LineMesh:
    """Return a flat line with round ends and corners, as a pen draws it on a plane.

    Args:
        points: Two or more points of the plane, shape (k, 3) [m].
        normal: Unit normal of the plane, shape (3,).
        width: Width of the line [m].
    """
    steps = np.diff(points, axis=0)
    # Equal points need no segment between them: they are a dot.
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    along = steps / np.maximum(lengths, _NO_LENGTH)
    across = width / 2.0 * np.cross(normal, along)
    disc = width / 2.0 * _circle(normal)
    fan = np.array([(0, k, k + 1) for k in range(1, _ROUND_CORNERS - 1)])
    vertices: list[Array] = []
    faces: list[NDArray[np.int64]] = []
    indices = [0]
    vertex_count = face_count = 0

    def add(corners: Array, triangles: NDArray[np.int64]) -> None:
        nonlocal vertex_count, face_count
        vertices.append(corners)
        faces.append(triangles + vertex_count)
        vertex_count += len(corners)
        face_count += len(triangles)

    add(points[0] + disc, fan)
    begin_side = across[0]
    for k, side in enumerate(across):
        begin, end = points[k], points[k + 1]
        bends = k + 1 == len(across) or along[k] @ along[k + 1] < _STRAIGHT
        # Where the line goes on nearly straight, two segments meet in the middle of their edges.
        end_side = side if bends else (side + across[k + 1]) / 2.0
        quad = np.array([begin - begin_side, end - end_side, end + end_side, begin + begin_side])
        add(quad, np.array([(0, 1, 2), (0, 2, 3)]))
        if bends:
            add(end + disc, fan)
        begin_side = across[min(k + 1, len(across) - 1)] if bends else end_side
        indices.append(face_count)
    return _mesh(np.concatenate(vertices).T, np.concatenate(faces).T, indices)


def merge(lines: Sequence[LineMesh]) -> tuple[Any, Any]:
    """Return the vertices and faces of several lines as one mesh, as `LineMesh` has them."""
    first = np.cumsum([0, *(line.vertices.shape[1] for line in lines[:-1])], dtype=np.int32)
    faces = [line.faces + k for line, k in zip(lines, first, strict=True)]
    vertices = [line.vertices for line in lines]
    return _store(np.concatenate(vertices, axis=1)), _store(np.concatenate(faces, axis=1))


def _circle(normal: Array) -> Array:
    """Return corners on a unit circle in the plane with this normal, shape (k, 3)."""
    one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    one /= np.linalg.norm(one)
    angles = np.linspace(0.0, math.tau, _ROUND_CORNERS, endpoint=False)
    return np.outer(np.cos(angles), one) + np.outer(np.sin(angles), np.cross(normal, one))


def _mesh(vertices: Array, faces: NDArray[np.int64], indices: list[int]) -> LineMesh:
    """Return the mesh with its arrays stored as Meshcat takes them."""
    return LineMesh(_store(vertices), _store(faces.astype(np.int32)), np.array(indices))


def _store(values: Any) -> Any:
    """Return values stored as Meshcat takes them."""
    return np.asfortranarray(values)


def move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    """Record the position of an object frame by frame.

    Args:
        recording: The animation.
        path: Scene path of the object.
        points: Its position in each frame, shape (f, 3) [m].
    """
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)


class Trace:
    """Lines that grow: one mesh, of which the page shows the faces that are reached by a time.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
    """

    def __init__(self, meshcat: Meshcat, place: str = "/traced/path") -> None:
        self._meshcat = meshcat
        self._place = place
        self._lines: list[tuple[LineMesh, Array]] = []

    def add(self, line: LineMesh, time: Array) -> None:
        """Add a line.

        Args:
            line: The line, of two or more points.
            time: Time at which each point was passed, shape (k,) [s].
        """
        self._lines.append((line, np.asarray(time)))

    def draw(self) -> None:
        """Draw all lines; none, if none was added."""
        if not self._lines:
            return
        mesh = merge([line for line, _ in self._lines])
        draw_smooth(self._meshcat, self._place, *mesh, colours.TRACED)

    def as_data(self) -> list[dict[str, Any]]:
        """Return how the mesh grows: the number of faces that are visible at each time."""
        if not self._lines:
            return []
        before, indices = 0, []
        for line, _ in self._lines:
            # The round beginning of a line is visible from its first point on.
            indices.append(before + np.append(0, line.reached[1:]))
            before += line.faces.shape[1]
        time = np.concatenate([time for _, time in self._lines])
        faces = pack(np.concatenate(indices))
        return [{"path": self._place, "time": pack(time), "faces": faces}]


def draw_smooth(
    meshcat: Meshcat,
    place: str,
    vertices: Any,
    faces: Any,
    colour: str,
    side: Meshcat.SideOfFaceToRender = Meshcat.SideOfFaceToRender.kDoubleSide,
) -> None:
    """Draw a mesh whose faces join smoothly; Meshcat would show each of them flat.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
        vertices: Shape (3, v) [m].
        faces: Indices of each triangle's corners, shape (3, f).
        colour: One of `drake_rnn.colours`.
        side: Which side of the faces is drawn.
    """
    rgba = Rgba(*colours.components(colour))
    meshcat.SetTriangleMesh(place, vertices, faces, rgba, side=side)
    meshcat.SetProperty(f"{place}/<object>", "material.flatShading", False)


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
        shift: How far the surface has gone, with all that is drawn on it, shape (k, 3) [m]; other
            points are where they were at the start of a surface that moves. None for one that
            stands still.
    """

    surface: Surface
    p_WS: Array
    desired_force: float
    force: Array
    contact: Array
    course: Array
    desired: Array
    trace: Array
    shift: Array | None = None

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

    shift = None
    if experiment.contact.motion is not None:
        times = motion.time + motion.result.time[0]
        shift = np.array([experiment.contact.shift(t)[0] for t in times.tolist()])
    gone = 0.0 if shift is None else shift
    below = project(motion.traced - gone - standoff * n, surface, p_WS)
    points = clipped_to_edges(below, surface, p_WS)
    desired_points = project(motion.desired - gone, surface, p_WS) + _DESIRED_ABOVE * n
    return ReplayedContact(
        surface=surface,
        p_WS=p_WS,
        desired_force=experiment.contact.force.scale,
        # A run that diverged may have postures without a finite force.
        force=np.nan_to_num(motion.result.series["contact_force"][: len(motion.time)]),
        contact=points,
        course=desired_points[: len(motion.course)],
        desired=desired_points,
        trace=points + _TRACED_ABOVE * n,
        shift=shift,
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
