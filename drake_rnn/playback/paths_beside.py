"""The drawings of several runs side by side, the first under the arm that draws it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Meshcat

from ..inputs.fields import Array
from ..measures import told
from .boxes import Boxes
from .camera import points_round, view_of_drawing
from .curves import Curves
from .drawn_paths import DrawnCurves, Label
from .replay import ReplayedMotion, name_of
from .views import View, facing

# Radius of a traced path, the distance from one drawing to the next, and the room for a label below
# a drawing, relative to the extent of a drawing.
_RADIUS, _GAP, _LABEL = 0.006, 0.3, 0.3
# Radius of the desired point over the radius of the traced path; small, as the view is close.
_DESIRED_POINT = 4.0
# Smallest extent of a drawing that counts [m].
_LEAST_EXTENT = 0.03


class PathsBeside(DrawnCurves):
    """Desired and traced paths of several runs in one view.

    Each drawing after the first is moved aside, along the width of the view, to where the arm hides
    it least. All have the same scale.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion whose arm is drawn.
        others: The motions to draw beside it.
        boxes: Boxes round the arm.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        others: Sequence[ReplayedMotion],
        boxes: Boxes,
    ) -> None:
        self._boxes = boxes
        self._motion = motion
        motions = (motion, *others)
        course = motion.course
        middle = (course.min(axis=0) + course.max(axis=0)) / 2.0
        # A path that is a point lies in no plane.
        normal = np.eye(3)[2] if motion.rests else np.linalg.svd(course - middle)[2][-1]
        self._normal = normal if normal[2] >= 0.0 else -normal
        self._direction = view_of_drawing(course, self._normal, boxes)
        self._right = np.cross([0.0, 0.0, 1.0], self._direction)
        self._right /= np.linalg.norm(self._right)
        self._up = np.cross(self._direction, self._right)
        asides = self._moved_aside(motions)
        self._extent = max(float(np.linalg.norm(np.ptp(course, axis=0))), _LEAST_EXTENT)
        drawings = [_points(each) + aside for each, aside in zip(motions, asides, strict=True)]
        # The name of each run and its largest error, below its drawing.
        self.labels = [
            Label(_told(each), self._foot(drawing))
            for each, drawing in zip(motions, drawings, strict=True)
        ]
        places = ["", *(f"/beside/{k}" for k in range(1, len(motions)))]
        curves = [
            Curves(meshcat, each, _RADIUS * self._extent, place, aside, _DESIRED_POINT)
            for each, place, aside in zip(motions, places, asides, strict=True)
        ]
        super().__init__(curves, np.concatenate(drawings))

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the drawings with the tool, of the drawings alone."""
        tool = points_round(_points(self._motion), self._normal)
        below = [point - _LABEL * self._extent * self._up for _, point in self.labels]
        drawings = np.concatenate((self._points, below))
        middle = (drawings.min(axis=0) + drawings.max(axis=0)) / 2.0
        arm = np.concatenate((self._boxes.corners, drawings))
        face = facing(self._motion.course, self._direction)
        return {
            "arm": View(arm, middle, self._direction),
            "close": View(np.concatenate((tool, drawings)), middle, self._direction),
            "path": View(drawings, middle, face),
        }

    def _moved_aside(self, motions: Sequence[ReplayedMotion]) -> list[Array]:
        """Return how far each drawing is moved, shape (3,) [m], towards where less is hidden."""
        right = self._right
        widths = [_points(motion) @ right for motion in motions]

        def row(sign: float) -> list[Array]:
            """Return the displacements of a row that begins at the first drawing."""
            asides, edge = [np.zeros(3)], float((sign * widths[0]).max())
            gap = _GAP * max(float(np.ptp(width)) for width in widths)
            for width in widths[1:]:
                along = sign * width
                asides.append(sign * (edge + gap - along.min()) * right)
                edge += gap + float(np.ptp(along))
            return asides

        def hidden(asides: list[Array]) -> float:
            rest = zip(motions[1:], asides[1:], strict=True)
            return sum(
                self._boxes.hidden(motion.course + aside, self._direction) for motion, aside in rest
            )

        return min((row(1.0), row(-1.0)), key=hidden)

    def _foot(self, points: Array) -> Array:
        """Return the middle of the lower edge of a drawing as the camera sees it, (3,) [m]."""
        across, height = points @ self._right, points @ self._up
        lowest = int(np.argmin(height))
        middle = (across.min() + across.max()) / 2.0
        return np.asarray(points[lowest] + (middle - across[lowest]) * self._right)


def _points(motion: ReplayedMotion) -> Array:
    """Return the points of both paths of a motion, shape (k, 3) [m]."""
    return np.concatenate((motion.course, motion.traced))


def _told(motion: ReplayedMotion) -> tuple[str, str]:
    """Return the name of a run and, if it is known, how far it is off its path."""
    name = name_of(motion.result)
    if (error := motion.result.metrics.get("position_error_max_m")) is None:
        return name, ""
    return name, f"{told(error, 'm', 3)} off at most"
