"""The page: the scene with its animation, and the outcome of the run.

- The surroundings of the arm: ground and lights. Their colours are the page's, light or dark.
- The expected and the measured outcome of a run, as the page's header shows them.
- The page's own HTML, style and scripts, which are files in ``web``, put together.
- The scene and animation that Drake's Meshcat recorded, taken from the page that Drake writes.
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, MeshcatParams, Rgba

from .. import colours
from ..experiment import COUNTED_LIMITS
from ..features.feature import Frames, SceneItem, Stage
from ..inputs.fields import Array
from ..inputs.files import page_templates
from ..laws.guarantee import promise_lines
from ..measures import LEAST, PREFIXED_UNITS, PREFIXES, format_quantity
from ..robot.model.model import quiet_drake
from ..runs.limit_use import conclusion_of, uses
from ..runs.result import Result, bound_text, meaning_of, value_text, words_of
from ..shield.report import WANTED
from .arm_drawing import DrawnArm, WantedArm
from .chart import accepted_bounds, curves_of, image_of, joints_of
from .path_drawings import DrawnPaths, PathsBeside, PathsInAir, PathsOnSurface
from .replay import ReplayedMotion, name_of, pack, replayed_contact, replayed_motion
from .viewpoint import Boxes, boxes_of, some

_GROUND = Rgba(0.80, 0.83, 0.86)
# Lights: a little from everywhere, most from one that throws shadows.
_INTENSITIES = {"PointLightNegativeX": 5.0, "PointLightPositiveX": 5.0, "AmbientLight": 0.9}
_SUN, _SUN_INTENSITY = [3.0, 4.0, 9.0], 2.1


def set_stage(meshcat: Meshcat, floor: float, size: float) -> None:
    """Set ground and lights.

    Args:
        meshcat: Meshcat with the scene.
        floor: Height of the ground [m].
        size: Largest extent of the scene, which sets the size of the grid [m].
    """
    meshcat.SetProperty("/Axes", "visible", False)
    # Meshcat's grid has 40 cells of 0.5 m.
    scale = _cell(size) / 0.5
    meshcat.SetProperty("/Grid", "scale", [scale, scale, scale])
    meshcat.SetProperty("/Grid", "position", [0.0, 0.0, floor + 1e-3])
    meshcat.SetObject("/ground", Box(20.0 * scale, 20.0 * scale, 0.01), _GROUND)
    meshcat.SetProperty("/ground", "position", [0.0, 0.0, floor - 0.006])
    for light, intensity in _INTENSITIES.items():
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)
    sun = "/Lights/FillLight/<object>"
    meshcat.SetProperty(sun, "position", _SUN)
    meshcat.SetProperty(sun, "intensity", _SUN_INTENSITY)
    meshcat.SetProperty(sun, "castShadow", True)
    meshcat.SetProperty(sun, "shadow.normalBias", 0.01)


def _cell(size: float) -> float:
    """Return the edge of a cell of the grid [m]: for an arm of common size 0.1 m."""
    return 0.1 * math.ceil(size / 1.5)


# Share of a bound below which there is nothing but rounding.
_UNUSED = 1e-6


def outcome_of(result: Result) -> dict[str, Any]:
    """Return what the page says of a run: texts, and whether each criterion and limit was met."""
    document, verdicts = result.experiment.document, result.verdicts
    conclusion = conclusion_of(result)
    limits = list(_limits(result))
    return {
        "name": name_of(result),
        "paper": document.paper,
        "expect": document.expect,
        "status": f"{result.ending}: {result.failure}".rstrip(": ") if result.ending else "",
        "kind": conclusion.kind,
        "verdict": conclusion.verdict,
        "summary": conclusion.criteria,
        "criteria": [
            {
                "name": words_of(each.metric),
                "meaning": meaning_of(each.metric),
                "value": value_text(each.metric, each.value, each.bound),
                "bound": bound_text(each.metric, each.bound),
                "met": each.met,
                "judged": each.judged,
            }
            for each in sorted(verdicts, key=lambda one: one.metric not in document.accept)
        ],
        "limits": limits,
        "broken": list(conclusion.broken),
        "limits_text": conclusion.limits,
        "promises": promise_lines(result.promises),
        "warnings": list(result.warnings),
    }


def _limits(result: Result) -> Iterator[dict[str, Any]]:
    """Yield each limit that applies: whether the run kept it, and by what margin.

    A limit whose share of its bound is a criterion is ``judged`` there.
    """
    metrics = {verdict.metric for verdict in result.verdicts}
    for use in uses(result):
        limit = COUNTED_LIMITS[use.name]
        share = f"up to {100.0 * use.share:.4g} %" if use.share > _UNUSED else "none"
        text = f"{share} of its bound"
        if use.name == "position":
            margin = result.metrics.get("joint_limit_margin_min_rad", np.nan)
            text = "exceeded by" if use.broken else "at least"
            text += f" {format_quantity(abs(margin), 'rad')}"
            text += "" if use.broken else " left"
        if use.broken and use.name in result.experiment.guarantees.command_only:
            text += " by the arm; the law keeps it of its command alone"
        yield {
            "name": use.name,
            "kept": not use.broken,
            "text": text,
            "judged": not use.broken and (limit.share or limit.metric) in metrics,
        }


# The viewer is the first script; what follows it makes a viewer, gives it its assets, and then one
# command after the other.
_SCRIPT = re.compile(r"<script[^>]*>(.*?)</script>", re.DOTALL)
_COMMAND = re.compile(r'fetch\("data:application/octet-binary;base64,([A-Za-z0-9+/=]+)"\)')
_ASSETS = re.compile(r"casAssets = \{\};.*?(?=fetch\(|\Z)", re.DOTALL)


@dataclass(frozen=True)
class RecordedScene:
    """A scene with its animation, as scripts and commands of Meshcat's viewer.

    Attributes:
        viewer: The viewer, which defines ``MeshCat``.
        assets: A script with what the commands refer to, such as images.
        commands: Commands that set up the scene, encoded in base64, in their order.
    """

    viewer: str
    assets: str
    commands: tuple[str, ...]


def parse_static_html(page: str) -> RecordedScene:
    """Return the parts of a page that `pydrake.geometry.Meshcat.StaticHtml` has made.

    Raises:
        RuntimeError: If the page is made differently, as another version of Drake might do.
    """
    viewer, assets = _SCRIPT.search(page), _ASSETS.search(page)
    commands = tuple(_COMMAND.findall(page))
    if viewer is None or assets is None or not commands:
        raise RuntimeError("playback: this version of Drake writes pages of Meshcat differently")
    return RecordedScene(viewer[1], assets[0], commands)


#: The folder of the page's files.
WEB = Path(__file__).parent / "web"
#: The scripts of any page with such a picture and chart, in the order in which they run; they share
#: one scope. Those of a playback come behind them.
SCRIPTS = (
    "numbers.js",
    "notice.js",
    "scene.js",
    "camera.js",
    "picture.js",
    "curves.js",
    "axes.js",
    "lines.js",
    "chart.js",
    "legend.js",
    "hover.js",
    "reach.js",
    "choosing.js",
    "keys.js",
    "effort.js",
    "looks.js",
)
_OF_PLAYBACK = (
    "player.js",
    "zoom.js",
    "loop.js",
    "joints.js",
    "parts.js",
    "trace.js",
    "menus.js",
    "saving.js",
    "link.js",
    "main.js",
)


def render(
    title: str,
    scene: RecordedScene,
    outcomes: Sequence[Mapping[str, Any]],
    data: Mapping[str, Any],
) -> str:
    """Return the page.

    Args:
        title: Title of the page.
        scene: The scene with its animation.
        outcomes: The outcome of the run and of those beside it, from `outcome_of`.
        data: The data that the page's scripts read.
    """
    page = page_templates(WEB).get_template("page.html.jinja")
    return page.render(
        title=title,
        scene=scene,
        outcome=outcomes[0],
        outcomes=outcomes,
        data=data,
        scripts=SCRIPTS + _OF_PLAYBACK,
        colours=colours,
    )


# Ratio of the extents of path and scene below which the path is shown enlarged in a corner.
_SMALL = 0.3
# Extent of a traced path, relative to that of the scene, from which on it can be seen.
_SMALLEST = 0.005
# Number of points of the scene that the enlarged path must not cover.
_CELLS = 1000


@dataclass(frozen=True, eq=False)
class Scene:
    """A motion's arm, surroundings and paths, drawn where the motion begins.

    Attributes:
        meshcat: Meshcat with the scene.
        motion: The motion.
        beside: Motions whose paths are drawn beside it.
        drawn: Its arm.
        items: What features draw.
        paths: The paths.
        size: Largest extent [m].
        capsules: Scene paths of the arms' capsules.
    """

    meshcat: Meshcat
    motion: ReplayedMotion
    beside: Sequence[ReplayedMotion]
    drawn: DrawnArm
    items: Sequence[SceneItem]
    paths: DrawnPaths
    size: float
    capsules: list[str]

    def as_data(self) -> dict[str, Any]:
        """Return what the page's picture is drawn with."""
        units = {"prefixes": PREFIXES, "prefixed": PREFIXED_UNITS, "least": LEAST}
        views = _views(self.motion, self.beside, self.paths, self.size)
        experiment = self.motion.result.experiment
        entries = [
            *(each for one in experiment.document.features for each in one.legend(experiment)),
            *(each for item in self.items for each in item.legend),
        ]
        views["legend"]["items"] = [each._asdict() for each in entries]
        return {
            "size": self.size,
            "units": units,
            "capsules": self.capsules,
            "grid": format_quantity(_cell(self.size), "m"),
            "second": colours.SECOND,
            "scale": colours.SCALE,
            **views,
        }


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
    experiment, begin = motion.result.experiment, float(motion.result.time[0])
    data = {
        "name": name_of(motion.result),
        "duration": duration,
        "rate": rate,
        "window": _window(motion),
        "marks": [{"time": time - begin, "name": name} for time, name, _ in experiment.moments],
        "curves": _curves(motion, frames),
        "beside": [
            {"name": name_of(each.result), "curves": _curves(each, frames)} for each in beside
        ],
        "joints": joints_of(motion, frames),
        **scene.as_data(),
        "image": None if beside else image_of(motion, frames),
        "held": _held(scene, frames),
    }
    outcomes = [outcome_of(result) for result in results]
    return render(title, parse_static_html(scene.meshcat.StaticHtml()), outcomes, data)


