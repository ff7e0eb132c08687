"""A desired and a traced path as tubes in the air, each with a ball that moves along it."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform

from ..inputs.fields import Array
from .animation import Trace, move
from .lines import thinned, tube
from .replay import ReplayedMotion
from .stage import DESIRED_COLOUR, TRACED_COLOUR

# Radius of the ball at the start of an open path and edge of the box at its end, relative to that
# of the traced path.
_START, _END = 4.0, 7.0
# Radii relative to that of the traced path: of the desired path, the traced point, the desired
# point, and a desired point at rest, which would hide the flange if it were larger.
_PATH, _TRACED_POINT, _DESIRED_POINT, _RESTING_POINT = 2.2, 2.0, 7.0, 5.5


class Curves:
    """The desired and the traced path of one motion.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        radius: Radius of the traced path [m].
        place: Scene path that both are below.
        aside: Displacement of all that is drawn from where it was, shape (3,) [m].
        desired_point: Radius of the desired point over that of the traced path; by default such
            that it is seen from far away.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        radius: float,
        place: str = "",
        aside: Array | None = None,
        desired_point: float = _DESIRED_POINT,
    ) -> None:
        self._meshcat = meshcat
        self._motion = motion
        self._radius = radius
        self._place = place
        self._aside = np.zeros(3) if aside is None else aside
        self._desired_point = desired_point
        self._trace = Trace(meshcat, motion.duration, f"{place}/traced/path")

    def draw(self) -> None:
        """Draw both paths, and a ball on each."""
        motion, radius = self._motion, self._radius
        self._draw_desired(radius)
        points, kept = thinned(motion.traced + self._aside, radius)
        self._trace.add(tube(points, radius), motion.time[kept])
        ball = Sphere(_TRACED_POINT * radius)
        self._meshcat.SetObject(f"{self._place}/traced/point", ball, Rgba(*TRACED_COLOUR))

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move and the traced path grows."""
        motion, aside = self._motion, self._aside
        for name, points in (("desired", motion.desired), ("traced", motion.traced)):
            move(recording, f"{self._place}/{name}/point", motion.at(time, points + aside))
        self._trace.record(recording, time)

    def _draw_desired(self, radius: float) -> None:
        """Draw the desired path, unless it is a point, and the desired point."""
        motion = self._motion
        course = motion.course + self._aside
        if not motion.rests:
            vertices, faces, _ = tube(thinned(course, radius)[0], _PATH * radius)
            # Only the inside of the wider tube is drawn, where it faces the camera: a rim round the
            # traced path that never hides it.
            rim = Meshcat.SideOfFaceToRender.kBackSide
            colour = Rgba(*DESIRED_COLOUR)
            place = f"{self._place}/desired/path"
            self._meshcat.SetTriangleMesh(place, vertices, faces, colour, side=rim)
        if motion.ends:
            self._mark("start", Sphere(_START * radius), course[0])
            self._mark("end", Box(*3 * (_END * radius,)), course[-1])
        ball = Sphere((_RESTING_POINT if motion.rests else self._desired_point) * radius)
        self._meshcat.SetObject(f"{self._place}/desired/point", ball, Rgba(*DESIRED_COLOUR, 0.5))

    def _mark(self, name: str, shape: Shape, point: Array) -> None:
        """Draw a shape at a point of the desired path, below its "/desired"."""
        place = f"{self._place}/desired/{name}"
        self._meshcat.SetObject(place, shape, Rgba(*DESIRED_COLOUR))
        self._meshcat.SetTransform(place, RigidTransform(point))
