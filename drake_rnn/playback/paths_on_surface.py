"""Desired and traced path of a tool that presses against a surface, as lines of a pen on it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from ..inputs.fields import Array
from .animation import Trace, move
from .boxes import Boxes
from .camera import aim_camera, points_round, view_of_surface
from .force_arrow import arrow_legend, draw_arrow, record_arrow
from .labels import Label
from .lines import ribbon, thinned
from .replay import ReplayedContact, ReplayedMotion
from .stage import DESIRED_COLOUR
from .surface import draw_surface

# Widths of the traced and of the desired line relative to the extent of the drawing, and the
# smallest extent that counts [m]: lines on a smaller drawing would be too thin to see.
_TRACED, _DESIRED, _LEAST_EXTENT = 0.022, 0.05, 0.03
# Diameter of the dot at the start of an open path and edge of the square at its end, likewise.
_START, _END = 0.12, 0.16
# Radius and width of the ring round the desired point [m]; it is wider than the tool's ball.
_RING, _RING_WIDTH = 0.014, 0.0024


class PathsOnSurface:
    """Both paths on a surface, and the force on the tool; see `page.DrawnPaths`.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        contact: Its contact.
        boxes: Boxes round the arm.
    """

    labels: Sequence[Label] = ()

    def __init__(
        self, meshcat: Meshcat, motion: ReplayedMotion, contact: ReplayedContact, boxes: Boxes
    ) -> None:
        self._meshcat = meshcat
        self._motion = motion
        self._contact = contact
        self._boxes = boxes
        self._trace = Trace(meshcat, motion.duration)

    @property
    def legend(self) -> str:
        """Scale of the force arrow."""
        return arrow_legend(self._contact)

    def set_up(self) -> Array:
        """Draw the surface and return corners of boxes round it."""
        contact = self._contact
        drawing = np.concatenate((contact.course, contact.trace))
        return draw_surface(self._meshcat, contact.surface, contact.p_WS, drawing)

    def aim(self) -> None:
        """Aim the camera at the drawing and the tool above it."""
        contact = self._contact
        direction = view_of_surface(contact, self._boxes)
        aim_camera(
            self._meshcat, points_round(contact.course, contact.normal), contact.course, direction
        )

    def draw(self) -> None:
        """Draw the desired path, a ring round the desired point, the traced path and the force."""
        contact = self._contact
        extent = max(float(np.linalg.norm(np.ptp(contact.course, axis=0))), _LEAST_EXTENT)
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
        for layer in ("/desired", "/traced"):
            self._meshcat.SetProperty(layer, "castShadow", False)
        draw_arrow(self._meshcat)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the ring and the arrow move and the traced path grows."""
        motion, contact = self._motion, self._contact
        move(recording, "/desired/point", motion.at(time, contact.desired))
        points, forces = motion.at(time, contact.contact), motion.at(time, contact.force)
        record_arrow(recording, contact, points, forces)
        self._trace.record(recording, time)

    def _draw_desired(self, name: str, points: Array, width: float) -> None:
        """Draw a line of the desired path, ``width`` [m] wide, at "/desired/name"."""
        vertices, faces, _ = ribbon(points, self._contact.normal, width)
        colour = Rgba(*DESIRED_COLOUR)
        self._meshcat.SetTriangleMesh(f"/desired/{name}", vertices, faces, colour)

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
