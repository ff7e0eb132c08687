"""The arm's kinematics as signals."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context, LeafSystem

from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.task import named_task


class Kinematics(LeafSystem):
    """Where E, the arm's task frame, is and how it moves, seen from the world W.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs
    are, with the m axes of the task, ``p_WE`` and ``v_WE``, (m,) [m, m/s], and ``Jdot_v``, (m,)
    [m/s^2]; ``J``, (size of the task, n) flat; and whole, ``R_WE``, (3, 3) flat, and
    ``J_omega``, (3, n) flat. For a pose, ``J`` has the rows of ``J_omega`` first.

    Args:
        arm: The arm.
        task: A key of `drake_rnn.robot.task.TASKS`.
        kinematics: Of the arm, to share what it computes with others who ask at the same
            posture; by default its own.
    """

    def __init__(
        self, arm: Arm, task: str = "xyz", kinematics: ArmKinematics | None = None
    ) -> None:
        super().__init__()
        self.arm = arm
        about = named_task(task)
        chosen, m, n = about.position, len(about.axes), arm.n
        arm_kinematics = arm.kinematics() if kinematics is None else kinematics
        self._position = self.DeclareVectorInputPort("position", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        at_q = {self._position.ticket()}
        at_q_v = {self._position.ticket(), self._velocity.ticket()}

        # Evaluated at every sample, hence one function deep.
        read_q, read_v = self._position.Eval, self._velocity.Eval

        def p_WE(context: Context, output: Any) -> None:
            output.set_value(chosen(arm_kinematics.p_WE(read_q(context))))

        def J(context: Context, output: Any) -> None:
            output.set_value(about.J(arm_kinematics, read_q(context)).ravel())

        def v_WE(context: Context, output: Any) -> None:
            J = chosen(arm_kinematics.J(read_q(context)))
            output.set_value(J.dot(read_v(context)))

        def Jdot_v(context: Context, output: Any) -> None:
            bias = arm_kinematics.Jdot_v(read_q(context), read_v(context))
            output.set_value(chosen(bias))

        def R_WE(context: Context, output: Any) -> None:
            output.set_value(arm_kinematics.R_WE(read_q(context)).ravel())

        def J_omega(context: Context, output: Any) -> None:
            output.set_value(arm_kinematics.J_omega(read_q(context)).ravel())

        for size, calc, prerequisites in (
            (m, p_WE, at_q),
            (m, v_WE, at_q_v),
            (9, R_WE, at_q),
            (about.size * n, J, at_q),
            (3 * n, J_omega, at_q),
            (m, Jdot_v, at_q_v),
        ):
            self.DeclareVectorOutputPort(calc.__name__, size, calc, prerequisites)
