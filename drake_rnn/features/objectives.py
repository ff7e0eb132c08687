"""What is told of a task that is a list of objectives: metrics, series, and what a playback draws.

The objectives themselves are in `drake_rnn.robot.task_objectives`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.geometry import Box, Cylinder, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..inputs.fields import Array
from ..measures import Motion, Steps
from ..measures.metric import Metric, RootMean, Smallest, square
from ..robot.rotation import frame_about
from ..robot.task_frame import ToolFrame, pose_of
from ..robot.task_objectives import Drawing
from ..signals import TASK_MEASURES, TaskMeasure
from .feature import EvaluationSteps, Feature, Frames, LegendEntry, SceneItem, Stage

# What the metrics of a task are, by their names.
_MEANINGS = {
    "axis_error_max_rad": (
        "largest angle between an axis of the tool that a task is about and where it should point"
    ),
    "axis_error_rms_rad": "root mean square of that angle, of the axis that is farthest off",
    "frame_position_error_max_m": (
        "largest distance of another frame of two tools, such as one tool as seen from the "
        "other, from where it is held"
    ),
    "frame_position_error_rms_m": (
        "root mean square of that distance, of the frame that is farthest off"
    ),
    "frame_orientation_error_max_rad": (
        "largest angle by which another frame of two tools is turned from how it is held"
    ),
    "frame_orientation_error_rms_rad": (
        "root mean square of that angle, of the frame that is turned most"
    ),
    "remote_centre_error_max_m": (
        "largest distance of the tool's shaft from the point through which a task has it pass"
    ),
    "remote_centre_error_rms_m": "root mean square of that distance",
    "insertion_depth_min_m": "least distance of the tool beyond that point, along the shaft",
    "insertion_depth_max_m": "largest distance of the tool beyond that point",
    "range_margin_min_m": (
        "smallest distance of the tool from the bounds that a task sets to its position; "
        "negative beyond them"
    ),
    "range_margin_min_rad": (
        "smallest angle of an axis of the tool from the cone in which a task has it; negative"
        " outside"
    ),
}


def _metrics_of(measure: TaskMeasure) -> Iterator[Metric]:
    """Return the metrics of what a task of objectives is measured by."""

    def value(motion: Motion, against: Any) -> Any:
        return motion.task.get(measure.name)

    def squared(motion: Motion, against: Any) -> Any:
        return square(value(motion, against))

    taken: dict[str, dict[str, Any]] = {
        "largest": {"of": value},
        "least": {"of": value, "by": Smallest()},
        "root mean square": {"of": squared, "by": RootMean},
    }
    first, *_ = measure.metrics
    for name, what in measure.metrics.items():
        if name == first and measure.kind != "length":
            taken[what]["shown"] = ("path", "sweep")
        yield Metric(name, _MEANINGS[name], over="window", **taken[what])


_METRICS = tuple(metric for measure in TASK_MEASURES for metric in _metrics_of(measure))

# Length and radius of a drawn axis, length of a cone, half the side of a plane, radius of a point;
# then how much cones and planes hide [m, 1].
_LENGTH, _RADIUS, _CONE, _SIDE, _BALL = 0.16, 0.004, 0.14, 0.15, 0.012
_OPACITY, _PLANE_OPACITY = 0.25, 0.12
# Radius of the bar that two tools hold [m].
_BAR = 0.006
# A port: radius of its hole if it has none, its width and thickness; then the radius of a shaft,
# and how far it is drawn behind the port [m].
_HOLE, _RIM, _PORT, _SHAFT, _BEHIND = 0.006, 0.014, 0.003, 0.003, 0.06


class DrawnObjective(SceneItem):
    """An axis of the tool, where it should point, and the bounds of a range.

    Args:
        stage: Where they are drawn.
        number: Place of the objective in its list.
        drawing: What is drawn.
        frame: Frame of two tools that it is about; None for E.
    """

    def __init__(
        self, stage: Stage, number: int, drawing: Drawing, frame: ToolFrame | None = None
    ) -> None:
        self._stage, self._what, self._place = stage, drawing, f"/objectives/{number}"
        self._frame = frame

    @property
    def corners(self) -> Array:
        point = self._what.point
        return np.zeros((0, 3)) if point is None else point[None, :]

    def draw(self) -> list[str]:
        meshcat, what = self._stage.meshcat, self._what
        ink = Rgba(*colours.components(colours.DESIRED), 1.0)
        sheer = Rgba(*colours.components(colours.BOUND), _OPACITY)
        if what.axis is not None:
            length = self._length
            radius = _RADIUS if what.port is None else _SHAFT
            meshcat.SetObject(f"{self._place}/axis/rod", Cylinder(radius, length), ink)
            # A cylinder's origin is its middle.
            lift = RigidTransform([0.0, 0.0, 0.5 * length])
            meshcat.SetTransform(f"{self._place}/axis/rod", lift)
        if what.angle:
            radius = _CONE * float(np.tan(what.angle))
            meshcat.SetObject(f"{self._place}/aim/cone", MeshcatCone(_CONE, radius, radius), sheer)
        elif what.aim is not None:
            meshcat.SetObject(
                f"{self._place}/aim/rod", Cylinder(0.5 * _RADIUS, 1.3 * _LENGTH), sheer
            )
            meshcat.SetTransform(
                f"{self._place}/aim/rod", RigidTransform([0.0, 0.0, 0.65 * _LENGTH])
            )
        if what.port is not None:
            width = 2.0 * (what.port.radius or _HOLE) + 2.0 * _RIM
            meshcat.SetObject(f"{self._place}/point", Cylinder(0.5 * width, _PORT), sheer)
            meshcat.SetObject(
                f"{self._place}/point/hole", Cylinder(what.port.radius or _HOLE, 1.5 * _PORT), ink
            )
            meshcat.SetTransform(f"{self._place}/point", self._port(0.0))
        elif what.point is not None:
            meshcat.SetObject(f"{self._place}/point", Sphere(_BALL), ink)
            meshcat.SetTransform(f"{self._place}/point", RigidTransform(what.point))
        if what.plane is not None:
            faint = Rgba(*colours.components(colours.BOUND), _PLANE_OPACITY)
            self._draw_planes(what.plane, faint)
        return []

    def _port(self, time: float) -> RigidTransform:
        """Return where the port is at a time [s]."""
        port, point = self._what.port, self._what.point
        assert port is not None
        assert point is not None
        return _along(point + port.way(np.array([time]))[0], port.normal)

    def _draw_planes(self, plane: tuple[int, float | None, float | None], colour: Rgba) -> None:
        axis, *bounds = plane
        middle = np.array(self._stage.experiment.p_WE_start)
        size = [2.0 * _SIDE] * 3
        size[axis] = 1e-3
        for number, bound in enumerate(bounds):
            if bound is None:
                continue
            middle[axis] = bound
            place = f"{self._place}/plane{number}"
            self._stage.meshcat.SetObject(place, Box(*size), colour)
            self._stage.meshcat.SetTransform(place, RigidTransform(middle))

    @property
    def _length(self) -> float:
        """Length of the drawn axis, which goes to a point [m]."""
        if self._what.point is None:
            return _LENGTH
        away = float(np.linalg.norm(self._what.point - self._stage.experiment.p_WE_start))
        return away if self._what.port is None else away + _BEHIND

    def record(self, frames: Frames) -> None:
        """Record how the axis and its aim go along with the tool."""
        what, motion = self._what, self._stage.motion
        if what.axis is None:
            return
        if what.port is not None:
            for frame, time in enumerate(frames.time):
                place = f"{self._place}/point"
                frames.recording.SetTransform(frame, place, self._port(float(time)))
        kinematics = self._stage.experiment.arm.kinematics()
        for frame, q in enumerate(motion.at(frames.time, motion.position)):
            pose = pose_of(kinematics, q, self._frame)
            p, axis = pose.p_WE, pose.R @ what.axis
            frames.recording.SetTransform(frame, f"{self._place}/axis", _along(p, axis))
            aim = what.aim
            if what.point is not None:
                aim = (what.point - p) / np.linalg.norm(what.point - p)
            if aim is not None:
                frames.recording.SetTransform(frame, f"{self._place}/aim", _along(p, aim))


class DrawnBar(SceneItem):
    """A bar that two tools hold: it moves with the first one, and ends where the second one starts.

    Args:
        stage: Where it is drawn.
        way: From the first tool to the second one, as the first one sees it, shape (3,) [m].
    """

    def __init__(self, stage: Stage, way: Array) -> None:
        self._stage, self._way = stage, way

    def draw(self) -> list[str]:
        length = float(np.linalg.norm(self._way))
        ink = Rgba(*colours.components(colours.SECOND), 1.0)
        self._stage.meshcat.SetObject("/held", Cylinder(_BAR, length), ink)
        return []

    def record(self, frames: Frames) -> None:
        """Record how it goes along with the first tool."""
        motion, kinematics = self._stage.motion, self._stage.experiment.arm.kinematics()
        for frame, q in enumerate(motion.at(frames.time, motion.position)):
            pose = pose_of(kinematics, q, "first")
            way = pose.R @ self._way
            along = way / np.linalg.norm(way)
            frames.recording.SetTransform(frame, "/held", _along(pose.p_WE + 0.5 * way, along))


def _along(p: Array, axis: Array) -> RigidTransform:
    """Return a frame at a point whose z axis is given."""
    return RigidTransform(RotationMatrix(frame_about(axis)), p)


class ObjectivesFeature(Feature):
    """A list of objectives in the section ``task``."""

    key = "task"
    metrics = _METRICS

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        task, path = experiment.law_task, experiment.desired
        if not task.objectives or not run.position.size:
            return {}
        kinematics = experiment.arm.kinematics()
        p = np.array([kinematics.p_WE(q) for q in run.position])
        R = np.array([kinematics.R_WE(q) for q in run.position])
        R_desired = R
        if task.sees_turning:
            times = (run.steps.time - (0.0 if run.virtual else experiment.path_delay)).tolist()
            R_desired = np.array([path.orientation(t)[0] for t in times])
        frames = {}
        for name in task.frames:
            poses = [pose_of(kinematics, q, name) for q in run.position]
            frames[name] = np.array([each.p_WE for each in poses]), np.array([x.R for x in poses])
        return {"task": task.errors(p, R, R_desired, run.steps.time, frames)}

    def series(self, motion: Motion, steps: Steps) -> Mapping[str, Array]:
        return motion.task

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        task = stage.experiment.law_task
        for number, each in enumerate(task.objectives):
            if each.joins_tools:
                yield DrawnBar(stage, task.place("relative").p)
            drawing = each.drawing(task.place(each.of).R)
            if drawing is not None and each.of != "relative":
                yield DrawnObjective(stage, number, drawing, each.of)

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        task = experiment.law_task
        entries = []
        for each in task.objectives:
            drawing = each.drawing(task.place(each.of).R)
            if each.joins_tools:
                entries.append(LegendEntry("second", "held bar", "■", colours.SECOND))
            if drawing is not None and each.of != "relative":
                is_bound = bool(drawing.angle) or drawing.plane is not None
                look, colour = (
                    ("held", colours.BOUND) if is_bound else ("line desired", colours.DESIRED)
                )
                entries.append(LegendEntry(look, each.text, colour=colour))
        return entries
