"""Stops a run whose force sensor is broken."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..errors import SimulationError


class ForceWatch(LeafSystem):
    """Watches ``normal_force``, shape (1,) [N], and has no outputs.

    Args:
        period: Between two looks [s].
        patience: A force that is not zero and the same to the last bit for so long is that of
            a sensor that is stuck [s].

    Raises:
        SimulationError: While simulating, if the force is not a number or stuck.
    """

    def __init__(self, period: float, patience: float = 0.1) -> None:
        super().__init__()
        self._period = period
        self._patience = patience
        self._measured = self.DeclareVectorInputPort("normal_force", 1)
        # What was seen last [N], and since when [s].
        self.DeclareDiscreteState(np.zeros(2))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        t, force = context.get_time(), float(self._measured.Eval(context)[0])
        if not math.isfinite(force):
            raise SimulationError(f"{self.get_name()}: the force sensor says {force}", t)
        last, since = context.get_discrete_state_vector().CopyToVector().tolist()
        if force != last or force == 0.0:
            state.set_value(np.array([force, t]))
        elif t - since > self._patience:
            raise SimulationError(
                f"{self.get_name()}: the force sensor is stuck at {force:.6g} N since "
                f"t = {since:.4g} s",
                t,
            )
