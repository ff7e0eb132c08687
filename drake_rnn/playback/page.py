"""The page: the scene with its animation, and the outcome of the run."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from ..inputs.fields import Array
from ..measures import LEAST, PREFIXED_UNITS, PREFIXES
from ..robot.drake_log import quiet_drake
from .accepted import accepted_bounds
from .arm_capsules import draw_capsules
from .boxes import Boxes, boxes_of
from .camera import some
from .cameras import Cameras, swaps_of
from .drawn_arm import DrawnArm
from .drawn_paths import DrawnPaths
from .joints import joints_of
from .locked_joints import LockedJoints, marks_of
from .obstacles import draw_obstacles, record_obstacles
from .outcome import outcome_of
from .packing import packed
from .paths_beside import PathsBeside
from .paths_in_air import PathsInAir
from .paths_on_surface import PathsOnSurface
from .recorded import recorded
from .replay import ReplayedMotion, name_of, replayed_contact
from .second_arm import SecondArm, second_arm
from .shown_curves import curves_of
from .stage import set_stage
from .template import rendered

# Ratio of the extents of path and scene below which the path is shown enlarged in a corner.
_SMALL = 0.3
# Extent of a traced path, relative to that of the scene, from which on it can be seen.
_SEEN = 0.005
# Number of points of the scene that the enlarged path must not cover.
_OCCUPIED = 1000


@dataclass(frozen=True, eq=False)
class Scene:
    """A motion's arm, surroundings and paths, drawn where the motion begins.

    Attributes:
        meshcat: Meshcat with the scene.
        motion: The motion.
        beside: Motions whose paths are drawn beside it.
        drawn: Its arm.
        second: Another arm beside it; None without one.
        locked: Marks of its joints that lock.
        cameras: Cameras that see its tool.
        paths: The paths.
        size: Largest extent [m].
        capsules: Scene paths of the arms' capsules.
    """

    meshcat: Meshcat
    motion: ReplayedMotion
    beside: Sequence[ReplayedMotion]
    drawn: DrawnArm
    second: SecondArm | None
    locked: LockedJoints
    cameras: Cameras
    paths: DrawnPaths
    size: float
    capsules: list[str]

    def as_data(self) -> dict[str, Any]:
        """Return what the page's picture is drawn with."""
        units = {"prefixes": PREFIXES, "prefixed": PREFIXED_UNITS, "least": LEAST}
        seen = _seen(self.motion, self.beside, self.paths, self.size)
        return {"size": self.size, "units": units, "capsules": self.capsules, **seen}


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
    scene = make_scene(motion, beside)
    duration = max(each.duration for each in (motion, *beside))
    frames = np.arange(math.ceil(duration * rate - 1e-6) + 1) / rate
    _record(scene, frames, rate)
    results = [each.result for each in (motion, *beside)]
    title = " beside ".join(map(name_of, results))
    data = {
        "name": name_of(motion.result),
        "duration": duration,
        "rate": rate,
        "window": _window(motion),
        "marks": marks_of(motion) + swaps_of(motion),
        "curves": _curves(motion, frames),
        "beside": [
            {"name": name_of(each.result), "curves": _curves(each, frames)} for each in beside
        ],
        "joints": joints_of(motion, frames),
        **scene.as_data(),
    }
    outcomes = [outcome_of(result) for result in results]
    return rendered(title, recorded(scene.meshcat.StaticHtml()), outcomes, data)


def _curves(motion: ReplayedMotion, frames: Array) -> list[dict[str, Any]]:
    """Return the curves of a motion, each with the bounds that it is expected to keep."""
    accepted = list(accepted_bounds(motion.result))
    return [
        {
            **curve.as_data(frames),
            # A bound of the curve itself is drawn without being accepted.
            "accepted": [
                each.as_data()
                for each in accepted
                if each.key == curve.key
                and (curve.bound is None or not np.isclose(each.level, curve.bound, atol=0.0))
            ],
        }
        for curve in curves_of(motion)
    ]


