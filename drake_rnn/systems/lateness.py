"""Time in whole samples: delays, the sample at a time, and sensors with a delay."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .block import Block
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise

Measure = Callable[[Context], Array]


def late_samples(key: str, delay: float, period: float) -> int:
    """Return the number of samples that a delay lasts.

    Args:
        key: Name of the delay, for the message.
        delay: The delay [s].
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
    """
    late = round(delay / period)
    if abs(late * period - delay) > 1e-6 * period:
        raise InvalidInputError(
            f"{key}: must be a multiple of the period, {period:g} s, not {delay:g}"
        )
    return late


def sample_number(time: float, period: float) -> int:
    """Return the number of the sample at a time, or of the next one after it.

    Args:
        time: The time [s].
        period: Sampling period [s].
    """
    # Times of samples carry rounding errors.
    return math.ceil(time / period - 1e-6)


class LateSensor(Block):
    """Base class of sensors that measure once every period, with a delay of whole samples.

    At the time of a sample the outputs are the measurements of that sample, or of the sample that
    lies the delay before; between two samples they are what the next sample would measure. Before
    the first sample the arm is assumed to have rested at its start.

    Args:
        settings: Imperfections of the measurement.
        period: Sampling period [s].
        noise: Normal noise, which depends on seed and sample number alone.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
    """

    def __init__(self, settings: SensingSettings, period: float, noise: WhiteNoise) -> None:
        super().__init__()
        self._period, self._noise = period, noise
        self._late = late_samples("sensing.delay", settings.delay, period)
        self._secant = settings.secant_samples
        self._kept = 0  # measurements of which past ones are a state

    def _declare(
        self, name: str, measure: Measure, first: Array, inputs: set[Any], rate: str | None = None
    ) -> None:
        """Declare the output of a measurement, and perhaps of its rate.

        Args:
            name: Name of the output.
            measure: Measurement of now, or of the next sample, shape (size,).
            first: Measurement before the first sample, shape (size,).
            inputs: Tickets of the inputs that are measured.
            rate: Name of the output of the difference quotient over ``secant_samples``; None for
                no such output.
        """
        number, rows = self._kept, self._late + (0 if rate is None else self._secant)
        if rows > 0:
            # Past measurements, newest first.
            self.DeclareDiscreteState(np.tile(first, rows))
            self._kept += 1

            def update(context: Context, state: DiscreteValues) -> None:
                newest, past = measure(context), context.get_discrete_state(number).value()
                state.set_value(number, np.concatenate((newest, past[: -newest.size])))

            self.DeclarePeriodicDiscreteUpdateEvent(self._period, 0.0, update)

        def past(context: Context) -> Array:
            return context.get_discrete_state(number).value().reshape(rows, -1)

        def late(context: Context) -> Array:
            return past(context)[self._late - 1] if self._late else measure(context)

        def quotient(context: Context) -> Array:
            return (late(context) - past(context)[-1]) / (self._secant * self._period)

        seen = {self.xd_ticket(), self.time_ticket(), *inputs}
        for output, told in ((name, late), (rate, quotient)):
            if output is not None:
                self.DeclareVectorOutputPort(
                    output, first.size, lambda c, out, told=told: out.set_value(told(c)), seen
                )

    def _sample(self, context: Context) -> Array:
        """Return the noise of the sample of now, or of the next one."""
        return self._noise.sample(sample_number(context.get_time(), self._period))
