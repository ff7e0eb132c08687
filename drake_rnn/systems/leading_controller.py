"""A sampled controller that tells beforehand what it is going to choose."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..laws.law import Law
from ..laws.safety import Safety
from .controllers import SampledController


class LeadingController(SampledController):
    """A controller whose choice at a sample another one may take into account at that sample.

    All updates at a time see what was before it; so its next state is an output port besides,
    ``next_state``, which depends on its inputs and is worked out once.

    Args and errors are those of `SampledController`.
    """

    def __init__(
        self, law: Law, period: float, seed: int = 0, safety: Safety | None = None
    ) -> None:
        super().__init__(law, period, seed, safety)

        def calc(context: Context, output: Any) -> None:
            x = self.state(context)
            # The state is NaN until it is initialized, and so is what follows.
            output.set_value(x if x[0] != x[0] else super(LeadingController, self)._next(context))

        size = self.reading.state.size
        self._read_next = self.DeclareVectorOutputPort("next_state", size, calc).Eval

    def _next(self, context: Context) -> Array:
        return self._read_next(context)
