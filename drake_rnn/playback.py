"""A run as a web page: the arm, the path it was asked to follow and the path it traced.

The page replays the recorded postures, over and over, in real time. It is one file that needs
no network: Drake's Meshcat, the scene and its animation are inside.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Meshcat,
    MeshcatAnimation,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Diagram, DiagramBuilder

from .errors import InvalidInputError
from .fields import Array
from .result import Result
from .systems.kinematics import TASKS

# Okabe and Ito's colours, which people with colour blindness tell apart.
_BLUE = (0.0, 0.447, 0.698)
_VERMILLION = (0.835, 0.369, 0.0)

_FIELD_OF_VIEW = math.radians(30.0)
_ASPECT = 1.5
_MARGIN = 1.08
_FOR_EVER = 10**6
_PIECES_PER_SECOND = 12
_MOST_PIECES = 400
_POSTURES = 24


def write_playback(result: Result, file: str | Path, frames_per_second: int = 64) -> Path:
    """Write a run as an HTML page that plays by itself, without a network.

    Args:
        result: The run.
        file: Where to write; replaced if it is there.
        frames_per_second: Of the replay.

    Returns:
        The file.

    Raises:
        InvalidInputError: If the file cannot be written, the rate is no positive integer, or
            the run holds no posture.
    """
    rate = frames_per_second
    if not isinstance(rate, int) or isinstance(rate, bool) or rate < 1:
        raise InvalidInputError(f"frames_per_second: must be a positive integer, not {rate!r}")
    file = Path(file)
    page = _page(_motion(result), rate)
    try:
        file.write_text(page, encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(f"playback file {file}: {error.strerror}") from None
    return file


@dataclass(frozen=True)
class _Motion:
    """What is replayed, in the world frame: k samples and one lap of the path."""

    result: Result
    time: Array
    position: Array
    traced: Array
    desired: Array
    lap: Array


def _motion(result: Result) -> _Motion:
    setup = result.experiment.setup
    # A run that diverged is shown for as long as it had a posture.
    finite = np.isfinite(result.series["position"]).all(axis=1)
    count = finite.size if finite.all() else int(np.argmin(finite))
    if count == 0:
        raise InvalidInputError("playback: the run holds no posture")
    time = result.time[:count] - result.time[0]
    position = result.series["position"][:count]
    kinematics = setup.arm.kinematics()
    desired = np.tile(setup.path.start_point(setup.p_WE_start), (count, 1))
    desired[:, list(TASKS[result.experiment.task])] = result.series["p_WE_desired"][:count]
    return _Motion(
        result=result,
        time=time,
        position=position,
        traced=np.array([kinematics.p_WE(q) for q in position]),
        desired=desired,
        lap=desired[time <= setup.path.period * (1.0 + 1e-9)],
    )


def _page(motion: _Motion, rate: int) -> str:
    experiment = motion.result.experiment
    arm = experiment.setup.arm
    with _quiet():
        # A port of its own; nobody connects to it, and no browser is opened.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    arm.add_to(plant)
    plant.Finalize()
    parameters = MeshcatVisualizerParams()
    parameters.role = Role.kIllustration
    parameters.prefix = "/arm"
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()

    boxes = _boxes(motion, diagram, plant, scene_graph)
    path = np.concatenate((motion.lap, motion.traced))
    points = np.concatenate((boxes.corners, path))
    size = float(np.ptp(points, axis=0).max())
    _set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    _aim_camera(meshcat, points, path, _direction(motion, boxes))

    radius = 0.003 * size
    vertices, faces, _ = _tube(_thinned(motion.lap, radius)[0], 2.2 * radius)
    # Of the wider tube only the far inside is drawn: a rim round the trace that never hides it.
    rim = Meshcat.SideOfFaceToRender.kBackSide
    meshcat.SetTriangleMesh("/desired/path", vertices, faces, Rgba(*_BLUE), side=rim)
    meshcat.SetObject("/desired/point", Sphere(7.0 * radius), Rgba(*_BLUE, 0.5))
    appearing = _set_trace(meshcat, motion, radius)
    meshcat.SetObject("/traced/point", Sphere(2.0 * radius), Rgba(*_VERMILLION))

    frames = np.arange(math.ceil(motion.time[-1] * rate - 1e-6) + 1)
    time = frames / rate
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    for frame, q in zip(frames, _at(time, motion.time, motion.position), strict=True):
        # Drake rounds a time down to its frame: half a frame later it finds the right one.
        context.SetTime((frame + 0.5) / rate)
        plant.SetPositions(plant_context, arm.posture(plant, q))
        diagram.ForcedPublish(context)
    recording = meshcat.get_mutable_recording()
    _move(recording, "/desired/point", _at(time, motion.time, motion.desired))
    _move(recording, "/traced/point", _at(time, motion.time, motion.traced))
    for piece, since in appearing.items():
        _appear(recording, piece, math.ceil(since * rate - 1e-6), int(frames[-1]))
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(_FOR_EVER)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    return _with_caption(meshcat.StaticHtml(), experiment.name or arm.name)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Meshcat's notice of where it listens."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(level, logging.WARNING))
    try:
        yield
    finally:
        log.setLevel(level)


def _at(time: Array, samples: Array, values: Array) -> Array:
    """Columns of ``values``, linearly interpolated."""
    return np.column_stack([np.interp(time, samples, column) for column in values.T])


def _move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)


def _set_trace(meshcat: Meshcat, motion: _Motion, radius: float) -> dict[str, float]:
    """The traced path in pieces, for what is recorded can show a mesh but not change it.

    Returns:
        The time since when each piece is to be seen [s], by its path in the scene.
    """
    points, kept = _thinned(motion.traced, radius)
    time = motion.time[kept]
    vertices, faces, reached = _tube(points, radius)
    count = min(math.ceil(time[-1] * _PIECES_PER_SECOND), _MOST_PIECES)
    ends = np.searchsorted(time, np.linspace(0.0, time[-1], count + 1)[1:] - 1e-9)
    appearing: dict[str, float] = {}
    begin = 0
    for end in np.unique(ends[ends > 0]):
        path = f"/traced/path/{len(appearing):03d}"
        piece = faces[:, reached[begin] : reached[end]]
        first, last = piece.min(), piece.max()
        meshcat.SetTriangleMesh(
            path, vertices[:, first : last + 1], piece - first, Rgba(*_VERMILLION)
        )
        appearing[path] = float(time[end])
        begin = end
    return appearing


def _appear(recording: MeshcatAnimation, path: str, frame: int, last: int) -> None:
    recording.SetProperty(0, path, "visible", frame == 0)
    recording.SetProperty(frame, path, "visible", True)
    # A track repeats when it ends: this one must be as long as all others.
    recording.SetProperty(last, path, "visible", True)


def _thinned(points: Array, step: float) -> tuple[Array, list[int]]:
    """Points at least a ``step`` apart, first and last included, and which they are."""
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    step = max(step, length / 3000)
    kept = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[kept[-1]]) >= step:
            kept.append(k)
    if kept[-1] != len(points) - 1:
        if len(kept) > 1:
            kept.pop()
        kept.append(len(points) - 1)
    return points[kept], kept


def _tube(points: Array, radius: float, sides: int = 8) -> tuple[Any, Any, NDArray[np.int64]]:
    """A round tube along a polyline, with round ends; a sharp corner is two ends.

    Returns:
        Vertices, shape (3, v); faces along the tube, shape (3, f); how many of the faces it
        takes to reach each point.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    # One point alone is a tube of no length.
    directions = steps / np.maximum(lengths, 1e-12) if len(steps) else np.array([[0.0, 0.0, 1.0]])
    along = np.linspace(0.0, math.tau, sides, endpoint=False)
    caps = np.radians([90.0, 60.0, 30.0])
    rings: list[Array] = []
    faces: list[Array] = []
    reached = [0]
    normal = np.array([0.0, 0.0, 1.0])

    def ring(centre: Array, tangent: Array, width: float, connected: bool) -> None:
        nonlocal normal
        # Carried along with as little twist as can be.
        normal = normal - (normal @ tangent) * tangent
        if np.linalg.norm(normal) < 1e-6:
            normal = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        normal = normal / np.linalg.norm(normal)
        binormal = np.cross(tangent, normal)
        if connected:
            here = len(rings) * sides + np.arange(sides)
            there = len(rings) * sides + (np.arange(sides) + 1) % sides
            before, before_there = here - sides, there - sides
            faces.append(np.stack((before, before_there, there)))
            faces.append(np.stack((before, there, here)))
        outward = np.outer(np.cos(along), normal) + np.outer(np.sin(along), binormal)
        rings.append(centre + width * outward)

    def cap(centre: Array, tangent: Array, side: float) -> None:
        for k, angle in enumerate(caps if side < 0 else caps[::-1]):
            shift = side * radius * math.sin(angle)
            connected = side > 0 or k > 0
            ring(centre + shift * tangent, tangent, radius * math.cos(angle), connected)

    cap(points[0], directions[0], -1.0)
    ring(points[0], directions[0], radius, True)
    for k in range(1, len(directions)):
        before, after = directions[k - 1], directions[k]
        if before @ after > math.cos(math.radians(40.0)):
            middle = (before + after) / np.linalg.norm(before + after)
            ring(points[k], middle, radius, True)
            reached.append(len(faces) * sides)
        else:
            ring(points[k], before, radius, True)
            cap(points[k], before, 1.0)
            reached.append(len(faces) * sides)
            cap(points[k], after, -1.0)
            ring(points[k], after, radius, True)
    ring(points[-1], directions[-1], radius, True)
    cap(points[-1], directions[-1], 1.0)
    if len(points) > 1:
        reached.append(len(faces) * sides)
    return (
        np.asfortranarray(np.concatenate(rings).T),
        np.asfortranarray(np.concatenate(faces, axis=1).astype(np.int32)),
        np.array(reached),
    )


