"""Camera directions, and the points that must be in the frame whatever the window's shape."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..inputs.fields import Array
from .packing import rounded

# Number of directions in which the outermost points are kept.
_DIRECTIONS = 400
# How far a view of a nearly horizontal path is tilted, so that x points to the right and y up: a
# camera that looks straight down could be turned in any way.
_TILT, _NEARLY_VERTICAL = 0.22, 0.94


@dataclass(frozen=True)
class View:
    """A view that the page fits to its window.

    Attributes:
        points: What must be in the frame, shape (k, 3) [m].
        target: Point about which a user turns the view, shape (3,) [m].
        direction: Unit vector from the scene to the camera, shape (3,).
    """

    points: Array
    target: Array
    direction: Array

    def as_data(self) -> dict[str, Any]:
        """Return the view as the page reads it."""
        return {
            "points": rounded(outermost(self.points)),
            "target": rounded(self.target),
            "direction": rounded(self.direction, 6),
        }


def outermost(points: Array) -> Array:
    """Return the points that are farthest out in any of many directions, shape (k, 3) [m]."""
    # Directions on a spiral are evenly spread over the sphere.
    turns = np.arange(_DIRECTIONS) + 0.5
    height = 1.0 - 2.0 * turns / _DIRECTIONS
    around = math.pi * (1.0 + math.sqrt(5.0)) * turns
    level = np.sqrt(1.0 - height**2)
    directions = np.stack((level * np.cos(around), level * np.sin(around), height))
    return points[np.unique(np.argmax(points @ directions, axis=0))]


def facing(path: Array, towards: Array) -> Array:
    """Return the direction from which a path is seen as it is drawn: at right angles to its plane.

    Args:
        path: Points of the path, shape (k, 3) [m]; one that lies in no plane is seen from
            ``towards``.
        towards: Unit vector to the side that the camera should be on, shape (3,).
    """
    spread = np.linalg.svd(path - path.mean(axis=0), full_matrices=False)
    sizes, normal = spread[1], spread[2][-1]
    if len(path) < 3 or sizes[1] < 1e-3 * max(float(sizes[0]), 1e-9):
        return towards
    # From above, unless the plane is nearly vertical.
    side = normal[2] if abs(normal[2]) > 0.3 else normal @ towards
    normal = normal if side >= 0.0 else -normal
    if abs(normal[2]) > _NEARLY_VERTICAL:
        normal = normal - _TILT * np.eye(3)[1]
    return np.asarray(normal / np.linalg.norm(normal))


def box_round(points: Array, margin: float) -> Array:
    """Return the corners of a box round points, ``margin`` [m] wider, shape (8, 3) [m]."""
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
