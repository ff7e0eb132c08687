"""The page: the scene, and how it moves."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform

from ..drake_log import quiet_drake
from ..fields import Array
from .camera import aim_camera, boxes_of, near, view_direction, view_onto
from .drawn_arm import DrawnArm
from .drawn_surface import draw_surface
from .force_arrow import LENGTH, newtons, record_arrow, set_arrow
from .ghost import draw_ghost
from .pressing import Pressing, pressing_of
from .replayed_motion import ReplayedMotion
from .ribbons import ribbon
from .stage import DESIRED_COLOUR, TRACED_COLOUR, set_stage, with_caption
from .tubes import thinned, tube

_FOR_EVER = 10**6
_PIECES_PER_SECOND = 12
_MOST_PIECES = 400
# A pen's line, and the wider one that it is to follow, over the extent of what is drawn.
_PEN, _GUIDE = 0.022, 0.05
# A ring that is seen round the tool's ball [m].
_SPOT = 0.016


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
    pressing = pressing_of(motion)
    path = np.concatenate((motion.lap, motion.traced))
    points = np.concatenate((boxes.corners, path))
    size = float(np.ptp(points, axis=0).max())
    if pressing is not None:
        points = np.concatenate((points, draw_surface(meshcat, pressing)))
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    if pressing is None:
        aim_camera(meshcat, points, path, view_direction(motion, boxes))
        radius = 0.003 * size
        _set_desired(meshcat, motion, radius)
        appearing = set_trace(meshcat, motion, radius)
        meshcat.SetObject("/traced/point", Sphere(2.0 * radius), Rgba(*TRACED_COLOUR))
    else:
        seen = near(pressing, boxes.corners)
        aim_camera(meshcat, seen, pressing.lap, view_onto(pressing, boxes))
        appearing = _set_drawing(meshcat, motion, pressing)
        set_arrow(meshcat)

    frames = np.arange(math.ceil(motion.time[-1] * rate - 1e-6) + 1)
    time = frames / rate
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in zip(frames, _at(time, motion.time, motion.position), strict=True):
        # Drake rounds a time down to its frame: half a frame later it finds the right one.
        drawn.show(q, (frame + 0.5) / rate)
    recording = meshcat.get_mutable_recording()
    if pressing is None:
        _move(recording, "/desired/point", _at(time, motion.time, motion.desired))
        _move(recording, "/traced/point", _at(time, motion.time, motion.traced))
    else:
        _move(recording, "/desired/point", _at(time, motion.time, pressing.desired))
        touched = _at(time, motion.time, pressing.contact)
        record_arrow(recording, pressing, touched, _at(time, motion.time, pressing.force))
    for piece, since in appearing.items():
        _appear(recording, piece, math.ceil(since * rate - 1e-6), int(frames[-1]))
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(_FOR_EVER)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    with_ghost = experiment.setup.target is not None
    force = None
    if pressing is not None:
        force = f"force, {newtons(pressing):g} N = {100.0 * LENGTH:g} cm"
    return with_caption(meshcat.StaticHtml(), experiment.name or arm.name, with_ghost, force)


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


def _set_drawing(meshcat: Meshcat, motion: ReplayedMotion, pressing: Pressing) -> dict[str, float]:
    """On a surface: the path to follow, the point on it, and what a pen draws.

    Returns:
        As `set_trace`.
    """
    extent = max(float(np.linalg.norm(np.ptp(pressing.lap, axis=0))), 0.02)

    def line(width: float) -> Callable[[Array], Any]:
        return lambda points: ribbon(points, pressing.normal, width)

    if not motion.rests:
        points, _ = thinned(pressing.lap, _PEN * extent / 4.0)
        vertices, faces, _ = line(_GUIDE * extent)(points)
        meshcat.SetTriangleMesh("/desired/path", vertices, faces, Rgba(*DESIRED_COLOUR))
    meshcat.SetObject("/desired/point", Cylinder(_SPOT, 1e-4), Rgba(*DESIRED_COLOUR, 0.5))
    meshcat.SetTransform("/desired/point", RigidTransform(pressing.R_WS, pressing.desired[0]))
    appearing: dict[str, float] = {}
    for stroke in pressing.strokes():
        points, kept = thinned(pressing.trace[stroke], _PEN * extent / 4.0)
        pieces = _pieces(motion.time[stroke][kept], float(motion.time[-1]))
        if len(kept) == 1:
            # A touch as short as a sample is a dot.
            points, kept, pieces = points[[0, 0]], [0, 0], iter([(0, 1)])
        _add_pieces(
            meshcat, appearing, line(_PEN * extent)(points), motion.time[stroke][kept], pieces
        )
    for layer in ("/desired", "/traced"):
        meshcat.SetProperty(layer, "castShadow", False)
    return appearing


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
    appearing: dict[str, float] = {}
    _add_pieces(meshcat, appearing, tube(points, radius), time, _pieces(time, float(time[-1])))
    return appearing


def _pieces(time: Array, until: float) -> Iterator[tuple[int, int]]:
    """First and last point of each piece of a line, whose points are passed at ``time``.

    Args:
        time: Shape (k,) [s].
        until: When the run ends [s].
    """
    count = min(math.ceil(until * _PIECES_PER_SECOND), _MOST_PIECES)
    ends = np.searchsorted(time, np.linspace(0.0, until, count + 1)[1:] - 1e-9)
    begin = 0
    for end in np.unique(np.minimum(ends[ends > 0], len(time) - 1)).tolist():
        yield begin, end
        begin = end


def _add_pieces(
    meshcat: Meshcat,
    appearing: dict[str, float],
    line: Any,
    time: Array,
    pieces: Iterator[tuple[int, int]],
) -> None:
    """Add a line, as `tube` and `ribbon` return it, to the traced path and to ``appearing``."""
    vertices, faces, reached = line
    for begin, end in pieces:
        path = f"/traced/path/{len(appearing):03d}"
        piece = faces[:, reached[begin] : reached[end]]
        first, last = piece.min(), piece.max()
        meshcat.SetTriangleMesh(
            path, vertices[:, first : last + 1], piece - first, Rgba(*TRACED_COLOUR)
        )
        appearing[path] = float(time[end])


def _appear(recording: MeshcatAnimation, path: str, frame: int, last: int) -> None:
    recording.SetProperty(0, path, "visible", frame == 0)
    recording.SetProperty(frame, path, "visible", True)
    # A track repeats when it ends: this one must be as long as all others.
    recording.SetProperty(last, path, "visible", True)
