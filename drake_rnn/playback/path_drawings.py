"""Base classes of drawings of paths: how the page sets them up, draws and records them.

- A desired and a traced path as tubes in the air, each with a ball that moves along it.
- Axes of the end effector on a path that turns: the desired axes along the path, and its own.
- Desired and traced path of a tool that touches nothing, as tubes in the air.
- The drawings of several runs side by side, the first under the arm that draws it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..features.feature import SceneItem
from ..inputs.fields import Array
from ..measures import format_quantity
from .replay import (
    ReplayedMotion,
    Trace,
    draw_smooth,
    merge,
    move,
    name_of,
    path_frame,
    round_points,
    simplify,
    stretches,
    tube,
)
from .viewpoint import Boxes, View, box_round, facing, points_round, view_of_drawing, view_of_paths

# Radius of the ball at the start of an open path and edge of the box at its end, relative to that
# of the traced path.
_START, _END = 4.0, 7.0
# How far a tube may be off the path, relative to the radius of the traced one.
_DEVIATION = 0.04
# Radii relative to that of the traced path: of the desired path, the traced point, the desired
# point, and a desired point at rest, which would hide the flange if it were larger.
_PATH, _TRACED_POINT, _DESIRED_POINT, _RESTING_POINT = 2.2, 2.0, 7.0, 5.5


@dataclass(frozen=True)
class Curves:
    """The desired and the traced path of one motion.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        radius: Radius of the traced path [m].
        place: Scene path that both are below.
        aside: Displacement of the drawing from the recorded motion, shape (3,) [m].
        desired_point: Radius of the desired point over the radius of the traced path; the default
            is visible from far away.
    """

    meshcat: Meshcat
    motion: ReplayedMotion
    radius: float
    place: str = ""
    aside: Array = field(default_factory=lambda: np.zeros(3))
    desired_point: float = _DESIRED_POINT

    @cached_property
    def _trace(self) -> Trace:
        return Trace(self.meshcat, f"{self.place}/traced/path")

    def draw(self) -> None:
        """Draw both paths, without the moves of a lifted pen, and a ball on each."""
        motion, radius = self.motion, self.radius
        self._draw_desired()
        for stroke in stretches(motion.pen_is_down(motion.desired)):
            trace, time = motion.traced[stroke], motion.time[stroke]
            indices = simplify(trace, _DEVIATION * radius, time)
            self._trace.add(tube(trace[indices] + self.aside, radius), time[indices])
        self._trace.draw()
        self._set_object("traced/point", Sphere(_TRACED_POINT * radius), colours.TRACED)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move and the traced path grows."""
        motion, aside = self.motion, self.aside
        for name, points in (("desired", motion.desired), ("traced", motion.traced)):
            move(recording, f"{self.place}/{name}/point", motion.at(time, points + aside))

    def grows(self) -> list[dict[str, Any]]:
        """Return how the traced path grows."""
        return self._trace.as_data()

    def scalable_objects(self) -> list[dict[str, Any]]:
        """Return the objects that the page draws thicker or thinner, to suit the view."""
        marks = ("start", "end") if self.motion.ends else ()
        solids = ("traced/point", "desired/point", *(f"desired/{name}" for name in marks))
        radii = {"traced/path": self.radius}
        if not self.motion.rests:
            radii["desired/path"] = _PATH * self.radius
        return [
            {
                "kind": "lines" if name in radii else "solids",
                "path": f"{self.place}/{name}",
                "radius": radii.get(name, 0.0),
                "unit": self.radius,
            }
            for name in (*radii, *solids)
        ]

    def _draw_desired(self) -> None:
        """Draw the desired path, unless it is a point, and the desired point."""
        motion, radius = self.motion, self.radius
        course = motion.course + self.aside
        if not motion.rests:
            strokes = [course[each] for each in stretches(motion.pen_is_down(motion.course))]
            indices = [each[simplify(each, _DEVIATION * radius)] for each in strokes]
            mesh = merge([tube(each, _PATH * radius) for each in indices])
            # Only the inside of the wider tube is drawn, where it faces the camera: a rim round the
            # traced path that never hides it.
            rim = Meshcat.SideOfFaceToRender.kBackSide
            place = f"{self.place}/desired/path"
            draw_smooth(self.meshcat, place, *mesh, colours.DESIRED, rim)
        if motion.ends:
            self._mark("start", Sphere(_START * radius), course[0])
            self._mark("end", Box(*3 * (_END * radius,)), course[-1])
        ball = Sphere((_RESTING_POINT if motion.rests else self.desired_point) * radius)
        self._set_object("desired/point", ball, colours.DESIRED, 0.5)

    def _mark(self, name: str, shape: Shape, point: Array) -> None:
        """Draw a shape at a point of the desired path, below its "/desired"."""
        self._set_object(f"desired/{name}", shape, colours.DESIRED)
        self.meshcat.SetTransform(f"{self.place}/desired/{name}", RigidTransform(point))

    def _set_object(self, name: str, shape: Shape, colour: str, opacity: float = 1.0) -> None:
        rgba = Rgba(*colours.components(colour), opacity)
        self.meshcat.SetObject(f"{self.place}/{name}", shape, rgba)


