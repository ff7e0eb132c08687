"""The end effector's pose as a camera or a tracker measures it from outside: noisy and late."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from ..robot.rotation import rotation_by
from ..robot.task import named_task
from .lateness import LateSensor
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise


def pose_noise(seed: int) -> WhiteNoise:
    """Return the noise of a pose, of standard deviation 1: three of position, three of rotation.

    Args:
        seed: Seed of the experiment.
    """
    return WhiteNoise(6, seed, stream=4)


class PoseSensor(LateSensor):
    """Measurement of the task frame E from outside, once every period of the controller.

    Input is ``position_true``, shape (n,) [rad]: the pose is that of the true joints, not of
    the measured ones. Outputs, along the m position axes of the task, are ``p_WE``, shape (m,)
    [m], and, with ``secant_samples``, their difference quotient ``v_WE``, shape (m,) [m/s]; and
    ``R_WE``, the orientation, shape (3, 3), flattened. The measured one is exp(e) R_WE with a small
    rotation vector e in W.

    Delay and samples are those of a `JointSensor`, so that measurements of joints and pose are of
    one instant; the noise is independent of that of the joints.

    Args:
        settings: Imperfections of the measurement.
        kinematics: Kinematics of the arm.
        task: A key of `drake_rnn.robot.task.TASKS`.
        start: Start posture, shape (n,) [rad].
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period, or there is no such task.
    """

    def __init__(
        self,
        settings: SensingSettings,
        kinematics: ArmKinematics,
        task: str,
        start: Array,
        period: float,
        seed: int = 0,
    ) -> None:
        super().__init__(settings, period, pose_noise(seed))
        self._p_noise, self._R_noise = settings.p_WE_noise or 0.0, settings.R_WE_noise or 0.0
        self._kinematics, self._task = kinematics, named_task(task)
        position = self.DeclareVectorInputPort("position_true", np.size(start))
        self._read_q, at_q = position.Eval, {position.ticket()}
        rate = "v_WE" if settings.secant_samples else None
        self._declare("p_WE", self._measured_p_WE, self._p_WE(start), at_q, rate)
        self._declare("R_WE", self._measured_R_WE, kinematics.R_WE(start).ravel(), at_q)

    def _p_WE(self, q: Array) -> Array:
        return self._task.position(self._kinematics.p_WE(q))

    def _measured_p_WE(self, context: Context) -> Array:
        """Return the position measured now, or at the next sample, shape (m,) [m]."""
        p_WE = self._p_WE(self._read_q(context))
        if self._p_noise == 0.0:
            return p_WE
        return p_WE + self._p_noise * self._task.position(self._sample(context)[:3])

    def _measured_R_WE(self, context: Context) -> Array:
        """Return the orientation measured now, or at the next sample, shape (9,)."""
        R_WE = self._kinematics.R_WE(self._read_q(context))
        if self._R_noise:
            R_WE = rotation_by(self._R_noise * self._sample(context)[3:]) @ R_WE
        return np.ravel(R_WE)
