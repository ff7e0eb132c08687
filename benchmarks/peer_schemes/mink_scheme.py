"""mink: tasks and limits over MuJoCo, a quadratic program for each sample."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
from mink.limits import Constraint, Limit

from drake_rnn import Array
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, in_the_middle
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT, Task
from peer_schemes.urdf import without_shapes

# MuJoCo fuses links without a joint of their own unless told not to, and the flange with them.
_COMPILER = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco></robot>'


class Mink(AimedScheme):
    """Frame task, posture task, limits of position and velocity: mink has none of acceleration."""

    name = "mink"
    setting = "VelocityLimit, daqp; no acceleration limit offered"
    follows_twists = True

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        model = self._compiled(without_shapes(task.arm).replace("</robot>", _COMPILER))
        joints = task.arm.joints
        model.jnt_range[:] = np.stack(
            (task.limits.position_lower, task.limits.position_upper), axis=1
        )
        self._configuration = mink.Configuration(model, task.start)
        self._frame = task.arm.frame
        self._frame_task = mink.FrameTask(
            self._frame, "body", position_cost=1.0, orientation_cost=LEVER * task.oriented
        )
        posture = mink.PostureTask(
            model, cost=np.sqrt(POSTURE_WEIGHT).item(), gain=POSTURE_RATE * task.period
        )
        posture.set_target(task.start)
        self._tasks = (self._frame_task, posture)
        velocity = dict(zip(joints, task.limits.velocity.tolist(), strict=True))
        self._limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocity)]

    def _compiled(self, urdf: str) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string(urdf)

    def pose(self, q: Array) -> tuple[Array, Array]:
        self._configuration.update(q)
        X_WE = self._configuration.get_transform_frame_to_world(self._frame, "body")
        return X_WE.translation(), X_WE.rotation().as_matrix()

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        task = self.task
        # At the present orientation mink's derivative ignores the rotation; any other free one
        # will do.
        same = not (task.oriented or self.in_the_middle)
        turned = mink.SO3.from_matrix(task.R_WE[0] if same else aim.R_target)
        self._frame_task.set_target(mink.SE3.from_rotation_and_translation(turned, aim.p_target))
        try:
            return mink.solve_ik(
                self._configuration,
                self._tasks,
                task.period,
                "daqp",
                limits=self._limits,
                primal_tol=1e-11,
                dual_tol=1e-11,
            )
        except mink.NoSolutionFound as error:
            raise NoSolutionError from error


class _AccelerationLimit(Limit):
    """A limit of the user's own: |v - last| <= a h."""

    def __init__(self, acceleration: Array) -> None:
        self._acceleration = acceleration
        self._G = np.vstack((np.eye(acceleration.size), -np.eye(acceleration.size)))
        self.last = np.zeros(acceleration.size)

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> Constraint:
        room, way = dt * dt * self._acceleration, dt * self.last
        return Constraint(G=self._G, h=np.concatenate((room + way, room - way)))


class MinkBounded(Mink):
    """The same with a limit of acceleration that the user adds."""

    name = "mink, own limit"
    setting = "the same and a Limit of the user's own for the acceleration"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._own = _AccelerationLimit(task.limits.acceleration)
        self._limits.append(self._own)

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        self._own.last = v
        return super().towards(aim, q, v)


SCHEMES = (Mink, MinkBounded, in_the_middle(MinkBounded))
