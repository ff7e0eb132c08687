"""The page: the scene, and how it moves."""

from __future__ import annotations

import logging
import math

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams, Rgba, Sphere

from ..drake_log import quiet_drake
from ..fields import Array
from .camera import aim_camera, boxes_of, view_direction
from .drawn_arm import DrawnArm
from .ghost import draw_ghost
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
    drawn = DrawnArm(arm, meshcat)
    if experiment.setup.target is not None:
        draw_ghost(meshcat, drawn, experiment.setup.target)

    boxes = boxes_of(motion, drawn)
    path = np.concatenate((motion.lap, motion.traced))
    points = np.concatenate((boxes.corners, path))
    size = float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    aim_camera(meshcat, points, path, view_direction(motion, boxes))

    radius = 0.003 * size
    _set_desired(meshcat, motion, radius)
    appearing = set_trace(meshcat, motion, radius)
    meshcat.SetObject("/traced/point", Sphere(2.0 * radius), Rgba(*TRACED_COLOUR))

    frames = np.arange(math.ceil(motion.time[-1] * rate - 1e-6) + 1)
    time = frames / rate
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in zip(frames, _at(time, motion.time, motion.position), strict=True):
        # Drake rounds a time down to its frame: half a frame later it finds the right one.
        drawn.show(q, (frame + 0.5) / rate)
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
    with_ghost = experiment.setup.target is not None
    return with_caption(meshcat.StaticHtml(), experiment.name or arm.name, with_ghost)


def _set_desired(meshcat: Meshcat, motion: ReplayedMotion, radius: float) -> None:
    """The path to follow, if it leads anywhere, and the point on it."""
    if not motion.rests:
        vertices, faces, _ = tube(thinned(motion.lap, radius)[0], 2.2 * radius)
        # Of the wider tube only the far inside is drawn: a rim round the trace that never
        # hides it.
        rim = Meshcat.SideOfFaceToRender.kBackSide
        meshcat.SetTriangleMesh("/desired/path", vertices, faces, Rgba(*DESIRED_COLOUR), side=rim)
    # Where it stays at the flange all the time, the flange is to be seen too.
    ball = Sphere((5.5 if motion.rests else 7.0) * radius)
    meshcat.SetObject("/desired/point", ball, Rgba(*DESIRED_COLOUR, 0.5))


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
