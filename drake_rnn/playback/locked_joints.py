"""Joints that lock, marked in the scene from then on, and in the chart."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba, Sphere

from .. import colours
from ..inputs.fields import Array
from .animation import move
from .drawn_arm import DrawnArm
from .replay import ReplayedMotion

# A ball that the arm's links show through [m].
_RADIUS, _OPACITY = 0.09, 0.6


def marks_of(motion: ReplayedMotion) -> list[dict[str, Any]]:
    """Return when something happens to the arm [s, since the first sample], and what."""
    begin = float(motion.result.time[0])
    return [{"time": time - begin, "name": name} for time, name in motion.result.experiment.moments]


class LockedJoints:
    """A ball round each joint that has locked, below "/locked" in the scene.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion of the arm.
        drawn: The arm in the scene.
    """

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion, drawn: DrawnArm) -> None:
        locks = motion.result.experiment.locks
        self._motion, self._drawn = motion, drawn
        self._joints = [] if locks is None else locks.joints
        self._times = [mark["time"] for mark in marks_of(motion)]
        for joint in self._joints:
            ball = Rgba(*colours.components(colours.BOUND), _OPACITY)
            meshcat.SetObject(_place(joint), Sphere(_RADIUS), ball)
            meshcat.SetProperty(_place(joint), "visible", False)

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record where the balls are in the frames, and from which one on they are seen.

        Args:
            recording: The animation.
            time: Time of each frame since the first sample, shape (f,) [s].
        """
        if not self._joints:
            return
        points = np.array([self._points(q) for q in self._motion.at(time, self._motion.position)])
        for number, (joint, locks) in enumerate(zip(self._joints, self._times, strict=True)):
            move(recording, _place(joint), points[:, number])
            seen = int(np.searchsorted(time, locks - 1e-9))
            recording.SetProperty(0, _place(joint), "visible", seen == 0)
            if 0 < seen < time.size:
                recording.SetProperty(seen, _place(joint), "visible", True)

    def _points(self, q: Array) -> list[Array]:
        """Return where the joints that lock are in a posture, shape (3,) each [m]."""
        self._drawn.set_posture(q)
        plant, names = self._drawn.plant, self._drawn.arm.joints
        bodies = [plant.GetJointByName(names[joint]).child_body() for joint in self._joints]
        return [self._drawn.X_WB(body).translation() for body in bodies]


def _place(joint: int) -> str:
    return f"/locked/{joint}"
