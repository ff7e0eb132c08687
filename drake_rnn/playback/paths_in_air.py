"""Desired and traced path of a tool that touches nothing, as tubes in the air."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from ..inputs.fields import Array
from .axes import Axes
from .boxes import Boxes
from .camera import view_of_paths
from .curves import Curves
from .labels import Label
from .replay import ReplayedMotion
from .views import View, box_round, facing

# Radius of the traced path, relative to the extent of the scene.
_RADIUS = 0.003
# Room round the paths in a view of them, relative to their extent; for the tool beside them, and
# round an end effector that rests, relative to the extent of the scene.
_EDGE, _BESIDE, _NEAR = 0.06, 0.03, 0.12


class PathsInAir:
    """Both paths in the air; see `page.DrawnPaths`.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion to replay.
        boxes: Boxes round the arm.
    """

    legend = None
    labels: Sequence[Label] = ()

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion, boxes: Boxes) -> None:
        self._meshcat = meshcat
        self._motion = motion
        self._boxes = boxes

    def set_up(self) -> Array:
        """Return the points of both paths; there is nothing that they lie on."""
        return self._path

    def stand(self, floor: float) -> None:
        """Draw nothing: a path in the air lies on nothing."""

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the paths with the tool, of the paths alone."""
        motion, path = self._motion, self._path
        direction = view_of_paths(motion, self._boxes)
        middle = (path.min(axis=0) + path.max(axis=0)) / 2.0
        arm = View(self._points, path.mean(axis=0), direction)
        if motion.rests:
            # There is no path to be seen closely, but the end effector, and what it does.
            near = View(box_round(path, _NEAR * self._size), middle, direction)
            return {"arm": arm, "close": near, "path": near}
        edge = _EDGE * float(np.ptp(path, axis=0).max())
        near = View(box_round(path, edge + _BESIDE * self._size), middle, direction)
        face = facing(motion.course, direction)
        return {"arm": arm, "close": near, "path": View(box_round(path, edge), middle, face)}

    def draw(self) -> None:
        """Draw both paths, and a ball on each."""
        self._curves.draw()
        if self._motion.turns:
            self._axes.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move and the traced path grows."""
        self._curves.record(recording, time)
        if self._motion.turns:
            self._axes.record(recording, time)

    def grows(self) -> list[dict[str, Any]]:
        """Return how the traced path grows."""
        return self._curves.grows()

    def scaled(self) -> list[dict[str, Any]]:
        """Return what the page draws thicker or thinner, to suit the view."""
        return self._curves.scaled()

    @cached_property
    def _curves(self) -> Curves:
        return Curves(self._meshcat, self._motion, self._radius)

    @cached_property
    def _axes(self) -> Axes:
        return Axes(self._meshcat, self._motion, self._radius)

    @cached_property
    def _radius(self) -> float:
        """Radius of the traced path [m]."""
        return _RADIUS * self._size

    @cached_property
    def _size(self) -> float:
        """Extent of the scene [m]."""
        return float(np.ptp(self._points, axis=0).max())

    @cached_property
    def _path(self) -> Array:
        """Points of both paths, shape (k, 3) [m]."""
        return np.concatenate((self._motion.course, self._motion.traced))

    @cached_property
    def _points(self) -> Array:
        """Points of both paths and of the arm, shape (k, 3) [m]."""
        return np.concatenate((self._boxes.corners, self._path))
