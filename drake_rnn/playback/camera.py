"""From where the scene is seen: near, and with the path in view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform

from ..inputs.fields import Array
from .drawn_arm import DrawnArm
from .pressing import Pressing
from .replayed_motion import ReplayedMotion

_FIELD_OF_VIEW = math.radians(30.0)
_ASPECT = 1.5
_MARGIN = 1.08
POSTURES = 24
# A drawing fills about so much of the view's height.
_DRAWING_SHARE = 0.2
_NEAREST = 0.3
# Sine of the best angle to look down at, and along, a surface.
_STEEPNESS = 0.6


@dataclass(frozen=True)
class Boxes:
    """Boxes round the parts of the arm, posture by posture; b in all.

    Attributes:
        centre: Shape (b, 3) [m].
        axes: Their directions as columns, shape (b, 3, 3).
        half: Half their extents, shape (b, 3) [m].
        postures: How many postures; each has as many boxes.
    """

    centre: Array
    axes: Array
    half: Array
    postures: int

    @property
    def corners(self) -> Array:
        """Shape (8 b, 3) [m]."""
        signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)
        offsets = np.einsum("bij,kj,bj->bki", self.axes, signs, self.half)
        return np.asarray(self.centre[:, None] + offsets).reshape(-1, 3)

    def posture(self, number: int) -> Boxes:
        """Those of one posture."""
        count = len(self.centre) // self.postures
        one = slice(number * count, (number + 1) * count)
        return Boxes(self.centre[one], self.axes[one], self.half[one], 1)

    def hidden(self, points: Array, direction: Array) -> float:
        """Share of ``points``, shape (k, 3), that something hides from that direction."""
        start = np.einsum("bij,bki->bkj", self.axes, points - self.centre[:, None])
        # Parallel to a face is as good as nearly so.
        ray = np.einsum("bij,i->bj", self.axes, direction)[:, None] + 1e-9
        one, other = (-self.half[:, None] - start) / ray, (self.half[:, None] - start) / ray
        enters = np.minimum(one, other).max(axis=2)
        leaves = np.maximum(one, other).min(axis=2)
        hit = (leaves >= np.maximum(enters, 0.0)).reshape(self.postures, -1, len(points))
        return float(hit.any(axis=1).mean())


def boxes_of(motion: ReplayedMotion, drawn: DrawnArm) -> Boxes:
    """Boxes round the arm's parts at postures throughout the run, and in the target posture."""
    # An arm may have nothing to draw; where its bodies are it has.
    parts: list[tuple[Any, ...]] = [(body, RigidTransform(), np.zeros(3)) for body in drawn.bodies]
    for body, geometry in drawn.geometries():
        if (box := drawn.inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_BG = drawn.inspector.GetPoseInFrame(geometry) @ box.pose()
            parts.append((body, X_BG, box.half_width()))
    postures = list(motion.position[np.linspace(0, len(motion.time) - 1, POSTURES).astype(int)])
    if (target := motion.result.experiment.target) is not None:
        postures.append(target)
    centre, axes = [], []
    for q in postures:
        drawn.take(q)
        for body, X_BG, _ in parts:
            X_WG = drawn.X_WB(body) @ X_BG
            centre.append(X_WG.translation())
            axes.append(X_WG.rotation().matrix())
    half = np.tile([half for *_, half in parts], (len(postures), 1))
    return Boxes(np.array(centre), np.array(axes), half, len(postures))


def view_direction(motion: ReplayedMotion, boxes: Boxes) -> Array:
    """From where to look, a unit vector from the scene to the camera.

    Best from ahead and aside, which shows the arm and a path in any upright plane, unless
    the arm hides the path from there; a path that lies flat is looked down upon. With a target
    posture, from where one sees best how it differs from the start.
    """
    experiment = motion.result.experiment
    if experiment.document.task == "xy":
        return towards(-math.pi / 2.0, math.radians(76.0))
    lap = motion.lap[:: max(1, len(motion.lap) // 50)]
    centre = lap.mean(axis=0)
    ahead = math.atan2(centre[1], centre[0])
    if experiment.target is not None:
        return _view_of_change(boxes, lap[:1], ahead)
    # A point lies in no plane.
    normal = np.zeros(3) if motion.rests else np.linalg.svd(lap - centre)[2][-1]
    elevation = math.radians(16.0 + 16.0 * abs(normal[2]))

    def cost(aside: float) -> float:
        direction = towards(ahead + math.radians(aside), elevation)
        face_on = min(abs(float(normal @ direction)), 0.7)
        return boxes.hidden(lap, direction) - face_on + 0.003 * abs(abs(aside) - 48.0)

    asides = (48.0, -48.0, 70.0, -70.0, 110.0, -110.0, 135.0, -135.0)
    return towards(ahead + math.radians(min(asides, key=cost)), elevation)


def view_onto(pressing: Pressing, boxes: Boxes) -> Array:
    """From where to look at a surface: steeply enough to read what is drawn on it.

    The arm may hide some of it, the side of the tool be seen.
    """
    drawn = pressing.lap[:: max(1, len(pressing.lap) // 50)]
    centre = drawn.mean(axis=0)
    ahead = math.atan2(centre[1], centre[0])

    def cost(direction: Array) -> float:
        steep = float(direction @ pressing.normal)
        level = abs(float(direction[2]) - _STEEPNESS)
        return 2.0 * boxes.hidden(drawn, direction) + abs(steep - _STEEPNESS) + 0.5 * level

    directions = (
        towards(ahead + math.radians(aside), math.radians(elevation))
        for aside in (40, -40, 55, -55, 70, -70, 90, -90, 110, -110, 135, -135, 180, 0)
        for elevation in (36, 28, 20, 44, 52)
    )
    return min(directions, key=cost)


def near(pressing: Pressing, points: Array) -> Array:
    """Those of ``points``, shape (k, 3) [m], that can be seen while a drawing can be read."""
    drawn = pressing.lap
    middle = (drawn.min(axis=0) + drawn.max(axis=0)) / 2.0
    extent = 2.0 * float(np.linalg.norm(drawn - middle, axis=1).max())
    reach = max(extent / _DRAWING_SHARE / 2.0, _NEAREST)
    close = points[np.linalg.norm(points - middle, axis=1) < reach]
    return np.concatenate((close, drawn))


def _view_of_change(boxes: Boxes, point: Array, ahead: float) -> Array:
    """Where the first posture covers least of the last, and the arm does not hide the point."""
    first, last = boxes.posture(0), boxes.posture(boxes.postures - 1)
    size = float(np.ptp(boxes.corners, axis=0).max())

    def cost(direction: Array) -> float:
        # In front of it or behind it: the ray begins beyond both.
        covered = first.hidden(last.corners - 10.0 * size * direction, direction)
        # The point lies on the arm, which hides it if there is more of the arm in front.
        return covered + 0.3 * boxes.hidden(point + 0.04 * size * direction, direction)

    asides = np.radians(np.arange(-150.0, 151.0, 15.0))
    return min((towards(ahead + aside, math.radians(20.0)) for aside in asides), key=cost)


def towards(azimuth: float, elevation: float) -> Array:
    """A unit vector from the scene to a camera at these angles [rad], shape (3,)."""
    level = math.cos(elevation)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])


def aim_camera(meshcat: Meshcat, points: Array, path: Array, direction: Array) -> None:
    """Put the camera as near as it can be with all ``points`` in its view."""
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    depth = points @ direction
    half_height = math.tan(_FIELD_OF_VIEW / 2.0) / _MARGIN
    camera: Any = np.zeros(3)
    distance = -math.inf
    for axis, slope in ((right, half_height * _ASPECT), (up, half_height)):
        # Both edges of the view touch the outermost points.
        above = float((points @ axis + slope * depth).max())
        below = float((-points @ axis + slope * depth).max())
        camera += (above - below) / 2.0 * axis
        distance = max(distance, (above + below) / (2.0 * slope))
    camera += distance * direction
    # The view turns about a point at the path's distance.
    target: Any = camera - (distance - float((path @ direction).mean())) * direction
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", math.degrees(_FIELD_OF_VIEW))
    meshcat.SetCameraPose(camera, target)
