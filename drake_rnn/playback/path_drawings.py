"""Drawings of paths: how the page sets them up, draws and records them.

- A desired and a traced path as tubes in the air, each with a ball that moves along it.
- Axes of the end effector on a path that turns: the desired axes along the path, and its own.
- Desired and traced path of a tool that touches nothing, as tubes in the air.
- The drawings of several runs side by side, the first under the arm that draws it.
- Desired and traced path of a tool that presses against a surface, as lines of a pen on it.
- The force on the tool, as an arrow from the point of contact.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..features.feature import SceneItem
from ..inputs.fields import Array
from ..measures import format_quantity
from .replay import (
    ReplayedContact,
    ReplayedMotion,
    Trace,
    draw_smooth,
    draw_stand,
    draw_surface,
    merge,
    move,
    name_of,
    path_frame,
    ribbon,
    round_points,
    simplify,
    stretches,
    thin,
    tube,
)
from .viewpoint import (
    Boxes,
    View,
    box_round,
    facing,
    points_round,
    view_of_arm_and_surface,
    view_of_drawing,
    view_of_paths,
)

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
# Smallest extent of a drawing that counts [m]: lines on a smaller one would be too thin to see.
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


#: Length of the arrow for the force that the legend names [m].
LENGTH = 0.1
# Largest length of the arrow for forces that last; brief peaks may exceed it [m].
_LONGEST = 0.3
# Radii of shaft and head, and length of the head [m].
_SHAFT, _HEAD, _HEAD_LENGTH = 0.0028, 0.0075, 0.026
_SIDES = 24
# The arrow lies mostly inside the tool: it is drawn last, over whatever is in front of it.
_IN_FRONT = {
    "castShadow": False,
    "material.depthTest": False,
    "material.transparent": True,
    "renderOrder": 2.0,
}
# Share of the desired force below which an arrow would be too short to be seen.
_NONE = 1e-3
# Norm of the sum of two unit vectors below which they count as opposite.
_OPPOSITE = 1e-6


def reference_force(contact: ReplayedContact) -> float:
    """Return the force for which the arrow has the length `LENGTH` [N].

    It is the desired force, or a round larger one if the tool presses so much harder for long that
    arrows would leave the picture.
    """
    size = np.linalg.norm(contact.force, axis=1)
    largest_force = float(np.percentile(size, 95.0))
    return max(contact.desired_force, _round_up(largest_force * LENGTH / _LONGEST))


def arrow_legend(contact: ReplayedContact) -> str:
    """Return the scale of the arrow as text."""
    return f"force, {reference_force(contact):g} N = {100.0 * LENGTH:g} cm"


def draw_arrow(meshcat: Meshcat) -> None:
    """Draw an arrow of length `LENGTH` along z at "/force"."""
    vertices, faces = _arrow()
    meshcat.SetTriangleMesh("/force", vertices, faces, Rgba(*colours.components(colours.FORCE)))
    for name, value in _IN_FRONT.items():
        meshcat.SetProperty("/force/<object>", name, value)


def record_arrow(
    recording: MeshcatAnimation, contact: ReplayedContact, points: Array, forces: Array
) -> None:
    """Record position, direction and length of the arrow frame by frame.

    Args:
        recording: The animation.
        contact: The contact, which sets the scale.
        points: Point of contact in each frame, shape (f, 3) [m].
        forces: Force on the tool in each frame, shape (f, 3) [N].
    """
    for frame, (point, force) in enumerate(zip(points, forces, strict=True)):
        R, scale, visible = arrow_of(contact, force)
        recording.SetTransform(frame, "/force", RigidTransform(R, point))
        recording.SetProperty(frame, "/force", "scale", scale)
        recording.SetProperty(frame, "/force", "visible", visible)


def arrow_of(contact: ReplayedContact, force: Array) -> tuple[RotationMatrix, list[float], bool]:
    """Return the orientation, the scale, and whether there is an arrow for a force.

    Args:
        contact: The contact, which sets the scale.
        force: Force on the tool, shape (3,) [N].
    """
    size = float(np.linalg.norm(force))
    visible = size > _NONE * contact.desired_force
    direction = force / size if visible else contact.normal
    length = max(size / reference_force(contact), _NONE)
    # A short arrow is slim as well.
    width = min(length, 1.0)
    return _along(direction, contact), [width, width, length], visible


def _along(direction: Array, contact: ReplayedContact) -> RotationMatrix:
    """Return the surface's axes after the shortest rotation that turns z into ``direction``.

    It varies continuously with the direction, except into the surface: any half turn leads there,
    and as the arrow is round, each looks the same.
    """
    n = contact.normal
    middle = n + direction
    size = float(np.linalg.norm(middle))
    axis = middle / size if size > _OPPOSITE else contact.R_WS.matrix()[:, 0]
    # Half a turn about the normal, then half a turn about the middle, is the shortest rotation.
    about_normal = contact.R_WS.matrix() @ np.diag([-1.0, -1.0, 1.0])
    return RotationMatrix((2.0 * np.outer(axis, axis) - np.eye(3)) @ about_normal)


def _round_up(number: float) -> float:
    """Return the next 1, 2, 3 or 5 times a power of ten that is not smaller; 0 for none."""
    if number <= 0.0:
        return 0.0
    unit = 10.0 ** math.floor(math.log10(number))
    return float(next(step for step in (1.0, 2.0, 3.0, 5.0, 10.0) if step * unit >= number) * unit)


def _arrow() -> tuple[Any, Any]:
    """Return vertices and faces of an arrow along z.

    Its parts do not share their rings of vertices, so that the edges between them look sharp.
    """
    neck = LENGTH - _HEAD_LENGTH
    corners = ((0.0, 0.0), (_SHAFT, 0.0), (_SHAFT, neck), (_HEAD, neck), (0.0, LENGTH))
    profile = [corner for pair in pairwise(corners) for corner in pair]
    angles = np.linspace(0.0, math.tau, _SIDES, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)))
    rings = [np.vstack((radius * circle, np.full(_SIDES, height))) for radius, height in profile]
    here = np.arange(_SIDES)
    there = (here + 1) % _SIDES
    faces = []
    for k in range(0, len(profile), 2):
        low, high = k * _SIDES, (k + 1) * _SIDES
        faces.append(np.stack((here + low, there + low, there + high)))
        faces.append(np.stack((here + low, there + high, here + high)))
    return (
        np.asfortranarray(np.concatenate(rings, axis=1)),
        np.asfortranarray(np.concatenate(faces, axis=1).astype(np.int32)),
    )


# Widths of the traced and of the desired line relative to the extent of the drawing.
_TRACED, _DESIRED = 0.022, 0.05
# Diameter of the dot at the start of an open path, and edge of the square at its end, relative to
# the extent of the drawing.
_DOT, _SQUARE = 0.12, 0.16
# Room round a drawing that is seen alone, relative to its extent.
_ROUND = 0.08
# Distance of a surface's corners from the drawing up to which a near view shows them [m].
_PLATE = 0.4
# Radius and width of the ring round the desired point [m]; it is wider than the tool's ball.
_RING, _RING_WIDTH = 0.014, 0.0024


class PathsOnSurface(DrawnPaths):
    """Both paths on a surface, and the force on the tool.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        contact: Its contact.
        boxes: Boxes round the arm.
    """

    def __init__(
        self, meshcat: Meshcat, motion: ReplayedMotion, contact: ReplayedContact, boxes: Boxes
    ) -> None:
        self._meshcat = meshcat
        self._motion = motion
        self._contact = contact
        self._boxes = boxes
        self._trace = Trace(meshcat)
        self._corners = np.zeros((0, 3))
        self.legend = arrow_legend(contact)

    def set_up(self) -> Array:
        """Draw the surface and return corners of boxes round it."""
        contact = self._contact
        drawing = np.concatenate((contact.course, contact.trace))
        self._corners = draw_surface(self._meshcat, contact.surface, contact.p_WS, drawing)
        return self._corners

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the drawing with the tool, of the drawing alone."""
        contact, boxes = self._contact, self._boxes
        course = contact.course
        middle = (course.min(axis=0) + course.max(axis=0)) / 2.0
        tool = points_round(course, contact.normal)
        arm = np.concatenate((boxes.corners, self._corners, tool))
        near = view_of_drawing(course, contact.normal, boxes)
        # A plate that is not much larger shows by its edges how it lies.
        away = np.linalg.norm(self._corners - middle, axis=1)
        edges = self._corners if away.max(initial=0.0) < _PLATE else course
        drawing = box_round(np.concatenate((course, contact.trace)), _ROUND * self._extent + _RING)
        return {
            "arm": View(arm, middle, view_of_arm_and_surface(contact, boxes)),
            "close": View(np.concatenate((tool, drawing, edges)), middle, near),
            "path": View(drawing, middle, facing(course, near)),
        }

    def draw(self, floor: float) -> None:
        """Draw both paths, a ring round the desired point, the force, and the stand of a plate."""
        contact = self._contact
        draw_stand(self._meshcat, contact.surface, contact.p_WS, floor)
        extent = self._extent
        step = _TRACED * extent / 4.0
        if not self._motion.rests:
            self._draw_desired("path", thin(contact.course, step)[0], _DESIRED * extent)
        self._draw_desired("point", self._ring(), _RING_WIDTH)
        if self._motion.ends:
            self._draw_desired("start", contact.course[[0, 0]], _DOT * extent)
            self._draw_desired("end", self._square(_SQUARE * extent), _DESIRED * extent)
        for stroke in contact.strokes():
            points, indices = thin(contact.trace[stroke], step)
            if len(indices) == 1:
                # A stroke of a single sample is a dot.
                points, indices = points[[0, 0]], [0, 0]
            line = ribbon(points, contact.normal, _TRACED * extent)
            self._trace.add(line, self._motion.time[stroke][indices])
        self._trace.draw()
        for layer in ("/desired", "/traced"):
            self._meshcat.SetProperty(layer, "castShadow", False)
        draw_arrow(self._meshcat)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the ring and the arrow move and the traced path grows."""
        motion, contact = self._motion, self._contact
        move(recording, "/desired/point", motion.at(time, contact.desired))
        points, forces = motion.at(time, contact.contact), motion.at(time, contact.force)
        if contact.shift is not None:
            shift = motion.at(time, contact.shift)
            for layer in ("/surface", "/stand", "/desired", "/traced"):
                move(recording, layer, shift)
            points = points + shift
        record_arrow(recording, contact, points, forces)

    def grows(self) -> list[dict[str, Any]]:
        """Return how the drawing grows."""
        return self._trace.as_data()

    @property
    def _extent(self) -> float:
        """Extent of the drawing [m]."""
        return max(float(np.linalg.norm(np.ptp(self._contact.course, axis=0))), _LEAST_EXTENT)

    def _draw_desired(self, name: str, points: Array, width: float) -> None:
        """Draw a line of the desired path, ``width`` [m] wide, at "/desired/name"."""
        vertices, faces, _ = ribbon(points, self._contact.normal, width)
        draw_smooth(self._meshcat, f"/desired/{name}", vertices, faces, colours.DESIRED)

    def _ring(self) -> Array:
        """Return points of a ring round the origin, parallel to the surface, shape (k, 3) [m]."""
        angles = np.linspace(0.0, math.tau, 121)
        circle = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
        return np.asarray(_RING * (self._contact.R_WS.matrix() @ circle).T)

    def _square(self, edge: float) -> Array:
        """Return the corners of a square round the end of the path, shape (5, 3) [m]."""
        corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 0)])
        around = edge / 2.0 * corners @ self._contact.R_WS.matrix().T
        return np.asarray(self._contact.course[-1] + around)
