"""Items of a scene: obstacles, capsules, a second arm, locked joints and cameras.

Obstacles in the arm's way, drawn in the scene.

The capsules of an arm, from which its distances are measured: translucent, and hidden at first.

Each moves with a body that is drawn, because it is below that body in the scene: the animation has
no more tracks than without them.

- A second arm in the scene, where it stands beside the first one.
- Joints that lock, marked in the scene from then on, and in the chart.
- Cameras that see points of the tool, drawn in the scene, and when one is swapped for another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Meshcat,
    MeshcatAnimation,
    MeshcatCone,
    Rgba,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..experiment import Experiment
from ..features.camera import ToolCamera
from ..inputs.fields import Array
from ..robot.clearance import Clearance
from ..robot.clearance.obstacles import (
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    HalfSpaceObstacle,
    Obstacle,
)
from .animation import move
from .arm_drawing import DrawnArm
from .replay import ReplayedMotion, replayed_motion
from .viewpoint import boxes_of

_SOLID = Rgba(*colours.components(colours.SURFACE))
# Of a half-space, which would hide what is behind it: a sheet of this size and thickness [m].
_SHEET = Rgba(*colours.components(colours.SURFACE), 0.4)
_SIZE, _THICKNESS = 1.6, 0.004


def draw_obstacles(meshcat: Meshcat, obstacles: Sequence[Obstacle]) -> None:
    """Draw obstacles below "/obstacles"; of a half-space, a part of its plane near the base."""
    for k, obstacle in enumerate(obstacles):
        shape, pose = _drawn(obstacle)
        place = f"/obstacles/{k}"
        sheet = isinstance(obstacle, HalfSpaceObstacle)
        meshcat.SetObject(place, shape, _SHEET if sheet else _SOLID)
        meshcat.SetTransform(place, pose)


def corners_of_obstacles(experiment: Experiment) -> Array:
    """Return corners of boxes round all obstacles, where they begin, shape (k, 3) [m]."""
    return np.concatenate([np.zeros((0, 3)), *(each.corners for each in experiment.obstacles)])


def record_obstacles(recording: MeshcatAnimation, experiment: Experiment, times: Array) -> None:
    """Record how obstacles move; ``times`` of the frames since the start of the run, shape (f,)."""
    if experiment.motions is None or experiment.clearance is None:
        return
    solids = experiment.clearance.solids
    numbers = {obstacle.name: k for k, obstacle in enumerate(experiment.obstacles)}
    p_WO = experiment.motions.along(times)
    for m, k in enumerate(solids.moving):
        number = numbers[solids.names[k]]
        _, pose = _drawn(experiment.obstacles[number])
        move(recording, f"/obstacles/{number}", pose.translation() + p_WO[:, m])


def pose_of(obstacle: Obstacle) -> RigidTransform:
    """Return the pose at which an obstacle is drawn, where it begins."""
    return _drawn(obstacle)[1]


def _drawn(obstacle: Obstacle) -> tuple[Shape, RigidTransform]:
    """Return an obstacle's shape and pose."""
    if isinstance(obstacle, BallObstacle):
        return Sphere(obstacle.radius), RigidTransform(obstacle.center)
    if isinstance(obstacle, BoxObstacle):
        return Box(obstacle.size), RigidTransform(RotationMatrix(obstacle.R_WO), obstacle.center)
    if isinstance(obstacle, CapsuleObstacle):
        return capsule_between(*obstacle.ends, obstacle.radius)
    if isinstance(obstacle, HalfSpaceObstacle):
        n = obstacle.normal_W
        middle = n.dot(obstacle.point) * n - 0.5 * _THICKNESS * n
        R = RotationMatrix.MakeFromOneVector(n, 2)
        return Box(_SIZE, _SIZE, _THICKNESS), RigidTransform(R, middle)
    raise TypeError(f"no drawing of a {type(obstacle).__name__}")


def capsule_between(one: Array, other: Array, radius: float) -> tuple[Shape, RigidTransform]:
    """Return the capsule round a segment, a ball if its ends are one, and its pose.

    Args:
        one: One end of the segment, shape (3,) [m].
        other: The other end, shape (3,) [m].
        radius: Radius [m].
    """
    length = float(np.linalg.norm(other - one))
    if length < 1e-6:
        return Sphere(radius), RigidTransform(one)
    R = RotationMatrix.MakeFromOneVector((other - one) / length, 2)
    return Capsule(radius, length), RigidTransform(R, 0.5 * (one + other))


