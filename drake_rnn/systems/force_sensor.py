"""A force sensor with noise, delay, a low-pass filter and failures."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydrake.systems.framework import Context, DiscreteValues

from ..errors import SimulationError
from ..inputs.fields import Delay, NonNegative, Positive, between, validated
from ..inputs.keys import Meaning
from .block import Block
from .lateness import late_samples
from .white_noise import WhiteNoise


@validated
class SensorSettings:
    """Imperfections of a force sensor."""

    noise: Annotated[
        NonNegative,
        between(0.0, 1e6),
        Meaning("Standard deviation of the normal noise on each sample.", unit="N"),
    ] = 0.0
    delay: Annotated[
        Delay,
        Meaning(
            "Delay of each sample beyond that of the sampling itself; a multiple of the period, "
            "at most 5 s because all delayed samples are stored.",
            unit="s",
        ),
    ] = 0.0
    low_pass: Annotated[
        Positive | None,
        Meaning(
            "Corner frequency of a first-order filter after the noise; None for none.",
            unit="Hz",
        ),
    ] = None
    failure: Annotated[
        Literal["nan", "frozen"] | None,
        Meaning(
            "Failure at ``fails_at``: ``nan``, which stops the run, or ``frozen`` at the last "
            "value.",
        ),
    ] = None
    fails_at: Annotated[NonNegative | None, Meaning("Time of the failure.", unit="s")] = None

    def __post_init__(self) -> None:
        if (self.failure is None) != (self.fails_at is None):
            raise ValueError("failure: must be given together with fails_at; give both or neither")


class ForceSensor(Block):
    """Sampled force sensor: from ``normal_force_true`` to ``normal_force``, shape (1,) [N].

    Args:
        settings: Imperfections of the sensor.
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
        SimulationError: During a simulation, if the output would not be finite.
    """

    def __init__(self, settings: SensorSettings, period: float, seed: int = 0) -> None:
        super().__init__()
        self._settings = settings
        self._period = period
        self._noise = WhiteNoise(1, seed, stream=2)
        late = late_samples("sensor.delay", settings.delay, period)
        # Share of the previous output that the low-pass filter keeps after one period.
        corner = settings.low_pass
        self._kept = 0.0 if corner is None else math.exp(-2.0 * math.pi * corner * period)
        self._measured = self.DeclareVectorInputPort("normal_force_true", 1)
        # Delayed samples, newest first, then the output.
        self.DeclareDiscreteState(late + 2)
        self.DeclareVectorOutputPort(
            "normal_force",
            1,
            lambda context, output: output.set_value(
                context.get_discrete_state_vector().value()[-1:]
            ),
            {self.xd_ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = context.get_discrete_state_vector().CopyToVector()
        number = round(context.get_time() / self._period)
        said = x[-1]
        x[1:-1] = x[:-2]
        x[0] = self._measured.Eval(context)[0] + self._error(number)
        x[-1] = self._kept * said + (1.0 - self._kept) * x[-2]
        broken = self._settings.fails_at
        if broken is not None and context.get_time() >= broken:
            x[-1] = said if self._settings.failure == "frozen" else math.nan
        if not math.isfinite(x[-1]):
            # A law that sees this could only report that its own state is not finite.
            raise SimulationError(
                f"{self.get_name()}: the force sensor reads {x[-1]}", context.get_time()
            )
        state.set_value(x)

    def _error(self, number: int) -> float:
        sigma = self._settings.noise
        return 0.0 if sigma == 0.0 else sigma * float(self._noise.sample(number)[0])
