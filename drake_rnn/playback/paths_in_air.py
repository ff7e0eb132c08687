"""Desired and traced path of a tool that touches nothing, as tubes in the air."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform

from ..inputs.fields import Array
from .animation import Trace, move
from .axes import Axes
from .boxes import Boxes
from .camera import aim_camera, view_of_paths
from .lines import thinned, tube
from .replay import ReplayedMotion
from .stage import DESIRED_COLOUR, TRACED_COLOUR

# Radius of the traced path, relative to the extent of the scene.
_RADIUS = 0.003
# Radius of the ball at the start of an open path and edge of the box at its end, likewise.
_START, _END = 4.0, 7.0
# Radii relative to that of the traced path: of the desired path, the traced point, the desired
# point, and a desired point at rest, which would hide the flange if it were larger.
_PATH, _TRACED_POINT, _DESIRED_POINT, _RESTING_POINT = 2.2, 2.0, 7.0, 5.5


class PathsInAir:
    """Both paths in the air; see `page.DrawnPaths`.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        boxes: Boxes round the arm.
    """

    legend = None

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion, boxes: Boxes) -> None:
        self._meshcat = meshcat
        self._motion = motion
        self._boxes = boxes
        self._trace = Trace(meshcat, motion.duration)

    def set_up(self) -> Array:
        """Return the points of both paths; there is nothing that they lie on."""
        return self._path

    def aim(self) -> None:
        """Aim the camera at the arm and both paths."""
        direction = view_of_paths(self._motion, self._boxes)
        aim_camera(self._meshcat, self._points, self._path, direction)

    def draw(self) -> None:
        """Draw both paths, and a ball on each."""
        motion = self._motion
        radius = self._radius
        self._draw_desired(radius)
        points, kept = thinned(motion.traced, radius)
        self._trace.add(tube(points, radius), motion.time[kept])
        ball = Sphere(_TRACED_POINT * radius)
        self._meshcat.SetObject("/traced/point", ball, Rgba(*TRACED_COLOUR))
        if motion.turns:
            self._axes.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move and the traced path grows."""
        motion = self._motion
        move(recording, "/desired/point", motion.at(time, motion.desired))
        move(recording, "/traced/point", motion.at(time, motion.traced))
        self._trace.record(recording, time)
        if motion.turns:
            self._axes.record(recording, time)

    @cached_property
    def _axes(self) -> Axes:
        return Axes(self._meshcat, self._motion, self._radius)

    @cached_property
    def _radius(self) -> float:
        """Radius of the traced path [m]."""
        return _RADIUS * float(np.ptp(self._points, axis=0).max())

    @cached_property
    def _path(self) -> Array:
        """Points of both paths, shape (k, 3) [m]."""
        return np.concatenate((self._motion.course, self._motion.traced))

    @cached_property
    def _points(self) -> Array:
        """Points of both paths and of the arm, shape (k, 3) [m]."""
        return np.concatenate((self._boxes.corners, self._path))

    def _draw_desired(self, radius: float) -> None:
        """Draw the desired path, unless it is a point, and the desired point."""
        motion = self._motion
        if not motion.rests:
            vertices, faces, _ = tube(thinned(motion.course, radius)[0], _PATH * radius)
            # Only the inside of the wider tube is drawn, where it faces the camera: a rim round the
            # traced path that never hides it.
            rim = Meshcat.SideOfFaceToRender.kBackSide
            colour = Rgba(*DESIRED_COLOUR)
            self._meshcat.SetTriangleMesh("/desired/path", vertices, faces, colour, side=rim)
        if motion.ends:
            self._mark("start", Sphere(_START * radius), motion.course[0])
            self._mark("end", Box(*3 * (_END * radius,)), motion.course[-1])
        ball = Sphere((_RESTING_POINT if motion.rests else _DESIRED_POINT) * radius)
        self._meshcat.SetObject("/desired/point", ball, Rgba(*DESIRED_COLOUR, 0.5))

    def _mark(self, name: str, shape: Shape, point: Array) -> None:
        """Draw a shape at a point of the desired path, at "/desired/name"."""
        self._meshcat.SetObject(f"/desired/{name}", shape, Rgba(*DESIRED_COLOUR))
        self._meshcat.SetTransform(f"/desired/{name}", RigidTransform(point))
