"""A sampled controller whose law is a parameter: its gains may change between two samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..laws.called import unchecked
from ..laws.law import Law, SampledReading
from ..laws.safety import Safety
from .controllers import SampledController, read_sampled


class TunableController(SampledController):
    """A `SampledController` whose law can be replaced by one with other numbers.

    The law is a parameter of the context, so a simulation can be given other gains while it runs.

    Args:
        law: The law to begin with.
        period: Sampling period [s].
        seed: Seed of the law's random initial state.
        safety: What is kept of the law's command; None to take it as it is.
    """

    def __init__(
        self, law: Law, period: float, seed: int = 0, safety: Safety | None = None
    ) -> None:
        super().__init__(law, period, seed, safety)
        self.safety = safety
        value = AbstractValue.Make(_Held(self.reading))
        self._parameter = self.DeclareAbstractParameter(value)

    def read(self, law: Law) -> SampledReading:
        """Return the reading of a law that can take the place of this one's.

        Raises:
            InvalidInputError: If it cannot be sampled at this period, or has another state or other
                inputs.
        """
        reading = read_sampled(law, self.period, self.safety)
        mine, other = self.reading, reading
        if (mine.state.parts, mine.inputs.parts) != (other.state.parts, other.inputs.parts):
            raise InvalidInputError(
                f"{type(law).__name__}: must have the state and the inputs of the law that runs"
            )
        return reading

    def set_reading(self, context: Context, reading: SampledReading) -> None:
        """Run another reading from the next sample on, one that `read` has returned."""
        value = AbstractValue.Make(_Held(reading))
        context.get_mutable_abstract_parameter(self._parameter).SetFrom(value)

    def reading_in(self, context: Context) -> SampledReading:
        """Return the reading that runs."""
        return self._held_in(context).reading

    def _held_in(self, context: Context) -> _Held:
        held: _Held = context.get_abstract_parameter(self._parameter).get_value()
        return held

    def _stepping(self, context: Context) -> Any:
        return self._held_in(context).step


@dataclass(frozen=True, eq=False)
class _Held:
    """A reading, which never changes and so is shared by contexts that are copied."""

    reading: SampledReading

    @cached_property
    def step(self) -> Any:
        return unchecked(self.reading.step)

    def __copy__(self) -> _Held:
        return self

    def __deepcopy__(self, known: Any) -> _Held:
        return self
