"""pink: tasks and limits over Pinocchio, a quadratic program for each sample."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pinocchio
from pink import Configuration, solve_ik
from pink.exceptions import NoSolutionFound
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask

from drake_rnn import Array
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, in_the_middle
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT, Task
from peer_schemes.urdf import without_shapes


class Pink(AimedScheme):
    """Frame task, posture task, and all three limits that pink has."""

    name = "pink"
    setting = "AccelerationLimit, daqp to 1e-11"
    follows_twists = True
    solver: ClassVar[dict[str, float]] = {"primal_tol": 1e-11, "dual_tol": 1e-11}
    _barriers: tuple[Any, ...] = ()

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        model = pinocchio.buildModelFromXML(without_shapes(task.arm))
        model.velocityLimit = task.limits.velocity.copy()
        model.lowerPositionLimit = task.limits.position_lower.copy()
        model.upperPositionLimit = task.limits.position_upper.copy()
        self._frame = task.arm.frame
        self._configuration = self._configured(model, task)
        self._frame_task = FrameTask(
            self._frame, position_cost=1.0, orientation_cost=LEVER if task.oriented else 0.0
        )
        posture = PostureTask(cost=np.sqrt(POSTURE_WEIGHT).item(), gain=POSTURE_RATE * task.period)
        posture.set_target(task.start)
        self._tasks = self._chosen(self._frame_task, posture)
        self._acceleration = AccelerationLimit(model, task.limits.acceleration)
        self._limits = (ConfigurationLimit(model), VelocityLimit(model), self._acceleration)

    def _configured(self, model: pinocchio.Model, task: Task) -> Configuration:
        return Configuration(model, model.createData(), task.start)

    def _chosen(self, frame: FrameTask, posture: PostureTask) -> tuple[Any, ...]:
        return frame, posture

    def pose(self, q: Array) -> tuple[Array, Array]:
        self._configuration.update(q)
        X_WE = self._configuration.get_transform_frame_to_world(self._frame)
        return X_WE.translation, X_WE.rotation

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        task = self.task
        # A free orientation has no cost; its target must not turn the error of the position.
        self._frame_task.set_target(pinocchio.SE3(aim.R_target, aim.p_target))
        self._acceleration.set_last_integration(v, task.period)
        try:
            return solve_ik(
                self._configuration,
                self._tasks,
                task.period,
                solver="daqp",
                limits=self._limits,
                barriers=self._barriers,
                safety_break=False,
                **self.solver,
            )
        except NoSolutionFound as error:
            raise NoSolutionError from error


class PinkByDefault(Pink):
    """The same with the solver's own tolerances."""

    name = "pink, default tolerance"
    setting = "AccelerationLimit, daqp"
    solver: ClassVar[dict[str, float]] = {}


class PinkWithoutPosture(Pink):
    """The same without a posture to return to."""

    name = "pink, no posture"
    setting = "the same, no posture task"

    def _chosen(self, frame: FrameTask, posture: PostureTask) -> tuple[Any, ...]:
        return (frame,)


SCHEMES = (Pink, in_the_middle(Pink), PinkByDefault, PinkWithoutPosture)
