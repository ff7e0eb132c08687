"""Camera positions: close to the scene, and where the arm hides as little of a path as possible."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RotationMatrix

from ..inputs.fields import Array
from .boxes import Boxes
from .replay import ReplayedContact, ReplayedMotion

# Number of points of a path whose visibility is checked.
_CHECKED = 50
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
    # A single point lies in no plane.
    normal = np.zeros(3) if motion.rests else np.linalg.svd(course - centre)[2][-1]
    elevation = math.radians(16.0 + 16.0 * abs(normal[2]))

    def cost(aside: float) -> float:
        direction = _direction(ahead + math.radians(aside), elevation)
        face_on = min(abs(float(normal @ direction)), 0.7)
        return boxes.hidden(course, direction) - face_on + 0.003 * abs(abs(aside) - 48.0)

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
        hidden = boxes.hidden(drawing, direction)
        return hidden + _slope_in_sight(direction, contact.normal) + abs(direction[2] - 0.4)

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
        hidden = 2.0 * boxes.hidden(drawing, direction) + last.hidden(drawing, direction)
        slope = _slope_in_sight(direction, normal)
        return hidden + to_surface + 0.5 * to_horizontal + slope

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
        covered = first.hidden(last.corners - 10.0 * size * direction, direction)
        # The point is on the arm: it counts as hidden if more of the arm is in front of it.
        return covered + 0.3 * boxes.hidden(point + 0.04 * size * direction, direction)

    asides = np.radians(np.arange(-150.0, 151.0, 15.0))
    return min((_direction(ahead + aside, math.radians(20.0)) for aside in asides), key=cost)


def _slope_in_sight(direction: Array, normal: Array) -> float:
    """Return how nearly one looks along the slope of a plane, 0 to 1: its side shows how steep."""
    uphill = np.array([normal[0], normal[1], 0.0])
    size = float(np.linalg.norm(uphill))
    return abs(float(direction @ uphill)) / size if size > _LEVEL else 0.0


def some(points: Array, count: int = _CHECKED) -> Array:
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