def make_scene(motion: ReplayedMotion, beside: Sequence[ReplayedMotion] = ()) -> Scene:
    """Return the scene of a motion, without its animation.

    Args:
        motion: The motion.
        beside: Motions whose paths are drawn beside those of ``motion``.
    """
    experiment = motion.result.experiment
    with quiet_drake(logging.WARNING):
        # Meshcat opens a port, but nothing connects to that port, and no browser is opened.
        meshcat = Meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    drawn = DrawnArm(experiment.arm, meshcat)
    if experiment.target is not None:
        drawn.draw_target(experiment.target)
    boxes = boxes_of(motion, drawn)
    second = second_arm(meshcat, motion)
    paths = _drawn_paths(meshcat, motion, beside, boxes, second)
    points = np.concatenate((boxes.corners, paths.set_up()))
    floor, size = float(points[:, 2].min()), float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor, size)
    draw_obstacles(meshcat, experiment.obstacles)
    capsules = draw_capsules(meshcat, drawn, experiment.clearance)
    if second is not None:
        capsules += second.draw_capsules()
    paths.draw(floor)
    locked = LockedJoints(meshcat, motion, drawn)
    cameras = Cameras(meshcat, motion)
    return Scene(meshcat, motion, beside, drawn, second, locked, cameras, paths, size, capsules)


def _seen(
    motion: ReplayedMotion, beside: Sequence[ReplayedMotion], paths: DrawnPaths, size: float
) -> dict[str, Any]:
    """Return the views, legend and labels of the scene, as the page reads them."""
    views = paths.views()
    turns = motion.result.experiment.desired.turns
    extent = float(np.ptp(motion.course, axis=0).max())
    moved = float(np.ptp(motion.traced, axis=0).max())
    return {
        "views": {name: view.as_data() for name, view in views.items()},
        "view": "close" if beside else "arm",
        "inset": extent < _SMALL * size and not beside and not motion.rests,
        "extent": extent,
        "rests": motion.rests,
        "grows": paths.grows(),
        "scaled": paths.scaled(),
        "labels": [label.as_data() for label in paths.labels],
        "occupied": packed(some(views["arm"].points, _OCCUPIED)),
        "legend": {
            "desired": not motion.rests,
            "traced": not motion.rests or moved > _SEEN * size,
            "end": motion.ends,
            "axes": turns and not beside and paths.legend is None,
            "target": motion.result.experiment.target is not None,
            "force": paths.legend,
            "locked": motion.result.experiment.locks is not None,
            "seen": motion.result.experiment.document.camera is not None,
            "ring": paths.legend is not None,
        },
    }


def _window(motion: ReplayedMotion) -> list[float] | None:
    """Return the time in which errors are evaluated [s, since the first sample]; None if always."""
    window = motion.result.experiment.document.window
    if window is None:
        return None
    return [end - float(motion.result.time[0]) for end in window]


def _drawn_paths(
    meshcat: Meshcat,
    motion: ReplayedMotion,
    beside: Sequence[ReplayedMotion],
    boxes: Boxes,
    second: SecondArm | None,
) -> DrawnPaths:
    """Return the paths of several runs, or of one: on the surface it presses on, or in the air."""
    if beside:
        return PathsBeside(meshcat, motion, beside, boxes)
    contact = replayed_contact(motion)
    if contact is None:
        return PathsInAir(meshcat, motion, boxes, second)
    return PathsOnSurface(meshcat, motion, contact, boxes)


def _record(scene: Scene, time: Array, rate: int) -> None:
    """Record the animation, ``time`` of each frame [s], and publish it in the scene."""
    meshcat, motion = scene.meshcat, scene.motion
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in enumerate(motion.at(time, motion.position)):
        # Drake rounds a time down to a frame: half a frame later, it finds the right one.
        scene.drawn.draw(q, (frame + 0.5) / rate)
    if scene.second is not None:
        scene.second.record(time, rate)
    recording = meshcat.get_mutable_recording()
    scene.paths.record(recording, time)
    scene.locked.record(recording, time)
    scene.cameras.record(recording, time)
    begin = float(motion.result.time[0])
    record_obstacles(recording, motion.result.experiment, begin + time)
    # The page has a clock of its own.
    recording.set_autoplay(False)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.StopRecording()
    meshcat.PublishRecording()