_OPACITY = 0.45
# A first layer fills the depth buffer and leaves no colour: where capsules overlap, only the
# nearest one is seen.
_LAYERS = (
    ("depth", 1.0, {"material.colorWrite": False, "renderOrder": 2.0}),
    ("tint", _OPACITY, {"renderOrder": 3.0}),
)


def draw_capsules(
    meshcat: Meshcat,
    drawn: DrawnArm,
    clearance: Clearance | None,
    X_WB: RigidTransform | None = None,
) -> list[str]:
    """Draw the capsules of an arm, hidden.

    Args:
        meshcat: Meshcat with the scene.
        drawn: The arm in the scene.
        clearance: What the arm is to stay clear of, with its capsules; None if nothing is.
        X_WB: Pose of the arm's base among the capsules; by default it stands at the origin.

    Returns:
        Scene paths of the capsules. Those of links of which nothing is drawn are left out.
    """
    if clearance is None:
        return []
    arm, places = clearance.arm, list[str]()
    drawn.set_posture(np.zeros(drawn.arm.n))
    X_BW = RigidTransform() if X_WB is None else X_WB.inverse()
    # Those of an arm beside it come behind its own.
    own = list(zip(arm.bodies, arm.ends, arm.radii, strict=True))[: clearance.alone]
    for k, (name, ends, radius) in enumerate(own):
        if (carrier := drawn.carrier(name)) is None:
            continue
        place = f"{drawn.place(carrier)}/capsules/{k}"
        shape, X_WC = capsule_between(ends[0], ends[1], float(radius))
        meshcat.SetTransform(place, drawn.X_WB(carrier).inverse() @ X_BW @ X_WC)
        for layer, opacity, look in _LAYERS:
            rgba = Rgba(*colours.components(colours.CAPSULE), opacity)
            meshcat.SetObject(f"{place}/{layer}", shape, rgba)
            for key, value in {"castShadow": False, **look}.items():
                meshcat.SetProperty(f"{place}/{layer}/<object>", key, value)
        meshcat.SetProperty(place, "visible", False)
        places.append(place)
    return places


_PLACE = "/second"


def second_motion(motion: ReplayedMotion) -> ReplayedMotion | None:
    """Return the motion of a run's second arm, in the base frame of the first; None without one."""
    second, base = motion.result.second, motion.result.experiment.base
    if second is None or base is None:
        return None
    own = replayed_motion(second)
    R, p = base.R, base.translation
    traced, desired, course = (each @ R.T + p for each in (own.traced, own.desired, own.course))
    return replace(own, traced=traced, desired=desired, course=course)


class SecondArm:
    """The second arm below "/second" in the scene.

    Args:
        meshcat: Meshcat with the scene.
        motion: The motion of the arm.
        X_WB: Pose of its base.
    """

    def __init__(self, meshcat: Meshcat, motion: ReplayedMotion, X_WB: RigidTransform) -> None:
        self.motion = motion
        self._X_WB = X_WB
        self._meshcat = meshcat
        self._drawn = DrawnArm(motion.result.experiment.arm, meshcat, f"{_PLACE}/arm")
        meshcat.SetTransform(_PLACE, X_WB)

    @property
    def corners(self) -> Array:
        """Corners of boxes round it in several postures, shape (k, 3) [m]."""
        corners = boxes_of(self.motion, self._drawn).corners
        return np.asarray(corners @ self._X_WB.rotation().matrix().T + self._X_WB.translation())

    def draw_capsules(self) -> list[str]:
        """Draw its capsules, hidden; return their scene paths."""
        clearance = self.motion.result.experiment.clearance
        return draw_capsules(self._meshcat, self._drawn, clearance, self._X_WB)

    def record(self, time: Array, rate: int) -> None:
        """Draw it at the time of each frame, shape (f,) [s], while the scene records."""
        for frame, q in enumerate(self.motion.at(time, self.motion.position)):
            self._drawn.draw(q, (frame + 0.5) / rate)


def second_arm(meshcat: Meshcat, motion: ReplayedMotion) -> SecondArm | None:
    """Draw the second arm of a run; None without one."""
    base, second = motion.result.experiment.base, second_motion(motion)
    if base is None or second is None:
        return None
    X_WB = RigidTransform(RotationMatrix(base.R), base.translation)
    return SecondArm(meshcat, second, X_WB)


# A ball that the arm's links show through [m].
_MARK_RADIUS, _MARK_OPACITY = 0.09, 0.6


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
            ball = Rgba(*colours.components(colours.BOUND), _MARK_OPACITY)
            meshcat.SetObject(_place(joint), Sphere(_MARK_RADIUS), ball)
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
