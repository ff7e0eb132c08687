"""Viewpoints: camera positions, directions, and what hides a path from a camera.

- Camera positions: close to the scene, and where the arm hides as little of a path as possible.
- Boxes round the parts of the arm, which tell what the arm hides from a camera.
- Camera directions, and the points that must be in the frame whatever the window's shape.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from ..inputs.fields import Array
from .arm_drawing import DrawnArm
from .replay import ReplayedContact, ReplayedMotion, round_points

# Number of postures of a run that get boxes.
_POSTURES = 24


@dataclass(frozen=True)
class Boxes:
    """Boxes round the parts of the arm in several postures; b boxes in all.

    Attributes:
        centre: Centres, shape (b, 3) [m].
        axes: Directions of the edges as columns, shape (b, 3, 3).
        half: Half the extents, shape (b, 3) [m].
        postures: Number of postures, each with the same number of boxes.
    """

    centre: Array
    axes: Array
    half: Array
    postures: int

    @property
    def corners(self) -> Array:
        """Corners of all boxes, shape (8 b, 3) [m]."""
        signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)
        offsets = np.einsum("bij,kj,bj->bki", self.axes, signs, self.half)
        return np.asarray(self.centre[:, None] + offsets).reshape(-1, 3)

    def posture(self, number: int) -> Boxes:
        """Return the boxes of one posture; -1 is the last."""
        number %= self.postures
        count = len(self.centre) // self.postures
        one = slice(number * count, (number + 1) * count)
        return Boxes(self.centre[one], self.axes[one], self.half[one], 1)

    def hidden_share(self, points: Array, direction: Array) -> float:
        """Return the share of points that boxes hide, averaged over the postures.

        Args:
            points: Shape (k, 3) [m].
            direction: Unit vector towards the camera, shape (3,).
        """
        enters = np.zeros((len(self.centre), len(points)))
        leaves = np.full_like(enters, np.inf)
        for axis, half in zip(np.moveaxis(self.axes, 2, 0), self.half.T, strict=True):
            # The offset avoids a division by zero for a ray parallel to a face.
            ray = (axis @ direction + 1e-9)[:, None]
            start = axis @ points.T - (axis * self.centre).sum(axis=1)[:, None]
            middle, reach = -start / ray, half[:, None] / np.abs(ray)
            np.maximum(enters, middle - reach, out=enters)
            np.minimum(leaves, middle + reach, out=leaves)
        hit = (leaves >= enters).reshape(self.postures, -1, len(points))
        return float(hit.any(axis=1).mean())


def boxes_of(motion: ReplayedMotion, arm: DrawnArm) -> Boxes:
    """Return boxes at postures throughout a run and, last, at its target posture if it has one."""
    # A box without extent per body: an arm may have no geometry at all.
    parts: list[tuple[Any, ...]] = [(body, RigidTransform(), np.zeros(3)) for body in arm.bodies]
    for body, geometry in arm.geometries():
        if (box := arm.inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_BG = arm.inspector.GetPoseInFrame(geometry) @ box.pose()
            parts.append((body, X_BG, box.half_width()))
    postures = list(motion.position[np.linspace(0, len(motion.time) - 1, _POSTURES).astype(int)])
    if (target := motion.result.experiment.target) is not None:
        postures.append(target)
    centre, axes = [], []
    for q in postures:
        arm.set_posture(q)
        for body, X_BG, _ in parts:
            X_WG = arm.X_WB(body) @ X_BG
            centre.append(X_WG.translation())
            axes.append(X_WG.rotation().matrix())
    half = np.tile([half for *_, half in parts], (len(postures), 1))
    return Boxes(np.array(centre), np.array(axes), half, len(postures))


# Number of points of a path whose visibility is checked.
_CHECKS = 50
# Sine of the preferred angle between the line of sight and a surface, and the horizontal plane.
_STEEPNESS = 0.6
# Room in the view beside and above a drawing: for the tool with the force arrow [m].
_ROOM_BESIDE, _ROOM_ABOVE = 0.06, 0.2
# Sine of the angle from which on a surface counts as inclined.
_LEVEL = 0.02


def view_of_paths(motion: ReplayedMotion, boxes: Boxes) -> Array:
    """Return the direction from which to look at paths in the air.

    It is ahead and aside of the arm, which shows the arm and a path in any vertical plane, unless
    the arm hides the path from there; higher up for a horizontal path, and above for a planar arm.
    With a target posture, it is where the difference from the start is seen best.

    Returns:
        A unit vector from the scene to the camera, shape (3,).
    """
    experiment = motion.result.experiment
    if experiment.document.task == "xy":
        return _direction(-math.pi / 2.0, math.radians(76.0))
    course = some(motion.course)
    centre = course.mean(axis=0)
    ahead = _azimuth(centre)
    if experiment.target is not None:
        return _view_of_change(boxes, course[:1], ahead)
    # A single point lies in no plane; moves of a lifted pen leave that of a drawing.
    pen_course = course[motion.pen_is_down(course)]
    plane = pen_course if len(pen_course) > 2 else course
    normal = np.zeros(3) if motion.rests else np.linalg.svd(plane - plane.mean(axis=0))[2][-1]
    elevation = math.radians(16.0 + 26.0 * abs(normal[2]))

    def cost(aside: float) -> float:
        direction = _direction(ahead + math.radians(aside), elevation)
        face_on = min(abs(float(normal @ direction)), 0.7)
        return boxes.hidden_share(course, direction) - face_on + 0.003 * abs(abs(aside) - 48.0)

    asides = (48.0, -48.0, 70.0, -70.0, 110.0, -110.0, 135.0, -135.0)
    return _direction(ahead + math.radians(min(asides, key=cost)), elevation)


def view_of_arm_and_surface(contact: ReplayedContact, boxes: Boxes) -> Array:
    """Return the direction from which to look at an arm that presses on a surface.

    The camera stands low enough for the ground to be seen beside the surface, and where an inclined
    surface is seen from its side.

    Returns:
        A unit vector from the scene to the camera, shape (3,).
    """
    drawing = some(contact.course)

    def cost(direction: Array) -> float:
        share = boxes.hidden_share(drawing, direction)
        return share + _slope_in_sight(direction, contact.normal) + abs(direction[2] - 0.4)

    asides = (55, -55, 70, -70, 90, -90, 40, -40, 110, -110)
    return min(_directions(drawing, asides, (20, 27, 14)), key=cost)


def view_of_drawing(course: Array, normal: Array, boxes: Boxes) -> Array:
    """Return the direction from which to look at a drawing in a plane: steep enough to read it.

    The arm may hide some of the drawing, but least at the end, when it is complete.

    Args:
        course: Points of the drawing, shape (k, 3) [m].
        normal: Unit normal of its plane, shape (3,).
        boxes: Boxes round the arm.

    Returns:
        A unit vector from the scene to the camera, shape (3,).
    """
    drawing = some(course)
    last = boxes.posture(-1)

    def cost(direction: Array) -> float:
        to_surface = abs(float(direction @ normal) - _STEEPNESS)
        to_horizontal = abs(float(direction[2]) - _STEEPNESS)
        share = 2.0 * boxes.hidden_share(drawing, direction) + last.hidden_share(drawing, direction)
        slope = _slope_in_sight(direction, normal)
        return share + to_surface + 0.5 * to_horizontal + slope

    asides = (40, -40, 55, -55, 70, -70, 90, -90, 110, -110, 135, -135, 180, 0)
    return min(_directions(drawing, asides, (36, 28, 20, 44, 52, 14)), key=cost)


def points_round(drawing: Array, normal: Array) -> Array:
    """Return points round a drawing in a plane, shape (k, 3) [m].

    A camera that shows them is close enough to read the drawing; of the arm it shows the tool and
    what is next to it.

    Args:
        drawing: Points of the drawing, shape (j, 3) [m].
        normal: Unit normal of its plane, to the side of the tool, shape (3,).
    """
    drawing = some(drawing)
    middle = (drawing.min(axis=0) + drawing.max(axis=0)) / 2.0
    extent = 2.0 * float(np.linalg.norm(drawing - middle, axis=1).max())
    axes = RotationMatrix.MakeFromOneVector(normal, 2).matrix().T
    aside = (extent / 2.0 + _ROOM_BESIDE) * np.array([axes[0], axes[1], -axes[0], -axes[1]])
    above = max(_ROOM_ABOVE, extent) * normal
    return np.concatenate((middle + aside, middle + above + aside))


def _view_of_change(boxes: Boxes, point: Array, ahead: float) -> Array:
    """Return the direction from which the first posture hides least of the last one.

    Preferably, the arm does not hide the point either.

    Args:
        boxes: Boxes of the arm; the last posture is the target.
        point: Desired position of the end effector, shape (1, 3) [m].
        ahead: Azimuth of the point seen from the base [rad].
    """
    first, last = boxes.posture(0), boxes.posture(-1)
    size = float(np.ptp(boxes.corners, axis=0).max())

    def cost(direction: Array) -> float:
        # Rays begin behind both: it does not matter which of them is in front.
        hidden_corners = first.hidden_share(last.corners - 10.0 * size * direction, direction)
        # The point is on the arm: it counts as hidden if more of the arm is in front of it.
        return hidden_corners + 0.3 * boxes.hidden_share(point + 0.04 * size * direction, direction)

    asides = np.radians(np.arange(-150.0, 151.0, 15.0))
    return min((_direction(ahead + aside, math.radians(20.0)) for aside in asides), key=cost)


def _slope_in_sight(direction: Array, normal: Array) -> float:
    """Return how nearly one looks along the slope of a plane, 0 to 1: its side shows how steep."""
    uphill = np.array([normal[0], normal[1], 0.0])
    size = float(np.linalg.norm(uphill))
    return abs(float(direction @ uphill)) / size if size > _LEVEL else 0.0


def some(points: Array, count: int = _CHECKS) -> Array:
    """Return about ``count`` points of a path, shape (k, 3), evenly chosen; or all of fewer."""
    return points[:: max(1, len(points) // count)]


def _azimuth(point: Array) -> float:
    """Return the azimuth of a point seen from the base [rad]."""
    return math.atan2(point[1], point[0])


def _directions(points: Array, asides: Sequence[int], elevations: Sequence[int]) -> list[Array]:
    """Return directions at these angles [deg], aside of where points are seen from the base."""
    ahead = _azimuth(points.mean(axis=0))
    return [
        _direction(ahead + math.radians(aside), math.radians(elevation))
        for aside in asides
        for elevation in elevations
    ]


def _direction(azimuth: float, elevation: float) -> Array:
    """Return the unit vector, shape (3,), at these angles [rad]."""
    level = math.cos(elevation)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])


# Number of directions in which the outermost points are kept.
_DIRECTIONS = 400
# How far a view of a nearly horizontal path is tilted, so that x points to the right and y up: a
# camera that looks straight down could be turned in any way.
_TILT, _NEARLY_VERTICAL = 0.22, 0.94


@dataclass(frozen=True)
class View:
    """A view that the page fits to its window.

    Attributes:
        points: What must be in the frame, shape (k, 3) [m].
        target: Point about which a user turns the view, shape (3,) [m].
        direction: Unit vector from the scene to the camera, shape (3,).
    """

    points: Array
    target: Array
    direction: Array

    def as_data(self) -> dict[str, Any]:
        """Return the view as the page reads it."""
        return {
            "points": round_points(outermost(self.points)),
            "target": round_points(self.target),
            "direction": round_points(self.direction, 6),
        }


def outermost(points: Array) -> Array:
    """Return the points that are farthest out in any of many directions, shape (k, 3) [m]."""
    # Directions on a spiral are evenly spread over the sphere.
    turns = np.arange(_DIRECTIONS) + 0.5
    height = 1.0 - 2.0 * turns / _DIRECTIONS
    around = math.pi * (1.0 + math.sqrt(5.0)) * turns
    level = np.sqrt(1.0 - height**2)
    directions = np.stack((level * np.cos(around), level * np.sin(around), height))
    return points[np.unique(np.argmax(points @ directions, axis=0))]


def facing(path: Array, towards: Array) -> Array:
    """Return the direction from which a path is seen as it is drawn: at right angles to its plane.

    Args:
        path: Points of the path, shape (k, 3) [m]; one that lies in no plane is seen from
            ``towards``.
        towards: Unit vector to the side that the camera should be on, shape (3,).
    """
    spread = np.linalg.svd(path - path.mean(axis=0), full_matrices=False)
    sizes, normal = spread[1], spread[2][-1]
    if len(path) < 3 or sizes[1] < 1e-3 * max(float(sizes[0]), 1e-9):
        return towards
    # From above, unless the plane is nearly vertical.
    side = normal[2] if abs(normal[2]) > 0.3 else normal @ towards
    normal = normal if side >= 0.0 else -normal
    if abs(normal[2]) > _NEARLY_VERTICAL:
        normal = normal - _TILT * np.eye(3)[1]
    return np.asarray(normal / np.linalg.norm(normal))


def box_round(points: Array, margin: float) -> Array:
    """Return the corners of a box round points, ``margin`` [m] wider, shape (8, 3) [m]."""
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
