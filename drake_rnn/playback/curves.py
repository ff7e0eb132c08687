"""A desired and a traced path as tubes in the air, each with a ball that moves along it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, Rgba, Shape, Sphere
from pydrake.math import RigidTransform

from .. import colours
from ..inputs.fields import Array
from .animation import Trace, draw_smooth, move
from .lines import merged, simplified, tube
from .replay import ReplayedMotion, stretches

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
            traced, time = motion.traced[stroke], motion.time[stroke]
            kept = simplified(traced, _DEVIATION * radius, time)
            self._trace.add(tube(traced[kept] + self.aside, radius), time[kept])
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

    def scaled(self) -> list[dict[str, Any]]:
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
            kept = [each[simplified(each, _DEVIATION * radius)] for each in strokes]
            mesh = merged([tube(each, _PATH * radius) for each in kept])
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