def _held(scene: Scene, frames: Array) -> list[tuple[float, str]]:
    """Return what holds an arm behind a shield back, in words, from each time on [s]."""
    wanted = [item for item in scene.items if isinstance(item, WantedArm)]
    return [row for item in wanted for row in item.as_data(frames)]


def _curves(motion: ReplayedMotion, frames: Array) -> list[dict[str, Any]]:
    """Return the curves of a motion, each with the bounds that it is expected to keep."""
    bounds = list(accepted_bounds(motion.result))
    return [
        {
            **curve.as_data(frames),
            # A bound of the curve itself is drawn without being accepted.
            "accepted": [
                each.as_data()
                for each in bounds
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
    arm = DrawnArm(experiment.arm, meshcat)
    if experiment.target is not None:
        arm.draw_target(experiment.target)
    boxes = boxes_of(motion, arm)
    items = _items(meshcat, motion, arm)
    paths = _drawn_paths(meshcat, motion, beside, boxes, items)
    points = np.concatenate((boxes.corners, paths.set_up()))
    floor, size = float(points[:, 2].min()), float(np.ptp(points, axis=0).max())
    set_stage(meshcat, floor, size)
    capsules = [place for item in items for place in item.draw()]
    paths.draw(floor)
    return Scene(meshcat, motion, beside, arm, items, paths, size, capsules)


def _corners(motion: ReplayedMotion, arm: Any) -> Array:
    return boxes_of(motion, arm).corners


def _items(meshcat: Meshcat, motion: ReplayedMotion, arm_drawing: DrawnArm) -> list[SceneItem]:
    """Return what features draw, in their order."""
    stage = Stage(
        meshcat,
        motion,
        arm_drawing,
        draw_arm=lambda arm, place: DrawnArm(arm, meshcat, place),
        replay=replayed_motion,
        corners=_corners,
    )
    document = motion.result.experiment.document
    items = [item for feature in document.features for item in feature.items(stage)]
    return [*items, WantedArm(stage, arm_drawing)] if WANTED in motion.result.series else items


def _views(
    motion: ReplayedMotion, beside: Sequence[ReplayedMotion], paths: DrawnPaths, size: float
) -> dict[str, Any]:
    """Return the views, legend and labels of the scene, as the page reads them."""
    views = paths.views()
    turns = motion.result.experiment.desired.turns
    extent = float(np.ptp(motion.course, axis=0).max())
    size_of_trace = float(np.ptp(motion.traced, axis=0).max())
    return {
        "views": {name: view.as_data() for name, view in views.items()},
        "view": "close" if beside else "arm",
        "inset": extent < _SMALL * size and not beside and not motion.rests,
        "extent": extent,
        "rests": motion.rests,
        "grows": paths.grows(),
        "scaled": paths.scalable_objects(),
        "labels": [label.as_data() for label in paths.labels],
        "occupied": pack(some(views["arm"].points, _CELLS)),
        "legend": {
            "desired": not motion.rests,
            "traced": not motion.rests or size_of_trace > _SMALLEST * size,
            "end": motion.ends,
            "axes": turns and not beside and paths.legend is None,
            "target": motion.result.experiment.target is not None,
            "force": paths.legend,
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
    items: Sequence[SceneItem],
) -> DrawnPaths:
    """Return the paths of several runs, or of one: on the surface it presses on, or in the air."""
    if beside:
        return PathsBeside(meshcat, motion, beside, boxes)
    contact = replayed_contact(motion)
    if contact is None:
        return PathsInAir(meshcat, motion, boxes, items)
    return PathsOnSurface(meshcat, motion, contact, boxes)


def _record(scene: Scene, time: Array, rate: int) -> None:
    """Record the animation, ``time`` of each frame [s], and publish it in the scene."""
    meshcat, motion = scene.meshcat, scene.motion
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for frame, q in enumerate(motion.at(time, motion.position)):
        # Drake rounds a time down to a frame: half a frame later, it finds the right one.
        scene.drawn.draw(q, (frame + 0.5) / rate)
    recording = meshcat.get_mutable_recording()
    scene.paths.record(recording, time)
    for item in scene.items:
        item.record(Frames(recording, time, rate))
    # The page has a clock of its own.
    recording.set_autoplay(False)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.StopRecording()
    meshcat.PublishRecording()
