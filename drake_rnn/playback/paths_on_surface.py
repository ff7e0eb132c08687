"""Desired and traced path of a tool that presses against a surface, as lines of a pen on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from .. import colours
from ..inputs.fields import Array
from .animation import Trace, draw_smooth, move
from .boxes import Boxes
from .camera import points_round, view_of_arm_and_surface, view_of_drawing
from .drawn_paths import DrawnPaths
from .force_arrow import arrow_legend, draw_arrow, record_arrow
from .lines import ribbon, thinned
from .replay import ReplayedContact, ReplayedMotion
from .surface import draw_stand, draw_surface
from .views import View, box_round, facing

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
            self._draw_desired("path", thinned(contact.course, step)[0], _DESIRED * extent)
        self._draw_desired("point", self._ring(), _RING_WIDTH)
        if self._motion.ends:
            self._draw_desired("start", contact.course[[0, 0]], _START * extent)
            self._draw_desired("end", self._square(_END * extent), _DESIRED * extent)
        for stroke in contact.strokes():
            points, kept = thinned(contact.trace[stroke], step)
            if len(kept) == 1:
                # A stroke of a single sample is a dot.
                points, kept = points[[0, 0]], [0, 0]
            line = ribbon(points, contact.normal, _TRACED * extent)
            self._trace.add(line, self._motion.time[stroke][kept])
        self._trace.draw()
        for layer in ("/desired", "/traced"):
            self._meshcat.SetProperty(layer, "castShadow", False)
        draw_arrow(self._meshcat)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the ring and the arrow move and the traced path grows."""
        motion, contact = self._motion, self._contact
        move(recording, "/desired/point", motion.at(time, contact.desired))
        points, forces = motion.at(time, contact.contact), motion.at(time, contact.force)
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