@dataclass(frozen=True)
class _Boxes:
    """Boxes round the parts of the arm, posture by posture; b in all.

    Attributes:
        centre: Shape (b, 3) [m].
        axes: Their directions as columns, shape (b, 3, 3).
        half: Half their extents, shape (b, 3) [m].
    """

    centre: Array
    axes: Array
    half: Array

    @property
    def corners(self) -> Array:
        """Shape (8 b, 3) [m]."""
        signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)
        offsets = np.einsum("bij,kj,bj->bki", self.axes, signs, self.half)
        return np.asarray(self.centre[:, None] + offsets).reshape(-1, 3)

    def hidden(self, points: Array, direction: Array) -> float:
        """Share of ``points``, shape (k, 3), that something hides from that direction."""
        start = np.einsum("bij,bki->bkj", self.axes, points - self.centre[:, None])
        # Parallel to a face is as good as nearly so.
        ray = np.einsum("bij,i->bj", self.axes, direction)[:, None] + 1e-9
        one, other = (-self.half[:, None] - start) / ray, (self.half[:, None] - start) / ray
        enters = np.minimum(one, other).max(axis=2)
        leaves = np.maximum(one, other).min(axis=2)
        hit = (leaves >= np.maximum(enters, 0.0)).reshape(_POSTURES, -1, len(points))
        return float(hit.any(axis=1).mean())


