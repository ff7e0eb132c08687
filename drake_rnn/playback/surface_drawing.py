"""Desired and traced path of a tool that presses against a surface, as lines of a pen on it.

- The force on the tool, as an arrow from the point of contact.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..inputs.fields import Array
from .path_drawings import DrawnPaths
from .replay import (
    ReplayedContact,
    ReplayedMotion,
    Trace,
    draw_smooth,
    draw_stand,
    draw_surface,
    move,
    ribbon,
    thin,
)
from .viewpoint import (
    Boxes,
    View,
    box_round,
    facing,
    points_round,
    view_of_arm_and_surface,
    view_of_drawing,
)

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


# Widths of the traced and of the desired line relative to the extent of the drawing, and the
# smallest extent that counts [m]: lines on a smaller drawing would be too thin to see.
_TRACED, _DESIRED, _LEAST_EXTENT = 0.022, 0.05, 0.03
# Diameter of the dot at the start of an open path, and edge of the square at its end, relative to
# the extent of the drawing.
_START, _END = 0.12, 0.16
# Room round a drawing that is seen alone, relative to its extent.
_EDGE = 0.08
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
        drawing = box_round(np.concatenate((course, contact.trace)), _EDGE * self._extent + _RING)
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
            self._draw_desired("start", contact.course[[0, 0]], _START * extent)
            self._draw_desired("end", self._square(_END * extent), _DESIRED * extent)
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
