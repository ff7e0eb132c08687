"""The arm's dynamics as signals."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context

from ..inputs.complaints import require_type
from ..robot.arm import Arm
from .block import Block

#: Outputs of `Dynamics`, which is added only for a law that needs one of them.
DYNAMICS_SIGNALS = ("M", "bias", "gravity")


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
        n, arm_dynamics = arm.n, arm.believed_dynamics()
        position = self.DeclareVectorInputPort("position", n)
        velocity = self.DeclareVectorInputPort("velocity", n)

        def M(context: Context, output: Any) -> None:
            output.set_value(arm_dynamics.M(position.Eval(context)).ravel())

        def bias(context: Context, output: Any) -> None:
            output.set_value(arm_dynamics.bias(position.Eval(context), velocity.Eval(context)))

        def gravity(context: Context, output: Any) -> None:
            output.set_value(arm_dynamics.gravity(position.Eval(context)))

        at_q = {position.ticket()}
        self.DeclareVectorOutputPort("M", n * n, M, at_q)
        self.DeclareVectorOutputPort("bias", n, bias, at_q | {velocity.ticket()})
        self.DeclareVectorOutputPort("gravity", n, gravity, at_q)
