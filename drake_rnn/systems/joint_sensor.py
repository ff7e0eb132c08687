"""Joint positions and velocities as a robot measures them: noisy, in steps, and late."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..inputs.fields import Array
from ..robot.arm import Arm
from .lateness import late_samples, sample_number
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise


class JointSensor(LeafSystem):
    """Measurement of a body's joints, once every period of the controller that reads it.

    Inputs are ``position_true`` and ``velocity_true``, outputs ``position`` and ``velocity``, all
    of shape (n,) [rad, rad/s]. At the time of a sample the outputs are those of that sample, or of
    the one before by the delay; between two samples they are what the next one would say. Before
    the first sample the arm is taken to have stood at its start.

    Noise acts before the steps of the encoder. It depends on seed and sample number alone.

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
        super().__init__()
        self._period = period
        self._late = late_samples("sensing.delay", settings.delay, period)
        self._step = settings.step_of(arm)
        sigma = settings.position_noise_of(arm)
        self._sigma = sigma if sigma.any() else None
        self._noise = WhiteNoise(arm.n, seed, stream=3)
        self._secant = settings.secant_samples
        position = self.DeclareVectorInputPort("position_true", arm.n)
        velocity = self.DeclareVectorInputPort("velocity_true", arm.n)
        self._read_q, self._read_v = position.Eval, velocity.Eval
        # Past measurements are rows of the state, newest first: positions, then velocities. A
        # robot's own velocity is only as late as positions are.
        self._position_rows = self._late + self._secant
        self._past_shape = (self._position_rows + (0 if self._secant else self._late), arm.n)
        if self._position_rows > 0:
            rows = np.zeros(self._past_shape)
            rows[: self._position_rows] = self._stepped(np.asarray(start))
            self.DeclareDiscreteState(rows.ravel())
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        at_q, at_v = position.ticket(), velocity.ticket()
        of_q = {self.xd_ticket(), self.time_ticket(), at_q}
        self._declare("position", arm.n, self._position, of_q)
        self._declare("velocity", arm.n, self._velocity, {at_v, *of_q})

    def _declare(
        self, name: str, n: int, measure: Callable[[Context], Array], prerequisites: set[Any]
    ) -> None:
        self.DeclareVectorOutputPort(
            name, n, lambda context, output: output.set_value(measure(context)), prerequisites
        )

    def _update(self, context: Context, state: DiscreteValues) -> None:
        past = self._past(context)
        newer = np.empty_like(past)
        newer[1:] = past[:-1]
        newer[0] = self._measured(context)
        if self._position_rows < len(newer):
            newer[self._position_rows] = self._read_v(context)
        state.set_value(newer.ravel())

    def _past(self, context: Context) -> Array:
        return context.get_discrete_state_vector().value().reshape(self._past_shape)

    def _position(self, context: Context) -> Array:
        if self._late == 0:
            return self._measured(context)
        return self._past(context)[self._late - 1]

    def _velocity(self, context: Context) -> Array:
        if self._secant:
            before = self._past(context)[self._position_rows - 1]
            return (self._position(context) - before) / (self._secant * self._period)
        return self._past(context)[-1] if self._late else self._read_v(context)

    def _measured(self, context: Context) -> Array:
        """Return the measurement of now, or of the next sample, shape (n,) [rad]."""
        q = self._read_q(context)
        if self._sigma is not None:
            number = sample_number(context.get_time(), self._period)
            q = q + self._sigma * self._noise.sample(number)
        return self._stepped(q)

    def _stepped(self, q: Array) -> Array:
        return q if self._step is None else np.round(q / self._step) * self._step