class Label(NamedTuple):
    """A name and a line below it, which the page keeps below a point as the view turns.

    Attributes:
        text: The name, and the line below it.
        point: The point, shape (3,) [m].
    """

    text: tuple[str, str]
    point: Array

    def as_data(self) -> dict[str, Any]:
        """Return the label as the page reads it."""
        name, text = self.text
        return {"name": name, "told": text, "point": round_points(self.point)}


class DrawnPaths(ABC):
    """A desired path and a traced one in the scene; the methods are called in this order.

    Attributes:
        legend: Scale of the force arrow; None without one.
        labels: Labels of what is drawn.
    """

    legend: str | None = None
    labels: Sequence[Label] = ()

    @abstractmethod
    def set_up(self) -> Array:
        """Draw the surface that the paths lie on, if there is one.

        Returns:
            Points that must be above the ground, shape (k, 3) [m].
        """

    @abstractmethod
    def draw(self, floor: float) -> None:
        """Draw the paths, and any stand below them, from the ground at height ``floor`` [m]."""

    @abstractmethod
    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how they move; ``time`` of each frame, shape (f,) [s]."""

    @abstractmethod
    def views(self) -> dict[str, View]:
        """Return the views "arm", "close" and "path"."""

    @abstractmethod
    def grows(self) -> list[dict[str, Any]]:
        """Return which meshes grow with time, and how."""

    def scalable_objects(self) -> list[dict[str, Any]]:
        """Return the objects that the page draws thicker or thinner, to suit the view."""
        return []


class DrawnCurves(DrawnPaths):
    """Paths in the air, each drawn as a tube.

    Args:
        curves: The desired and the traced path of each motion.
        points: The points of all of them where they are drawn, shape (k, 3) [m].
    """

    def __init__(self, curves: Sequence[Curves], points: Array) -> None:
        self._curves = curves
        self._points = points

    def set_up(self) -> Array:
        """Return the points of all paths, which lie on no surface."""
        return self._points

    def draw(self, floor: float) -> None:
        """Draw all paths, and a ball on each; paths in the air have no stand."""
        for curves in self._curves:
            curves.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move; ``time`` of each frame, shape (f,) [s]."""
        for curves in self._curves:
            curves.record(recording, time)

    def grows(self) -> list[dict[str, Any]]:
        """Return how the traced paths grow."""
        return [grows for curves in self._curves for grows in curves.grows()]

    def scalable_objects(self) -> list[dict[str, Any]]:
        """Return the radii of all tubes, balls and boxes."""
        return [each for curves in self._curves for each in curves.scalable_objects()]


# Largest number of poses along the path at which the desired axes are drawn.
_POSES = 12
# Largest and smallest length of an axis, relative to the radius of the traced path; its length
# relative to the extent of the path, and its radius relative to its length.
_LENGTH, _SHORTEST, _SHARE, _AXIS_RADIUS = 18.0, 8.0, 0.2, 0.03
# Red, green and blue for x, y and z, as in other viewers.
_COLOURS = ((0.85, 0.15, 0.15), (0.15, 0.6, 0.2), (0.2, 0.3, 0.85))
_DESIRED_OPACITY = 0.35


