"""The arm's kinematics as signals."""

from __future__ import annotations

from types import NoneType
from typing import Any

from pydrake.systems.framework import Context

from ..inputs.complaints import require_type
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.task import named_task
from .block import Block


class Kinematics(Block):
    """Pose, velocity and Jacobians of E, the arm's task frame, in the world frame W.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs along
    the m position axes of the task are ``p_WE`` and ``v_WE``, shape (m,) [m, m/s], and ``Jdot_v``,
    shape (m,) [m/s^2]. ``J`` has shape (size of the task, n); for a pose its first rows are those
    of ``J_omega``. ``R_WE``, shape (3, 3), and ``J_omega``, shape (3, n), do not depend on the
    task. Matrices are flattened.

    Args:
        arm: The arm.
        task: A key of `drake_rnn.robot.task.TASKS`.
        kinematics: Kinematics of the arm, to share with other systems so that each posture is
            computed only once; by default a new instance.

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`, or there is no such task.
    """

    def __init__(
        self, arm: Arm, task: str = "xyz", kinematics: ArmKinematics | None = None
    ) -> None:
        super().__init__()
        require_type("arm", arm, Arm)
        require_type("kinematics", kinematics, ArmKinematics, NoneType)
        self.arm = arm
        about = named_task(task)
        chosen, m, n = about.position, len(about.axes), arm.n
        arm_kinematics = arm.kinematics() if kinematics is None else kinematics
        self._position = self.DeclareVectorInputPort("position", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        at_q = {self._position.ticket()}
        at_q_v = {self._position.ticket(), self._velocity.ticket()}

        # Evaluated at every sample: methods are bound once.
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