def _boxes(
    motion: _Motion, diagram: Diagram, plant: MultibodyPlant, scene_graph: SceneGraph
) -> _Boxes:
    inspector = scene_graph.model_inspector()
    arm = motion.result.experiment.setup.arm
    plant_context = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
    # An arm may have nothing to draw; where its bodies are it has.
    bodies = [plant.get_body(BodyIndex(k)) for k in range(plant.num_bodies())]
    parts: list[tuple[Any, ...]] = [(body, RigidTransform(), np.zeros(3)) for body in bodies]
    for frame in inspector.GetAllFrameIds():
        for geometry in inspector.GetGeometries(frame, Role.kIllustration):
            if (box := inspector.GetObbInGeometryFrame(geometry)) is not None:
                X_BG = inspector.GetPoseInFrame(geometry) @ box.pose()
                parts.append((plant.GetBodyFromFrameId(frame), X_BG, box.half_width()))
    centre, axes = [], []
    for k in np.linspace(0, len(motion.time) - 1, _POSTURES).astype(int):
        posture: Any = arm.posture(plant, motion.position[k])
        plant.SetPositions(plant_context, posture)
        for body, X_BG, _ in parts:
            X_WG = plant.EvalBodyPoseInWorld(plant_context, body) @ X_BG
            centre.append(X_WG.translation())
            axes.append(X_WG.rotation().matrix())
    half = np.tile([half for *_, half in parts], (_POSTURES, 1))
    return _Boxes(np.array(centre), np.array(axes), half)


