"""The drawings of several runs side by side, the first under the arm that draws it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from ..inputs.fields import Array
from ..measures import told
from .boxes import Boxes
from .camera import points_round, view_of_drawing
from .curves import Curves
from .labels import Label
from .replay import ReplayedMotion, name_of
from .views import View, facing

# Radius of a traced path, the distance from one drawing to the next, and the room for a label below
# a drawing, relative to the extent of a drawing.
_RADIUS, _GAP, _LABEL = 0.006, 0.3, 0.3
# Radius of the desired point over that of the traced path: the view is close.
_DESIRED_POINT = 4.0
# Smallest extent of a drawing that counts [m].
_LEAST_EXTENT = 0.03


class PathsBeside:
    """Desired and traced paths of several runs in one view; see `page.DrawnPaths`.

    Each drawing after the first is moved aside, along the width of the view, to where the arm hides
    it least. All have the same scale.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion whose arm is drawn.
        others: The motions to draw beside it.
        boxes: Boxes round the arm.
    """

    legend = None

    def __init__(
        self,
        meshcat: Meshcat,
        motion: ReplayedMotion,
        others: Sequence[ReplayedMotion],
        boxes: Boxes,
    ) -> None:
        self._boxes = boxes
        self._motions = (motion, *others)
        course = motion.course
        middle = (course.min(axis=0) + course.max(axis=0)) / 2.0
        # A path that is a point lies in no plane.
        normal = np.eye(3)[2] if motion.rests else np.linalg.svd(course - middle)[2][-1]
        self._normal = normal if normal[2] >= 0.0 else -normal
        self._direction = view_of_drawing(course, self._normal, boxes)
        self._right = np.cross([0.0, 0.0, 1.0], self._direction)
        self._right /= np.linalg.norm(self._right)
        self._up = np.cross(self._direction, self._right)
        self._asides = self._moved_aside(boxes)
        self._extent = max(float(np.linalg.norm(np.ptp(course, axis=0))), _LEAST_EXTENT)
        self._curves = [
            Curves(meshcat, each, _RADIUS * self._extent, place, aside, _DESIRED_POINT)
            for each, place, aside in zip(self._motions, self._places, self._asides, strict=True)
        ]

    @property
    def labels(self) -> list[Label]:
        """The name of each run and its largest error, below its drawing."""
        return [
            Label(_told(motion), self._foot(_points(motion) + aside))
            for motion, aside in zip(self._motions, self._asides, strict=True)
        ]

    def set_up(self) -> Array:
        """Return the points of all paths; there is nothing that they lie on."""
        return self._drawings

    def stand(self, floor: float) -> None:
        """Draw nothing: paths in the air lie on nothing."""

    def views(self) -> dict[str, View]:
        """Return the views: with the arm, of the drawings with the tool, of the drawings alone."""
        tool = points_round(_points(self._motions[0]), self._normal)
        below = [point - _LABEL * self._extent * self._up for _, point in self.labels]
        drawings = np.concatenate((self._drawings, below))
        middle = (drawings.min(axis=0) + drawings.max(axis=0)) / 2.0
        arm = np.concatenate((self._boxes.corners, drawings))
        face = facing(self._motions[0].course, self._direction)
        return {
            "arm": View(arm, middle, self._direction),
            "close": View(np.concatenate((tool, drawings)), middle, self._direction),
            "path": View(drawings, middle, face),
        }

    def draw(self) -> None:
        """Draw all paths, and a ball on each."""
        for curves in self._curves:
            curves.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move and the traced paths grow."""
        for curves in self._curves:
            curves.record(recording, time)

    def grows(self) -> list[dict[str, Any]]:
        """Return how the traced paths grow."""
        return [grows for curves in self._curves for grows in curves.grows()]

    def scaled(self) -> list[dict[str, Any]]:
        """Return what the page draws thicker or thinner, to suit the view."""
        return [scaled for curves in self._curves for scaled in curves.scaled()]

    @property
    def _places(self) -> list[str]:
        return ["", *(f"/beside/{k}" for k in range(1, len(self._motions)))]

    @property
    def _drawings(self) -> Array:
        """Points of all paths where they are drawn, shape (k, 3) [m]."""
        moved = zip(self._motions, self._asides, strict=True)
        return np.concatenate([_points(motion) + aside for motion, aside in moved])

    def _moved_aside(self, boxes: Boxes) -> list[Array]:
        """Return how far each drawing is moved, shape (3,) [m], towards where less is hidden."""
        right = self._right
        widths = [_points(motion) @ right for motion in self._motions]

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
            rest = zip(self._motions[1:], asides[1:], strict=True)
            return sum(
                boxes.hidden(motion.course + aside, self._direction) for motion, aside in rest
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
