"""Stops a run whose force sensor is stuck."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..errors import SimulationError

# An arm that has moved by less [rad] may well feel the same force.
_AT_REST = 1e-9


class ForceWatch(LeafSystem):
    """Watches ``normal_force``, shape (1,) [N], and has no outputs.

    A force that stays the same to the last bit, and is not zero, while the joints, the input
    ``position`` of shape (n,) [rad], move, is that of a sensor that is stuck. One that is stuck
    at exactly 0 N is not noticed: without contact, a sensor without noise says just that. One
    that says NaN is stopped by `ForceSensor`.

    Args:
        size: Number of joints.
        period: Between two looks [s].
        patience: How long it may be stuck [s].

    Raises:
        SimulationError: While simulating, if the force is stuck.
    """

    def __init__(self, size: int, period: float, patience: float = 0.1) -> None:
        super().__init__()
        self._patience = patience
        self._measured = self.DeclareVectorInputPort("normal_force", 1)
        self._position = self.DeclareVectorInputPort("position", size)
        # What was seen last [N], since when [s], and where the joints were then [rad].
        self.DeclareDiscreteState(np.zeros(2 + size))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        t, force = context.get_time(), float(self._measured.Eval(context)[0])
        x = context.get_discrete_state_vector().CopyToVector()
        q = self._position.Eval(context)
        if force != x[0] or force == 0.0:
            state.set_value(np.concatenate(((force, t), q)))
        elif t - x[1] > self._patience and np.abs(q - x[2:]).max() > _AT_REST:
            raise SimulationError(
                f"{self.get_name()}: the force sensor is stuck at {force:.6g} N since "
                f"t = {x[1]:.4g} s, while the arm moves",
                t,
            )