def _set_stage(meshcat: Meshcat, floor: float, size: float) -> None:
    """Ground, light and background; Meshcat's own axes and grid would be clutter."""
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.62, 0.73, 0.84])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.93, 0.95, 0.97])
    # Meshcat's grid has 40 cells of half a metre; these are of a tenth for arms of common size.
    scale = 0.2 * math.ceil(size / 1.5)
    meshcat.SetProperty("/Grid", "scale", [scale, scale, scale])
    meshcat.SetProperty("/Grid", "position", [0.0, 0.0, floor + 1e-3])
    meshcat.SetProperty("/Grid", "opacity", 0.3)
    meshcat.SetObject("/ground", Box(20.0 * scale, 20.0 * scale, 0.01), Rgba(0.80, 0.83, 0.86))
    meshcat.SetProperty("/ground", "position", [0.0, 0.0, floor - 0.006])
    for light in ("PointLightNegativeX", "PointLightPositiveX"):
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", 6.0)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    sun = "/Lights/FillLight/<object>"
    meshcat.SetProperty(sun, "position", [3.0, 4.0, 9.0])
    meshcat.SetProperty(sun, "intensity", 2.4)
    meshcat.SetProperty(sun, "castShadow", True)
    meshcat.SetProperty(sun, "shadow.mapSize.width", 4096.0)
    meshcat.SetProperty(sun, "shadow.mapSize.height", 4096.0)
    meshcat.SetProperty(sun, "shadow.normalBias", 0.01)


def _direction(motion: _Motion, boxes: _Boxes) -> Array:
    """From where to look, a unit vector from the scene to the camera.

    Best from ahead and aside, which shows the arm and a path in any upright plane, unless
    the arm hides the path from there; a path that lies flat is looked down upon.
    """
    lap = motion.lap[:: max(1, len(motion.lap) // 50)]
    centre = lap.mean(axis=0)
    normal = np.linalg.svd(lap - centre)[2][-1]
    if motion.result.experiment.task == "xy":
        return _towards(-math.pi / 2.0, math.radians(76.0))
    ahead = math.atan2(centre[1], centre[0])
    elevation = math.radians(16.0 + 16.0 * abs(normal[2]))

    def cost(aside: float) -> float:
        direction = _towards(ahead + math.radians(aside), elevation)
        face_on = min(abs(float(normal @ direction)), 0.7)
        return boxes.hidden(lap, direction) - face_on + 0.003 * abs(abs(aside) - 48.0)

    asides = (48.0, -48.0, 70.0, -70.0, 110.0, -110.0, 135.0, -135.0)
    return _towards(ahead + math.radians(min(asides, key=cost)), elevation)


def _towards(azimuth: float, elevation: float) -> Array:
    level = math.cos(elevation)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])


def _aim_camera(meshcat: Meshcat, points: Array, path: Array, direction: Array) -> None:
    """Put the camera as near as it can be with all ``points`` in its view."""
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    depth = points @ direction
    half_height = math.tan(_FIELD_OF_VIEW / 2.0) / _MARGIN
    camera: Any = np.zeros(3)
    distance = -math.inf
    for axis, slope in ((right, half_height * _ASPECT), (up, half_height)):
        # Both edges of the view touch the outermost points.
        above = float((points @ axis + slope * depth).max())
        below = float((-points @ axis + slope * depth).max())
        camera += (above - below) / 2.0 * axis
        distance = max(distance, (above + below) / (2.0 * slope))
    camera += distance * direction
    # The view turns about a point at the path's distance.
    target: Any = camera - (distance - float((path @ direction).mean())) * direction
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", math.degrees(_FIELD_OF_VIEW))
    meshcat.SetCameraPose(camera, target)


def _with_caption(page: str, title: str) -> str:
    """The page with its name, what the colours mean, and the time."""
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>")
    body, end = page.rsplit("</body>", 1)
    caption = _CAPTION.format(title=escape(title), desired=_css(_BLUE), traced=_css(_VERMILLION))
    return f"{body}{caption}</body>{end}"


def _css(colour: tuple[float, float, float]) -> str:
    return "rgb({}, {}, {})".format(*(round(255 * part) for part in colour))


_CAPTION = """
  <div id="caption">
    <b>{title}</b>
    <span style="color: {desired}">&#9679;</span> desired
    <span style="color: {traced}">&#9679;</span> traced
    <span id="clock"></span>
  </div>
  <style>
    #caption {{
      position: fixed; left: 1.2em; top: 0.9em; color: #223;
      font: 15px/1.5 system-ui, sans-serif; pointer-events: none;
    }}
    #caption span[style] {{ margin-left: 1em; font-size: 1.2em; }}
    .dg.main {{ opacity: 0.4; }}
    .dg.main:hover {{ opacity: 1; }}
    #clock {{ margin-left: 1em; font-variant-numeric: tabular-nums; }}
  </style>
  <script>
    (function tick() {{
      const seconds = viewer.animator.time.toFixed(1);
      document.getElementById("clock").textContent = seconds + " s";
      requestAnimationFrame(tick);
    }})();
  </script>
"""
