"""Cameras that see points of the tool, drawn in the scene, and when one is swapped for another."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatAnimation, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..features.camera import ToolCamera
from ..inputs.fields import Array
from .animation import move
from .replay import ReplayedMotion

# Ball of a point, edges of a camera's body, and length and radius of its lens [m].
_RADIUS, _BODY, _LENS = 0.012, (0.08, 0.06, 0.08), (0.06, 0.04)


def swaps_of(motion: ReplayedMotion) -> list[dict[str, Any]]:
    """Return when cameras are swapped [s, since the first sample], with a name for the chart."""
    camera = motion.result.experiment.document.camera
    begin = float(motion.result.time[0])
    swaps = () if camera is None else camera.swaps
    return [{"time": swap.time - begin, "name": "another camera"} for swap in swaps]


class Cameras:
    """The camera that sees and the points that it sees, below "/cameras" in the scene.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion of the arm.
    """

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion) -> None:
        self._motion = motion
        self._camera = motion.result.experiment.document.camera
        self._swaps = [mark["time"] for mark in swaps_of(motion)]
        if self._camera is not None:
            _draw(meshcat, self._camera)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record where the points are in the frames, and which camera is seen.

        Args:
            recording: The animation.
            time: Time of each frame since the first sample, shape (f,) [s].
        """
        if self._camera is None:
            return
        postures = self._motion.at(time, self._motion.position)
        placed = np.array([self._points(q) for q in postures])
        for number in range(placed.shape[1]):
            move(recording, f"/cameras/point{number}", placed[:, number])
        frames = [int(np.searchsorted(time, swap - 1e-9)) for swap in self._swaps]
        for number, (begin, end) in enumerate(zip([0, *frames], [*frames, time.size], strict=True)):
            place = f"/cameras/{number}"
            recording.SetProperty(0, place, "visible", begin == 0)
            if begin > 0:
                recording.SetProperty(begin, place, "visible", True)
            if end < time.size:
                recording.SetProperty(end, place, "visible", False)

    def _points(self, q: Array) -> Array:
        """Return where the points are in a posture, shape (points, 3) [m]."""
        assert self._camera is not None
        kinematics = self._motion.result.experiment.arm.kinematics()
        return self._camera.placed(kinematics.p_WE(q), kinematics.R_WE(q))


def _draw(meshcat: Meshcat, camera: ToolCamera) -> None:
    dark = Rgba(*colours.components(colours.ARM_DARK))
    for number in range(len(camera.points)):
        ball = Rgba(*colours.components(colours.TRACED))
        meshcat.SetObject(f"/cameras/point{number}", Sphere(_RADIUS), ball)
    length, radius = _LENS
    for number, each in enumerate(camera.cameras):
        place = f"/cameras/{number}"
        # The body lies behind the lens, whose cone opens the way that it looks.
        behind = RigidTransform([0.0, 0.0, -0.5 * _BODY[2] - length])
        meshcat.SetObject(f"{place}/body", Box(*_BODY), dark)
        meshcat.SetTransform(f"{place}/body", behind)
        cone = MeshcatCone(length, radius, radius)
        meshcat.SetObject(f"{place}/lens", cone, dark)
        meshcat.SetTransform(f"{place}/lens", RigidTransform([0.0, 0.0, -length]))
        pose = RigidTransform(RotationMatrix(each.R_WC), each.position)
        meshcat.SetTransform(place, pose)
        meshcat.SetProperty(place, "visible", number == 0)
