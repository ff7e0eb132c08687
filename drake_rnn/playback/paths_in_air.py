"""Desired and traced path of a tool that touches nothing, as tubes in the air."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from ..inputs.fields import Array
from .axes import Axes
from .boxes import Boxes
from .camera import view_of_paths
from .curves import Curves
from .drawn_paths import DrawnCurves
from .obstacles import corners_of_obstacles
from .replay import ReplayedMotion
from .second_arm import SecondArm
from .views import View, box_round, facing

# Radius of the traced path, relative to the extent of the scene.
_RADIUS = 0.003
# Room round the paths in a view of them, relative to their extent; for the tool beside them, and
# round an end effector that rests, relative to the extent of the scene.
_EDGE, _BESIDE, _NEAR = 0.06, 0.03, 0.12


class PathsInAir(DrawnCurves):
    """Both paths in the air, and the end effector's axes if the path turns them.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        boxes: Boxes round the arm.
        second: Another arm beside it, whose paths are drawn as well; None without one.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        boxes: Boxes,
        second: SecondArm | None = None,
    ) -> None:
        motions = [motion] if second is None else [motion, second.motion]
        path = np.concatenate([part for each in motions for part in (each.course, each.traced)])
        around = corners_of_obstacles(motion.result.experiment)
        if second is not None:
            around = np.concatenate((around, second.corners))
        self._scene = np.concatenate((boxes.corners, path, around))
        self._size = float(np.ptp(self._scene, axis=0).max())
        places = ("", "/beside_it")
        curves = [
            Curves(meshcat, each, _RADIUS * self._size, place)
            for each, place in zip(motions, places, strict=False)
        ]
        super().__init__(curves, path)
        self._motion = motion
        self._boxes = boxes
        self._axes = Axes(meshcat, motion, _RADIUS * self._size) if motion.turns else None

    def draw(self, floor: float) -> None:
        """Draw both paths, a ball on each, and axes; paths in the air have no stand."""
        super().draw(floor)
        if self._axes is not None:
            self._axes.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how balls and axes move; ``time`` of each frame, shape (f,) [s]."""
        super().record(recording, time)
        if self._axes is not None:
            self._axes.record(recording, time)

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the paths with the tool, of the paths alone."""
        motion, path = self._motion, self._points
        direction = view_of_paths(motion, self._boxes)
        middle = (path.min(axis=0) + path.max(axis=0)) / 2.0
        arm = View(self._scene, path.mean(axis=0), direction)
        if motion.rests:
            # Without a path to look at, the close view shows the end effector.
            near = View(box_round(path, _NEAR * self._size), middle, direction)
            return {"arm": arm, "close": near, "path": near}
        edge = _EDGE * float(np.ptp(path, axis=0).max())
        near = View(box_round(path, edge + _BESIDE * self._size), middle, direction)
        course = motion.course
        # Moves with a lifted pen leave the plane that a drawing is seen in.
        face = facing(course[motion.pen_is_down(course)], direction)
        return {"arm": arm, "close": near, "path": View(box_round(path, edge), middle, face)}
