"""The page: the scene, and how it moves."""

from __future__ import annotations

import logging
import math

import numpy as np
from pydrake.geometry import (
    Meshcat,
    MeshcatAnimation,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    Sphere,
)
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from ..arms import Arm
from ..drake_log import quiet_drake
from ..fields import Array
from .camera import aim_camera, boxes_of, view_direction
from .replayed_motion import ReplayedMotion
from .stage import DESIRED_COLOUR, TRACED_COLOUR, set_stage, with_caption
from .tubes import thinned, tube

_FOR_EVER = 10**6
_PIECES_PER_SECOND = 12
_MOST_PIECES = 400


def make_page(motion: ReplayedMotion, rate: int) -> str:
    """The whole page as text, with ``rate`` frames per second."""
    experiment = motion.result.experiment
    arm = experiment.setup.arm
    with quiet_drake(logging.WARNING):
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

    for body in _beyond(plant, arm):
        # A tool past the task frame would look like what is to be on the path.
        meshcat.SetProperty(f"/arm/{body}", "visible", False)

    boxes = boxes_of(motion, diagram, plant, scene_graph)
    path = np.concatenate((motion.lap, motion.traced))
    points = np.concatenate((boxes.corners, path))
    size = float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    aim_camera(meshcat, points, path, view_direction(motion, boxes))

    radius = 0.003 * size
    vertices, faces, _ = tube(thinned(motion.lap, radius)[0], 2.2 * radius)
    # Of the wider tube only the far inside is drawn: a rim round the trace that never hides it.
    rim = Meshcat.SideOfFaceToRender.kBackSide
    meshcat.SetTriangleMesh("/desired/path", vertices, faces, Rgba(*DESIRED_COLOUR), side=rim)
    meshcat.SetObject("/desired/point", Sphere(7.0 * radius), Rgba(*DESIRED_COLOUR, 0.5))
    appearing = set_trace(meshcat, motion, radius)
    meshcat.SetObject("/traced/point", Sphere(2.0 * radius), Rgba(*TRACED_COLOUR))

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
    return with_caption(meshcat.StaticHtml(), experiment.name or arm.name)


def _beyond(plant: MultibodyPlant, arm: Arm) -> list[str]:
    """Scene names of the bodies between the task frame and the tool's tip."""
    if arm.tip is None:
        return []
    task_body = plant.GetFrameByName(arm.frame).body().index()
    parents = {
        joint.child_body().index(): joint.parent_body()
        for joint in map(plant.get_joint, plant.GetJointIndices())
    }
    body, names = plant.GetFrameByName(arm.tip).body(), []
    while body.index() != task_body:
        names.append(body.scoped_name().get_full().replace("::", "/"))
        if body.index() not in parents:
            return []  # the tip is not beyond the task frame
        body = parents[body.index()]
    return names


def _at(time: Array, samples: Array, values: Array) -> Array:
    """Columns of ``values``, linearly interpolated."""
    return np.column_stack([np.interp(time, samples, column) for column in values.T])


def _move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)


def set_trace(meshcat: Meshcat, motion: ReplayedMotion, radius: float) -> dict[str, float]:
    """The traced path in pieces, for what is recorded can show a mesh but not change it.

    Returns:
        The time since when each piece is to be seen [s], by its path in the scene.
    """
    points, kept = thinned(motion.traced, radius)
    time = motion.time[kept]
    vertices, faces, reached = tube(points, radius)
    count = min(math.ceil(time[-1] * _PIECES_PER_SECOND), _MOST_PIECES)
    ends = np.searchsorted(time, np.linspace(0.0, time[-1], count + 1)[1:] - 1e-9)
    appearing: dict[str, float] = {}
    begin = 0
    for end in np.unique(ends[ends > 0]):
        path = f"/traced/path/{len(appearing):03d}"
        piece = faces[:, reached[begin] : reached[end]]
        first, last = piece.min(), piece.max()
        meshcat.SetTriangleMesh(
            path, vertices[:, first : last + 1], piece - first, Rgba(*TRACED_COLOUR)
        )
        appearing[path] = float(time[end])
        begin = end
    return appearing


def _appear(recording: MeshcatAnimation, path: str, frame: int, last: int) -> None:
    recording.SetProperty(0, path, "visible", frame == 0)
    recording.SetProperty(frame, path, "visible", True)
    # A track repeats when it ends: this one must be as long as all others.
    recording.SetProperty(last, path, "visible", True)
