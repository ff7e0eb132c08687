"""The page: the scene and its animation."""

from __future__ import annotations

import logging
import math
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from ..inputs.fields import Array
from ..robot.drake_log import quiet_drake
from .boxes import Boxes, boxes_of
from .drawn_arm import DrawnArm
from .paths_in_air import PathsInAir
from .paths_on_surface import PathsOnSurface
from .replay import ReplayedMotion, replayed_contact
from .stage import set_stage, with_caption

_FOREVER = 10**6


class DrawnPaths(Protocol):
    """A desired path and a traced one in the scene; the methods are called in this order."""

    def set_up(self) -> Array:
        """Draw what the paths lie on, if anything.

        Returns:
            Points that must be above the ground, shape (k, 3) [m].
        """

    def aim(self) -> None:
        """Place the camera where the paths are seen best."""

    def draw(self) -> None:
        """Draw the paths."""

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how they move and grow; ``time`` of each frame, shape (f,) [s]."""

    @property
    def legend(self) -> str | None:
        """Scale of the force arrow; None without one."""


def make_page(motion: ReplayedMotion, rate: int) -> str:
    """Return the whole page as text.

    Args:
        motion: The motion to replay.
        rate: Frame rate [1/s].
    """
    experiment = motion.result.experiment
    with quiet_drake(logging.WARNING):
        # Meshcat opens a port; nobody connects to it, and no browser is opened.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    drawn = DrawnArm(experiment.arm, meshcat)
    if experiment.target is not None:
        drawn.draw_target(experiment.target)
    boxes = boxes_of(motion, drawn)
    paths = _drawn_paths(meshcat, motion, boxes)
    points = np.concatenate((boxes.corners, paths.set_up()))
    size = float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    paths.aim()
    paths.draw()
    _record(meshcat, motion, rate, drawn, paths)
    return with_caption(
        meshcat.StaticHtml(),
        title=experiment.name or experiment.arm.name,
        with_target=experiment.target is not None,
        force=paths.legend,
        with_end=motion.ends,
    )


def _drawn_paths(meshcat: Meshcat, motion: ReplayedMotion, boxes: Boxes) -> DrawnPaths:
    """Return the paths on the surface that the tool presses against, or else in the air."""
    contact = replayed_contact(motion)
    if contact is None:
        return PathsInAir(meshcat, motion, boxes)
    return PathsOnSurface(meshcat, motion, contact, boxes)


def _record(
    meshcat: Meshcat, motion: ReplayedMotion, rate: int, drawn: DrawnArm, paths: DrawnPaths
) -> None:
    """Record the animation and publish it in the scene."""
    frames = np.arange(math.ceil(motion.duration * rate - 1e-6) + 1)
    time = frames / rate
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in zip(frames, motion.at(time, motion.position), strict=True):
        # Drake rounds a time down to a frame: half a frame later, it finds the right one.
        drawn.draw(q, (frame + 0.5) / rate)
    recording = meshcat.get_mutable_recording()
    paths.record(recording, time)
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(_FOREVER)
    meshcat.StopRecording()
    meshcat.PublishRecording()
