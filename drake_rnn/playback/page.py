"""The page: the scene, and how it moves."""

from __future__ import annotations

import logging
import math

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from ..robot.drake_log import quiet_drake
from .camera import boxes_of
from .drawn_arm import DrawnArm
from .ghost import draw_ghost
from .replayed_motion import ReplayedMotion
from .shown import shown_of
from .stage import set_stage, with_caption

_FOR_EVER = 10**6


def make_page(motion: ReplayedMotion, rate: int) -> str:
    """The whole page as text, with ``rate`` frames per second."""
    experiment = motion.result.experiment
    arm = experiment.arm
    with quiet_drake(logging.WARNING):
        # A port of its own; nobody connects to it, and no browser is opened.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    drawn = DrawnArm(arm, meshcat)
    if experiment.target is not None:
        draw_ghost(meshcat, drawn, experiment.target)

    boxes = boxes_of(motion, drawn)
    shown = shown_of(motion, boxes)
    points = np.concatenate((boxes.corners, shown.set_up(meshcat)))
    size = float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor=float(points[:, 2].min()), size=size)
    shown.aim(meshcat)
    shown.draw(meshcat)

    frames = np.arange(math.ceil(motion.time[-1] * rate - 1e-6) + 1)
    time = frames / rate
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in zip(frames, motion.at(time, motion.position), strict=True):
        # Drake rounds a time down to its frame: half a frame later it finds the right one.
        drawn.show(q, (frame + 0.5) / rate)
    recording = meshcat.get_mutable_recording()
    shown.record(recording, time)
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(_FOR_EVER)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    with_ghost = experiment.target is not None
    return with_caption(meshcat.StaticHtml(), experiment.name or arm.name, with_ghost, shown.legend)
