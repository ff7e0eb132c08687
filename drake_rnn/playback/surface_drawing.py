"""What a tool draws on a surface that it presses on, as a pen would."""

from __future__ import annotations

import math

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from ..inputs.fields import Array
from .camera import Boxes, aim_camera
from .closeup import framed, view_onto
from .drawn_surface import draw_surface
from .force_arrow import arrow_legend, draw_arrow, record_arrow
from .moving import move
from .pressing import Pressing
from .replayed_motion import ReplayedMotion
from .ribbons import ribbon
from .stage import DESIRED_COLOUR
from .trace import Trace
from .tubes import thinned

# A pen's line, and the wider one that it is to follow, over the extent of what is drawn; of
# less than that extent [m] they would be too thin to see.
_PEN, _GUIDE, _LEAST_EXTENT = 0.022, 0.05, 0.03
# The ring round the point to be at: wider than the tool's ball [m].
_RING, _RING_WIDTH = 0.014, 0.0024


class SurfaceDrawing:
    """See `shown.Shown`.

    Args:
        motion: What is replayed.
        boxes: Round the arm.
        pressing: The contact.
    """

    def __init__(self, motion: ReplayedMotion, boxes: Boxes, pressing: Pressing) -> None:
        self._motion = motion
        self._boxes = boxes
        self._pressing = pressing

    @property
    def legend(self) -> str:
        """How long an arrow is for which force."""
        return arrow_legend(self._pressing)

    def set_up(self, meshcat: Meshcat) -> Array:
        """The surface, which is above the ground."""
        return draw_surface(meshcat, self._pressing)

    def aim(self, meshcat: Meshcat) -> None:
        """At the drawing, and the tool above it."""
        pressing = self._pressing
        direction = view_onto(pressing, self._boxes)
        aim_camera(meshcat, framed(pressing), pressing.lap, direction)

    def draw(self, meshcat: Meshcat) -> None:
        """The path on the surface, a ring where to be, the strokes, and the force."""
        pressing = self._pressing
        extent = max(float(np.linalg.norm(np.ptp(pressing.lap, axis=0))), _LEAST_EXTENT)
        fine = _PEN * extent / 4.0
        if not self._motion.rests:
            self._draw_desired(meshcat, "path", thinned(pressing.lap, fine)[0], _GUIDE * extent)
        self._draw_desired(meshcat, "point", self._ring(), _RING_WIDTH)
        self._trace = Trace(meshcat, float(self._motion.time[-1]))
        for stroke in pressing.strokes():
            points, kept = thinned(pressing.trace[stroke], fine)
            if len(kept) == 1:
                # A touch as short as a sample is a dot.
                points, kept = points[[0, 0]], [0, 0]
            line = ribbon(points, pressing.normal, _PEN * extent)
            self._trace.add(line, self._motion.time[stroke][kept])
        for layer in ("/desired", "/traced"):
            meshcat.SetProperty(layer, "castShadow", False)
        draw_arrow(meshcat)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """The ring and the arrow move, the strokes grow."""
        motion, pressing = self._motion, self._pressing
        move(recording, "/desired/point", motion.at(time, pressing.desired))
        points, forces = motion.at(time, pressing.contact), motion.at(time, pressing.force)
        record_arrow(recording, pressing, points, forces)
        self._trace.record(recording, time)

    def _draw_desired(self, meshcat: Meshcat, name: str, points: Array, width: float) -> None:
        vertices, faces, _ = ribbon(points, self._pressing.normal, width)
        meshcat.SetTriangleMesh(f"/desired/{name}", vertices, faces, Rgba(*DESIRED_COLOUR))

    def _ring(self) -> Array:
        angles = np.linspace(0.0, math.tau, 121)
        circle = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
        return np.asarray(_RING * (self._pressing.R_WS.matrix() @ circle).T)