@dataclass(frozen=True)
class Axes:
    """Axes of a motion that turns.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        radius: Radius of the traced path [m].
    """

    meshcat: Meshcat
    motion: ReplayedMotion
    radius: float

    def draw(self) -> None:
        """Draw the desired axes at some poses along the path, and those of the end effector."""
        motion, path = self.motion, self.motion.result.experiment.desired
        last = len(motion.course) - 1
        for number, k in enumerate(np.unique(np.linspace(0, last, _POSES).astype(int)).tolist()):
            place = f"/desired/axes/{number:02d}"
            R_WE = self._R @ path.orientation(motion.path_time(motion.time[k]))[0]
            self._draw_at(place, _DESIRED_OPACITY)
            self.meshcat.SetTransform(place, _pose(R_WE, motion.course[k]))
        self._draw_at("/traced/axes", 1.0)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the axes of the end effector move; ``time`` of each frame, shape (f,) [s]."""
        motion = self.motion
        kinematics = motion.result.experiment.arm.kinematics()
        points = motion.at(time, motion.traced)
        for frame, q in enumerate(motion.at(time, motion.position)):
            pose = _pose(self._R @ kinematics.R_WE(q), points[frame])
            recording.SetTransform(frame, "/traced/axes", pose)

    @cached_property
    def _R(self) -> Array:
        """Orientation of the frame in which the path is stated."""
        frame = path_frame(self.motion.result.experiment)
        return np.eye(3) if frame is None else frame.rotation().matrix()

    def _draw_at(self, place: str, opacity: float) -> None:
        extent = float(np.ptp(self.motion.course, axis=0).max())
        length = min(_LENGTH * self.radius, max(_SHARE * extent, _SHORTEST * self.radius))
        radius = _AXIS_RADIUS * length
        for axis, colour in enumerate(_COLOURS):
            path = f"{place}/{'xyz'[axis]}"
            self.meshcat.SetObject(path, Cylinder(radius, length), Rgba(*colour, opacity))
            along = np.eye(3)[axis]
            R = RotationMatrix.MakeFromOneVector(along, 2)
            self.meshcat.SetTransform(path, RigidTransform(R, length / 2.0 * along))


def _pose(R_WE: Array, p_WE: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_WE), p_WE)


# Radius of the traced path, relative to the extent of the scene.
_RADIUS = 0.003
# Room round the paths in a view of them, relative to their extent; for the tool beside them, and
# round an end effector that rests, relative to the extent of the scene.
_EDGE, _BESIDE, _NEAR = 0.06, 0.03, 0.12


class PathsInAir(DrawnCurves):
    """Both paths in the air, and the end effector's axes if the path turns them.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        boxes: Boxes round the arm.
        items: What features draw: the paths of other motions among them are drawn as well.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        boxes: Boxes,
        items: Sequence[SceneItem] = (),
    ) -> None:
        motions = [motion, *(other for item in items for other in item.motions)]
        path = np.concatenate([part for each in motions for part in (each.course, each.traced)])
        around = [item.corners for item in items]
        self._scene = np.concatenate((boxes.corners, path, *around))
        self._size = float(np.ptp(self._scene, axis=0).max())
        places = ["", *("/beside_it" + "_" * number for number in range(len(motions) - 1))]
        curves = [
            Curves(meshcat, each, _RADIUS * self._size, place)
            for each, place in zip(motions, places, strict=True)
        ]
        super().__init__(curves, path)
        self._motion = motion
        self._boxes = boxes
        self._axes = Axes(meshcat, motion, _RADIUS * self._size) if motion.turns else None

    def draw(self, floor: float) -> None:
        """Draw both paths, a ball on each, and axes; paths in the air have no stand."""
        super().draw(floor)
        if self._axes is not None:
            self._axes.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how balls and axes move; ``time`` of each frame, shape (f,) [s]."""
        super().record(recording, time)
        if self._axes is not None:
            self._axes.record(recording, time)

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the paths with the tool, of the paths alone."""
        motion, path = self._motion, self._points
        direction = view_of_paths(motion, self._boxes)
        middle = (path.min(axis=0) + path.max(axis=0)) / 2.0
        arm = View(self._scene, path.mean(axis=0), direction)
        if motion.rests:
            # Without a path to look at, the close view shows the end effector.
            near = View(box_round(path, _NEAR * self._size), middle, direction)
            return {"arm": arm, "close": near, "path": near}
        edge = _EDGE * float(np.ptp(path, axis=0).max())
        near = View(box_round(path, edge + _BESIDE * self._size), middle, direction)
        course = motion.course
        # Moves with a lifted pen leave the plane that a drawing is seen in.
        face = facing(course[motion.pen_is_down(course)], direction)
        return {"arm": arm, "close": near, "path": View(box_round(path, edge), middle, face)}


# Radius of a traced path, the distance from one drawing to the next, and the room for a label below
# a drawing, relative to the extent of a drawing.
_TUBE_RADIUS_BESIDE, _GAP, _LABEL = 0.006, 0.3, 0.3
# Radius of the desired point over the radius of the traced path; small, as the view is close.
_DESIRED_POINT_BESIDE = 4.0
# Smallest extent of a drawing that counts [m].
_LEAST_EXTENT = 0.03


