"""The page: the scene and its animation."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from ..inputs.fields import Array
from ..robot.drake_log import quiet_drake
from .boxes import Boxes, boxes_of
from .drawn_arm import DrawnArm
from .labels import Label, with_labels
from .paths_beside import PathsBeside
from .paths_in_air import PathsInAir
from .paths_on_surface import PathsOnSurface
from .replay import ReplayedMotion, name_of, replayed_contact
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

    @property
    def labels(self) -> Sequence[Label]:
        """Labels of what is drawn."""


def make_page(motion: ReplayedMotion, rate: int, beside: Sequence[ReplayedMotion] = ()) -> str:
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
    size = float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    paths.aim()
    paths.draw()
    duration = max(each.duration for each in (motion, *beside))
    _record(meshcat, motion, duration, rate, drawn, paths)
    page = with_caption(
        meshcat.StaticHtml(),
        title=" beside ".join(name_of(each.result) for each in (motion, *beside)),
        with_target=experiment.target is not None,
        force=paths.legend,
        with_end=motion.ends,
        close=bool(beside) or experiment.contact is not None,
    )
    return with_labels(page, paths.labels)


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
    duration: float,
    rate: int,
    drawn: DrawnArm,
    paths: DrawnPaths,
) -> None:
    """Record the animation and publish it in the scene."""
    frames = np.arange(math.ceil(duration * rate - 1e-6) + 1)
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
