"""Detection of a stuck force sensor."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from ..errors import SimulationError
from .block import Block

# Joint motion below which a working sensor may read the same force [rad].
_AT_REST = 1e-9


class ForceWatch(Block):
    """Watchdog that stops a run if the force sensor is stuck.

    Inputs are ``normal_force``, shape (1,) [N], and ``position`` of the joints, shape (n,) [rad];
    there are no outputs. The sensor is stuck if the force is not zero and stays the same to the
    last bit while the joints move. A sensor stuck at exactly 0 N is not detected, because an ideal
    sensor without contact reads the same. A sensor that reads NaN is stopped by `ForceSensor`.

    Args:
        size: Number of joints.
        period: Time between two checks [s].
        patience: Time for which the force may stay the same [s].

    Raises:
        SimulationError: During a simulation, if the sensor is stuck.
    """

    def __init__(self, size: int, period: float, patience: float = 0.1) -> None:
        super().__init__()
        self._patience = patience
        self._measured = self.DeclareVectorInputPort("normal_force", 1)
        self._position = self.DeclareVectorInputPort("position", size)
        # Last force [N], time of its first sample [s], and joint positions at that time [rad].
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
                f"{self.get_name()}: the force sensor has been stuck at {force:.6g} N since "
                f"t = {x[1]:.4g} s, while the arm moves",
                t,
            )
