"""Boxes round the parts of the arm, which tell what the arm hides from a camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from ..inputs.fields import Array
from .drawn_arm import DrawnArm
from .replay import ReplayedMotion

# Number of postures of a run that get boxes.
_POSTURES = 24


@dataclass(frozen=True)
class Boxes:
    """Boxes round the parts of the arm in several postures; b boxes in all.

    Attributes:
        centre: Centres, shape (b, 3) [m].
        axes: Directions of the edges as columns, shape (b, 3, 3).
        half: Half the extents, shape (b, 3) [m].
        postures: Number of postures, each with the same number of boxes.
    """

    centre: Array
    axes: Array
    half: Array
    postures: int

    @property
    def corners(self) -> Array:
        """Corners of all boxes, shape (8 b, 3) [m]."""
        signs = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)
        offsets = np.einsum("bij,kj,bj->bki", self.axes, signs, self.half)
        return np.asarray(self.centre[:, None] + offsets).reshape(-1, 3)

    def posture(self, number: int) -> Boxes:
        """Return the boxes of one posture; -1 is the last."""
        number %= self.postures
        count = len(self.centre) // self.postures
        one = slice(number * count, (number + 1) * count)
        return Boxes(self.centre[one], self.axes[one], self.half[one], 1)

    def hidden(self, points: Array, direction: Array) -> float:
        """Return the share of points that boxes hide, averaged over the postures.

        Args:
            points: Shape (k, 3) [m].
            direction: Unit vector towards the camera, shape (3,).
        """
        enters = np.zeros((len(self.centre), len(points)))
        leaves = np.full_like(enters, np.inf)
        for axis, half in zip(np.moveaxis(self.axes, 2, 0), self.half.T, strict=True):
            # The offset avoids a division by zero for a ray parallel to a face.
            ray = (axis @ direction + 1e-9)[:, None]
            start = axis @ points.T - (axis * self.centre).sum(axis=1)[:, None]
            middle, reach = -start / ray, half[:, None] / np.abs(ray)
            np.maximum(enters, middle - reach, out=enters)
            np.minimum(leaves, middle + reach, out=leaves)
        hit = (leaves >= enters).reshape(self.postures, -1, len(points))
        return float(hit.any(axis=1).mean())


def boxes_of(motion: ReplayedMotion, drawn: DrawnArm) -> Boxes:
    """Return boxes at postures throughout a run and, last, at its target posture if it has one."""
    # A box without extent per body: an arm may have no geometry at all.
    parts: list[tuple[Any, ...]] = [(body, RigidTransform(), np.zeros(3)) for body in drawn.bodies]
    for body, geometry in drawn.geometries():
        if (box := drawn.inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_BG = drawn.inspector.GetPoseInFrame(geometry) @ box.pose()
            parts.append((body, X_BG, box.half_width()))
    postures = list(motion.position[np.linspace(0, len(motion.time) - 1, _POSTURES).astype(int)])
    if (target := motion.result.experiment.target) is not None:
        postures.append(target)
    centre, axes = [], []
    for q in postures:
        drawn.set_posture(q)
        for body, X_BG, _ in parts:
            X_WG = drawn.X_WB(body) @ X_BG
            centre.append(X_WG.translation())
            axes.append(X_WG.rotation().matrix())
    half = np.tile([half for *_, half in parts], (len(postures), 1))
    return Boxes(np.array(centre), np.array(axes), half, len(postures))
