"""The paths of a tool that touches nothing, as tubes in the air."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba, Sphere

from ..inputs.fields import Array
from .camera import Boxes, aim_camera, view_direction
from .moving import move
from .replayed_motion import ReplayedMotion
from .stage import DESIRED_COLOUR, TRACED_COLOUR
from .trace import Trace
from .tubes import thinned, tube


class FreeMotion:
    """See `shown.Shown`.

    Args:
        motion: What is replayed.
        boxes: Round the arm.
    """

    legend = None

    def __init__(self, motion: ReplayedMotion, boxes: Boxes) -> None:
        self._motion = motion
        self._boxes = boxes

    def set_up(self, meshcat: Meshcat) -> Array:
        """Nothing; both paths are above the ground."""
        return self._path

    def aim(self, meshcat: Meshcat) -> None:
        """At all of the arm and of the paths."""
        direction = view_direction(self._motion, self._boxes)
        aim_camera(meshcat, self._points, self._path, direction)

    def draw(self, meshcat: Meshcat) -> None:
        """The path to follow, the traced one, and a ball on each."""
        motion = self._motion
        radius = 0.003 * float(np.ptp(self._points, axis=0).max())
        self._draw_desired(meshcat, radius)
        points, kept = thinned(motion.traced, radius)
        self._trace = Trace(meshcat, float(motion.time[-1]))
        self._trace.add(tube(points, radius), motion.time[kept])
        meshcat.SetObject("/traced/point", Sphere(2.0 * radius), Rgba(*TRACED_COLOUR))

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """The balls move, the trace grows."""
        motion = self._motion
        move(recording, "/desired/point", motion.at(time, motion.desired))
        move(recording, "/traced/point", motion.at(time, motion.traced))
        self._trace.record(recording, time)

    @cached_property
    def _path(self) -> Array:
        return np.concatenate((self._motion.lap, self._motion.traced))

    @cached_property
    def _points(self) -> Array:
        return np.concatenate((self._boxes.corners, self._path))

    def _draw_desired(self, meshcat: Meshcat, radius: float) -> None:
        """The path to follow, if it leads anywhere, and the point on it."""
        motion = self._motion
        if not motion.rests:
            vertices, faces, _ = tube(thinned(motion.lap, radius)[0], 2.2 * radius)
            # Of the wider tube only the far inside is drawn: a rim round the trace that never
            # hides it.
            rim = Meshcat.SideOfFaceToRender.kBackSide
            colour = Rgba(*DESIRED_COLOUR)
            meshcat.SetTriangleMesh("/desired/path", vertices, faces, colour, side=rim)
        # Where it stays at the flange all the time, the flange is to be seen too.
        ball = Sphere((5.5 if motion.rests else 7.0) * radius)
        meshcat.SetObject("/desired/point", ball, Rgba(*DESIRED_COLOUR, 0.5))
