"""The page: the scene with its animation, and what is told of the run."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from ..inputs.fields import Array
from ..measures import LEAST, PREFIXED_UNITS, PREFIXES
from ..robot.drake_log import quiet_drake
from .boxes import Boxes, boxes_of
from .drawn_arm import DrawnArm
from .labels import Label
from .outcome import outcome_of
from .packing import packed
from .paths_beside import PathsBeside
from .paths_in_air import PathsInAir
from .paths_on_surface import PathsOnSurface
from .recorded import recorded
from .replay import ReplayedMotion, name_of, replayed_contact
from .shown_curves import curves_of
from .stage import set_stage
from .template import rendered
from .views import View

# Ratio of the extents of path and scene below which the path is shown enlarged in a corner.
_SMALL = 0.3
# Number of points that it must not cover.
_OCCUPIED = 1000


class DrawnPaths(Protocol):
    """A desired path and a traced one in the scene; the methods are called in this order."""

    def set_up(self) -> Array:
        """Draw what the paths lie on, if anything.

        Returns:
            Points that must be above the ground, shape (k, 3) [m].
        """

    def stand(self, floor: float) -> None:
        """Draw what carries it, from the ground at the height ``floor`` [m]."""

    def draw(self) -> None:
        """Draw the paths."""

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how they move; ``time`` of each frame, shape (f,) [s]."""

    def views(self) -> dict[str, View]:
        """Return the views "arm", "close" and "path"."""

    def grows(self) -> list[dict[str, Any]]:
        """Return which meshes grow with time, and how."""

    def scaled(self) -> list[dict[str, Any]]:
        """Return what is drawn thicker or thinner, to suit the view."""

    @property
    def legend(self) -> str | None:
        """Scale of the force arrow; None without one."""

    @property
    def labels(self) -> Sequence[Label]:
        """Labels of what is drawn."""


def make_page(
    motion: ReplayedMotion,
    rate: int,
    beside: Sequence[ReplayedMotion] = (),
) -> str:
    """Return the whole page as text.

    Args:
        motion: The motion to replay.
        rate: Frame rate [1/s].
        beside: Motions whose paths are drawn beside those of ``motion``.
    """
    experiment = motion.result.experiment
    with quiet_drake(logging.WARNING):
        # Meshcat opens a port; nobody connects to it, and no browser is opened.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    drawn = DrawnArm(experiment.arm, meshcat)
    if experiment.target is not None:
        drawn.draw_target(experiment.target)
    boxes = boxes_of(motion, drawn)
    paths = _drawn_paths(meshcat, motion, beside, boxes)
    points = np.concatenate((boxes.corners, paths.set_up()))
    floor, size = float(points[:, 2].min()), float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor, size)
    paths.stand(floor)
    paths.draw()
    duration = max(each.duration for each in (motion, *beside))
    frames = np.arange(math.ceil(duration * rate - 1e-6) + 1) / rate
    _record(meshcat, motion, frames, rate, drawn, paths)
    title = " beside ".join(name_of(each.result) for each in (motion, *beside))
    data = {
        "duration": duration,
        "rate": rate,
        "size": size,
        "window": _window(motion),
        "units": {"prefixes": PREFIXES, "prefixed": PREFIXED_UNITS, "least": LEAST},
        "curves": [curve.as_data(frames) for curve in curves_of(motion)],
        **_seen(motion, beside, paths, size),
    }
    outcome = outcome_of(motion.result)
    if beside:
        # Numbers, curve and verdict are those of the run whose arm is shown.
        outcome["summary"] = f"{name_of(motion.result)}: {outcome['summary']}"
    return rendered(title, recorded(meshcat.StaticHtml()), outcome, data)


def _seen(
    motion: ReplayedMotion, beside: Sequence[ReplayedMotion], paths: DrawnPaths, size: float
) -> dict[str, Any]:
    """Return what the page shows of the scene, and from where."""
    views = paths.views()
    turns = motion.result.experiment.desired.turns
    extent = float(np.ptp(motion.course, axis=0).max())
    return {
        "views": {name: view.as_data() for name, view in views.items()},
        "view": "close" if beside else "arm",
        "inset": extent < _SMALL * size and not beside and not motion.rests,
        "extent": extent,
        "rests": motion.rests,
        "grows": paths.grows(),
        "scaled": paths.scaled(),
        "labels": [label.as_data() for label in paths.labels],
        "occupied": packed(_some(views["arm"].points)),
        "legend": {
            "desired": True,
            "traced": True,
            "end": motion.ends,
            "axes": turns and not beside and paths.legend is None,
            "target": motion.result.experiment.target is not None,
            "force": paths.legend,
            "ring": paths.legend is not None,
        },
    }


def _some(points: Array) -> Array:
    """Return some of the points of a scene, which the enlarged path must not cover."""
    return points[:: max(1, len(points) // _OCCUPIED)]


def _window(motion: ReplayedMotion) -> list[float] | None:
    """Return the time in which errors are evaluated [s, since the first sample]; None if always."""
    window = motion.result.experiment.document.window
    if window is None:
        return None
    return [end - float(motion.result.time[0]) for end in window]


def _drawn_paths(
    meshcat: Meshcat, motion: ReplayedMotion, beside: Sequence[ReplayedMotion], boxes: Boxes
) -> DrawnPaths:
    """Return the paths of several runs, or of one: on the surface it presses on, or in the air."""
    if beside:
        return PathsBeside(meshcat, motion, beside, boxes)
    contact = replayed_contact(motion)
    if contact is None:
        return PathsInAir(meshcat, motion, boxes)
    return PathsOnSurface(meshcat, motion, contact, boxes)


def _record(
    meshcat: Meshcat,
    motion: ReplayedMotion,
    time: Array,
    rate: int,
    drawn: DrawnArm,
    paths: DrawnPaths,
) -> None:
    """Record the animation, ``time`` of each frame [s], and publish it in the scene."""
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in enumerate(motion.at(time, motion.position)):
        # Drake rounds a time down to a frame: half a frame later, it finds the right one.
        drawn.draw(q, (frame + 0.5) / rate)
    recording = meshcat.get_mutable_recording()
    paths.record(recording, time)
    # The page has a clock of its own.
    recording.set_autoplay(False)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.StopRecording()
    meshcat.PublishRecording()
