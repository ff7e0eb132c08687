"""Joint positions and velocities as a robot measures them: noisy, in steps, and late."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..robot.arm import Arm
from .lateness import LateSensor
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise


class JointSensor(LateSensor):
    """Measurement of a body's joints, once every period of the controller that reads it.

    Inputs are ``position_true`` and ``velocity_true``, outputs ``position`` and ``velocity``, all
    of shape (n,) [rad, rad/s]. `LateSensor` explains their times. The noise is added before the
    encoder rounds to its steps. The robot's own velocity has the same delay as the positions.

    Args:
        settings: Imperfections of the measurement.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period, or the settings do not fit
            the arm.
    """

    def __init__(
        self, settings: SensingSettings, arm: Arm, start: Array, period: float, seed: int = 0
    ) -> None:
        super().__init__(settings, period, WhiteNoise(arm.n, seed, stream=3))
        self._step = settings.step_of(arm)
        sigma = arm.each("sensing.position_noise", settings.position_noise)
        self._sigma = sigma if sigma.any() else None
        position = self.DeclareVectorInputPort("position_true", arm.n)
        velocity = self.DeclareVectorInputPort("velocity_true", arm.n)
        self._read_q = position.Eval
        first, at_q = self._stepped(np.asarray(start)), {position.ticket()}
        if settings.secant_samples:
            self._declare("position", self._measured, first, at_q, "velocity")
        else:
            self._declare("position", self._measured, first, at_q)
            self._declare("velocity", velocity.Eval, np.zeros(arm.n), {velocity.ticket()})

    def _measured(self, context: Context) -> Array:
        """Return the measurement of now, or of the next sample, shape (n,) [rad]."""
        q = self._read_q(context)
        if self._sigma is not None:
            q = q + self._sigma * self._sample(context)
        return self._stepped(q)

    def _stepped(self, q: Array) -> Array:
        return q if self._step is None else np.round(q / self._step) * self._step