class PathsBeside(DrawnCurves):
    """Desired and traced paths of several runs in one view.

    Each drawing after the first is moved aside, along the width of the view, to where the arm hides
    it least. All have the same scale.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion whose arm is drawn.
        others: The motions to draw beside it.
        boxes: Boxes round the arm.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        others: Sequence[ReplayedMotion],
        boxes: Boxes,
    ) -> None:
        self._boxes = boxes
        self._motion = motion
        motions = (motion, *others)
        course = motion.course
        middle = (course.min(axis=0) + course.max(axis=0)) / 2.0
        # A path that is a point lies in no plane.
        normal = np.eye(3)[2] if motion.rests else np.linalg.svd(course - middle)[2][-1]
        self._normal = normal if normal[2] >= 0.0 else -normal
        self._direction = view_of_drawing(course, self._normal, boxes)
        self._right = np.cross([0.0, 0.0, 1.0], self._direction)
        self._right /= np.linalg.norm(self._right)
        self._up = np.cross(self._direction, self._right)
        asides = self._moved_aside(motions)
        self._extent = max(float(np.linalg.norm(np.ptp(course, axis=0))), _LEAST_EXTENT)
        drawings = [_points(each) + aside for each, aside in zip(motions, asides, strict=True)]
        # The name of each run and its largest error, below its drawing.
        self.labels = [
            Label(_title(each), self._foot(drawing))
            for each, drawing in zip(motions, drawings, strict=True)
        ]
        places = ["", *(f"/beside/{k}" for k in range(1, len(motions)))]
        curves = [
            Curves(
                meshcat,
                each,
                _TUBE_RADIUS_BESIDE * self._extent,
                place,
                aside,
                _DESIRED_POINT_BESIDE,
            )
            for each, place, aside in zip(motions, places, asides, strict=True)
        ]
        super().__init__(curves, np.concatenate(drawings))

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the drawings with the tool, of the drawings alone."""
        tool = points_round(_points(self._motion), self._normal)
        below = [point - _LABEL * self._extent * self._up for _, point in self.labels]
        drawings = np.concatenate((self._points, below))
        middle = (drawings.min(axis=0) + drawings.max(axis=0)) / 2.0
        arm = np.concatenate((self._boxes.corners, drawings))
        face = facing(self._motion.course, self._direction)
        return {
            "arm": View(arm, middle, self._direction),
            "close": View(np.concatenate((tool, drawings)), middle, self._direction),
            "path": View(drawings, middle, face),
        }

    def _moved_aside(self, motions: Sequence[ReplayedMotion]) -> list[Array]:
        """Return how far each drawing is moved, shape (3,) [m], towards where less is hidden."""
        right = self._right
        widths = [_points(motion) @ right for motion in motions]

        def row(sign: float) -> list[Array]:
            """Return the displacements of a row that begins at the first drawing."""
            asides, edge = [np.zeros(3)], float((sign * widths[0]).max())
            gap = _GAP * max(float(np.ptp(width)) for width in widths)
            for width in widths[1:]:
                along = sign * width
                asides.append(sign * (edge + gap - along.min()) * right)
                edge += gap + float(np.ptp(along))
            return asides

        def hidden(asides: list[Array]) -> float:
            rest = zip(motions[1:], asides[1:], strict=True)
            return sum(
                self._boxes.hidden_share(motion.course + aside, self._direction)
                for motion, aside in rest
            )

        return min((row(1.0), row(-1.0)), key=hidden)

    def _foot(self, points: Array) -> Array:
        """Return the middle of the lower edge of a drawing as the camera sees it, (3,) [m]."""
        across, height = points @ self._right, points @ self._up
        lowest = int(np.argmin(height))
        middle = (across.min() + across.max()) / 2.0
        return np.asarray(points[lowest] + (middle - across[lowest]) * self._right)


def _points(motion: ReplayedMotion) -> Array:
    """Return the points of both paths of a motion, shape (k, 3) [m]."""
    return np.concatenate((motion.course, motion.traced))


def _title(motion: ReplayedMotion) -> tuple[str, str]:
    """Return the name of a run and, if it is known, how far it is off its path."""
    name = name_of(motion.result)
    error = motion.result.metrics.get("position_error_max_m")
    off = "" if error is None else f"{format_quantity(error, 'm', 3)} off at most"
    return name, ", ".join(filter(None, (off, motion.result.ending)))
