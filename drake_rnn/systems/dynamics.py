"""The arm's dynamics as signals."""

from __future__ import annotations

from ..inputs.complaints import require_type
from ..robot.arm import Arm
from ..robot.task import named_task
from ..signals import View, names_of
from .block import Block, declare_signals

#: Outputs of `Dynamics`, which is added only for a law that needs one of them.
DYNAMICS_SIGNALS = names_of("dynamics")


class Dynamics(Block):
    """Inertia, Coriolis terms and gravity of the arm: torque = M v_dot + bias - gravity.

    If the arm's description gives a ``believed_mass_scale``, masses are scaled by it.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs are
    ``M``, shape (n, n) flattened [kg m^2], ``bias`` and ``gravity``, shape (n,) [Nm].

    Args:
        arm: The arm.

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`.
    """

    def __init__(self, arm: Arm) -> None:
        super().__init__()
        require_type("arm", arm, Arm)
        self._position = self.DeclareVectorInputPort("position", arm.n)
        self._velocity = self.DeclareVectorInputPort("velocity", arm.n)
        view = View(named_task("xyz"), dynamics=arm.believed_dynamics())
        ports = (self._position, self._velocity)
        declare_signals(self, view, DYNAMICS_SIGNALS, ports, {"n": arm.n})
