"""From where the scene is seen: near, and with the path in view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Diagram

from ..fields import Array
from .replayed_motion import ReplayedMotion

_FIELD_OF_VIEW = math.radians(30.0)
_ASPECT = 1.5
_MARGIN = 1.08
POSTURES = 24


@dataclass(frozen=True)
class Boxes:
    """Boxes round the parts of the arm, posture by posture; b in all.

    Attributes:
        centre: Shape (b, 3) [m].
        axes: Their directions as columns, shape (b, 3, 3).
        half: Half their extents, shape (b, 3) [m].
    """

    centre: Array
    axes: Array
    half: Array

    @property
    def corners(self) -> Array:
        """Shape (8 b, 3) [m]."""
        signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)
        offsets = np.einsum("bij,kj,bj->bki", self.axes, signs, self.half)
        return np.asarray(self.centre[:, None] + offsets).reshape(-1, 3)

    def hidden(self, points: Array, direction: Array) -> float:
        """Share of ``points``, shape (k, 3), that something hides from that direction."""
        start = np.einsum("bij,bki->bkj", self.axes, points - self.centre[:, None])
        # Parallel to a face is as good as nearly so.
        ray = np.einsum("bij,i->bj", self.axes, direction)[:, None] + 1e-9
        one, other = (-self.half[:, None] - start) / ray, (self.half[:, None] - start) / ray
        enters = np.minimum(one, other).max(axis=2)
        leaves = np.maximum(one, other).min(axis=2)
        hit = (leaves >= np.maximum(enters, 0.0)).reshape(POSTURES, -1, len(points))
        return float(hit.any(axis=1).mean())


def boxes_of(
    motion: ReplayedMotion, diagram: Diagram, plant: MultibodyPlant, scene_graph: SceneGraph
) -> Boxes:
    """Boxes round the arm's parts at postures throughout the run."""
    inspector = scene_graph.model_inspector()
    arm = motion.result.experiment.setup.arm
    plant_context = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
    # An arm may have nothing to draw; where its bodies are it has.
    bodies = [plant.get_body(BodyIndex(k)) for k in range(plant.num_bodies())]
    parts: list[tuple[Any, ...]] = [(body, RigidTransform(), np.zeros(3)) for body in bodies]
    for frame in inspector.GetAllFrameIds():
        for geometry in inspector.GetGeometries(frame, Role.kIllustration):
            if (box := inspector.GetObbInGeometryFrame(geometry)) is not None:
                X_BG = inspector.GetPoseInFrame(geometry) @ box.pose()
                parts.append((plant.GetBodyFromFrameId(frame), X_BG, box.half_width()))
    centre, axes = [], []
    for k in np.linspace(0, len(motion.time) - 1, POSTURES).astype(int):
        posture: Any = arm.posture(plant, motion.position[k])
        plant.SetPositions(plant_context, posture)
        for body, X_BG, _ in parts:
            X_WG = plant.EvalBodyPoseInWorld(plant_context, body) @ X_BG
            centre.append(X_WG.translation())
            axes.append(X_WG.rotation().matrix())
    half = np.tile([half for *_, half in parts], (POSTURES, 1))
    return Boxes(np.array(centre), np.array(axes), half)


def view_direction(motion: ReplayedMotion, boxes: Boxes) -> Array:
    """From where to look, a unit vector from the scene to the camera.

    Best from ahead and aside, which shows the arm and a path in any upright plane, unless
    the arm hides the path from there; a path that lies flat is looked down upon.
    """
    lap = motion.lap[:: max(1, len(motion.lap) // 50)]
    centre = lap.mean(axis=0)
    normal = np.linalg.svd(lap - centre)[2][-1]
    if motion.result.experiment.task == "xy":
        return _towards(-math.pi / 2.0, math.radians(76.0))
    ahead = math.atan2(centre[1], centre[0])
    elevation = math.radians(16.0 + 16.0 * abs(normal[2]))

    def cost(aside: float) -> float:
        direction = _towards(ahead + math.radians(aside), elevation)
        face_on = min(abs(float(normal @ direction)), 0.7)
        return boxes.hidden(lap, direction) - face_on + 0.003 * abs(abs(aside) - 48.0)

    asides = (48.0, -48.0, 70.0, -70.0, 110.0, -110.0, 135.0, -135.0)
    return _towards(ahead + math.radians(min(asides, key=cost)), elevation)


def _towards(azimuth: float, elevation: float) -> Array:
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
