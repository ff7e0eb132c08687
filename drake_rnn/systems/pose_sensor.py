"""The end effector's pose as a camera or a tracker measures it from outside: noisy and late."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from ..robot.rotations import rotation_by
from ..robot.task import named_task
from .lateness import late_samples, sample_number
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise


class PoseSensor(LeafSystem):
    """Measurement of the task frame E from outside, once every period of the controller.

    Input is ``position_true``, shape (n,) [rad]: the pose is that of the true joints, whatever
    sensors say of them. Outputs, along the m position axes of the task, are ``p_WE``, shape (m,)
    [m], and, with ``secant_samples``, their difference quotient ``v_WE``, shape (m,) [m/s]; and
    ``R_WE``, the orientation, shape (3, 3), flattened. The measured one is exp(e) R_WE with a small
    rotation vector e in W.

    Delay, samples and what was before the first of them are those of a `JointSensor`, so that
    measurements of joints and pose are of one instant. The noise depends on seed and sample number
    alone, and is independent of that of the joints.

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
        super().__init__()
        self._period = period
        self._late = late_samples("sensing.delay", settings.delay, period)
        self._secant = settings.secant_samples
        self._p_noise, self._R_noise = settings.p_WE_noise or 0.0, settings.R_WE_noise or 0.0
        self._noise = WhiteNoise(6, seed, stream=4)
        self._kinematics, self._task = kinematics, named_task(task)
        self._axes = len(self._task.axes)
        position = self.DeclareVectorInputPort("position_true", np.size(start))
        self._read_q = position.Eval
        # Past measurements are rows of the state, newest first: position, then orientation.
        self._past_shape = (self._late + self._secant, self._axes + 9)
        if self._past_shape[0] > 0:
            at_start = np.concatenate((self._p_WE(start), kinematics.R_WE(start).ravel()))
            self.DeclareDiscreteState(np.tile(at_start, self._past_shape[0]))
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        measured = {self.xd_ticket(), self.time_ticket(), position.ticket()}
        self._declare("p_WE", self._axes, self._position, measured)
        self._declare("R_WE", 9, self._orientation, measured)
        if self._secant:
            self._declare("v_WE", self._axes, self._velocity, measured)

    def _declare(
        self, name: str, n: int, measure: Callable[[Context], Array], prerequisites: set[Any]
    ) -> None:
        self.DeclareVectorOutputPort(
            name, n, lambda context, output: output.set_value(measure(context)), prerequisites
        )

    def _update(self, context: Context, state: DiscreteValues) -> None:
        measured = np.concatenate((self._measured_p_WE(context), self._measured_R_WE(context)))
        state.set_value(np.vstack((measured, self._past(context)[:-1])).ravel())

    def _past(self, context: Context) -> Array:
        return context.get_discrete_state_vector().value().reshape(self._past_shape)

    def _position(self, context: Context) -> Array:
        if self._late == 0:
            return self._measured_p_WE(context)
        return self._past(context)[self._late - 1, : self._axes]

    def _orientation(self, context: Context) -> Array:
        if self._late == 0:
            return self._measured_R_WE(context)
        return self._past(context)[self._late - 1, self._axes :]

    def _velocity(self, context: Context) -> Array:
        before = self._past(context)[-1, : self._axes]
        return (self._position(context) - before) / (self._secant * self._period)

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

    def _sample(self, context: Context) -> Array:
        return self._noise.sample(sample_number(context.get_time(), self._period))
