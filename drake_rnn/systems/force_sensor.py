"""A force sensor as it is: noisy, late, slow, and sometimes broken."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import NonNegative, Positive, validated

_BLOCK = 1024


@validated
class SensorSettings:
    """What a force sensor does to what it measures.

    Args:
        noise: Standard deviation of normal noise at each sample [N].
        delay: Of each sample, beyond the one that sampling takes; a multiple of the period, at
            most 5 s, as all samples on their way are kept [s].
        low_pass: Corner frequency of a first-order filter behind the noise [Hz]; None for none.
        failure: How it breaks at ``fails_at``: ``nan``, which stops the run, or ``frozen`` at
            what it last said.
        fails_at: When [s].
    """

    noise: NonNegative = 0.0
    delay: Annotated[float, Field(strict=True, ge=0, le=5, allow_inf_nan=False)] = 0.0
    low_pass: Positive | None = None
    failure: Literal["nan", "frozen"] | None = None
    fails_at: NonNegative | None = None

    def __post_init__(self) -> None:
        if (self.failure is None) != (self.fails_at is None):
            raise ValueError("failure: goes with fails_at; give both or neither")


class ForceSensor(LeafSystem):
    """Samples ``normal_force_true``, shape (1,) [N], and says ``normal_force``, shape (1,) [N].

    Args:
        settings: What it does to it.
        period: Between two samples [s].
        seed: Of the noise.

    Raises:
        InvalidInputError: If the delay is no multiple of the period.
        SimulationError: While simulating, if it would have to say what is no number.
    """

    def __init__(self, settings: SensorSettings, period: float, seed: int = 0) -> None:
        super().__init__()
        self._settings = settings
        self._period = period
        self._seed = seed
        self._block = (-1, np.zeros(0))
        late = round(settings.delay / period)
        if abs(late * period - settings.delay) > 1e-6 * period:
            raise InvalidInputError(
                f"sensor.delay: must be a multiple of the period, {period:g} s, not "
                f"{settings.delay:g}"
            )
        # What low_pass leaves after one period of what was.
        corner = settings.low_pass
        self._kept = 0.0 if corner is None else math.exp(-2.0 * math.pi * corner * period)
        self._measured = self.DeclareVectorInputPort("normal_force_true", 1)
        # Samples on their way, the newest first; then what is said.
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
        x[0] = self._measured.Eval(context)[0] + self._noise(number)
        x[-1] = self._kept * said + (1.0 - self._kept) * x[-2]
        broken = self._settings.fails_at
        if broken is not None and context.get_time() >= broken:
            x[-1] = said if self._settings.failure == "frozen" else math.nan
        if not math.isfinite(x[-1]):
            # A law that has seen it could only say that its own state is none any more.
            raise SimulationError(
                f"{self.get_name()}: the force sensor says {x[-1]}", context.get_time()
            )
        state.set_value(x)

    def _noise(self, number: int) -> float:
        if self._settings.noise == 0.0:
            return 0.0
        block, row = divmod(number, _BLOCK)
        if self._block[0] != block:
            rng = np.random.default_rng([self._seed, 2, block])
            self._block = (block, rng.standard_normal(_BLOCK))
        return self._settings.noise * float(self._block[1][row])
