"""RoboPlan's OInK: tasks and constraints over Pinocchio in C++, a quadratic program a sample."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import (
    AccelerationLimit,
    Barrier,
    ConfigurationTask,
    ConfigurationTaskOptions,
    FrameTask,
    FrameTaskOptions,
    Oink,
    OinkSettings,
    PositionLimit,
    VelocityLimit,
)

from drake_rnn import Array
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, in_the_middle
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT, Task
from peer_schemes.urdf import without_shapes

# Costs are squared weights. ProxQP's tolerance is absolute: with costs as large as these it finds
# all solutions to 1e-12, with those of the other libraries one in two hundred not.
_SCALE = 1e4


class OInK(AimedScheme):
    """Frame and configuration task, and all three limits that OInK has."""

    name = "OInK"
    scale: ClassVar[float] = _SCALE
    setting = "AccelerationLimit, ProxQP to 1e-12, costs times 1e4"
    solver: ClassVar[dict[str, float]] = {"eps_abs": 1e-12}

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._scene, self._frame = self._read(task), task.arm.frame
        settings = OinkSettings()
        for name, value in self.solver.items():
            setattr(settings, name, value)
        self._oink = oink = Oink(self._scene, settings)
        self._X_target = np.asfortranarray(np.eye(4))
        target = CartesianConfiguration()
        target.tip_frame, target.tform = self._frame, self._X_target
        self._frame_task = FrameTask(
            oink, self._scene, target,
            FrameTaskOptions(
                position_cost=self.scale, orientation_cost=self.scale * LEVER**2 * task.oriented
            ),
        )  # fmt: skip
        posture = ConfigurationTask(
            oink, task.start, np.full(task.arm.n, self.scale * POSTURE_WEIGHT),
            ConfigurationTaskOptions(task_gain=POSTURE_RATE * task.period),
        )  # fmt: skip
        self._tasks = [self._frame_task, posture]
        # Limits of the position are those of the URDF.
        velocity = VelocityLimit(oink, task.period, task.limits.velocity)
        self._acceleration = AccelerationLimit(oink, task.period, task.limits.acceleration)
        self._limits = [PositionLimit(oink), velocity, self._acceleration]
        self._barriers: list[Barrier] = []
        self._way = np.zeros(task.arm.n)

    def _read(self, task: Task) -> Scene:
        return Scene("arm", loadUrdfSceneDescriptionFromXml(without_shapes(task.arm)))

    def pose(self, q: Array) -> tuple[Array, Array]:
        X_WE = self._scene.forwardKinematics(q, self._frame)
        return X_WE[:3, 3], X_WE[:3, :3]

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        self._scene.setJointPositions(aim.q)
        self._X_target[:3, :3], self._X_target[:3, 3] = aim.R_target, aim.p_target
        self._frame_task.setTargetFrameTransform(self._X_target)
        self._acceleration.setLastVelocity(v)
        try:
            self._oink.solveIk(self._scene, self._tasks, self._limits, self._barriers, self._way)
        except RuntimeError as error:
            raise NoSolutionError from error
        return self._way / self.task.period


class OInKByDefault(OInK):
    """The same with the solver's own tolerances."""

    name = "OInK, default tolerance"
    setting = "AccelerationLimit, ProxQP"
    scale: ClassVar[float] = 1.0
    solver: ClassVar[dict[str, float]] = {}


SCHEMES = (OInK, in_the_middle(OInK), OInKByDefault)
