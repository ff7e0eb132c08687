"""Desired and traced path of a tool that touches nothing, as tubes in the air."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from ..inputs.fields import Array
from .axes import Axes
from .boxes import Boxes
from .camera import aim_camera, view_of_paths
from .curves import Curves
from .labels import Label
from .replay import ReplayedMotion

# Radius of the traced path, relative to the extent of the scene.
_RADIUS = 0.003


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

    def aim(self) -> None:
        """Aim the camera at the arm and both paths."""
        direction = view_of_paths(self._motion, self._boxes)
        aim_camera(self._meshcat, self._points, self._path, direction)

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

    @cached_property
    def _curves(self) -> Curves:
        return Curves(self._meshcat, self._motion, self._radius)

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
