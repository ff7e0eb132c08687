"""The arm's kinematics as signals."""

from __future__ import annotations

from types import NoneType

from ..inputs.complaints import require_type
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.task import named_task
from ..signals import View, names_of
from .block import Block, declare_signals


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
        about, n = named_task(task), arm.n
        self._position = self.DeclareVectorInputPort("position", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        view = View(about, arm.kinematics() if kinematics is None else kinematics)
        lengths = {"n": n, "axes": len(about.axes), "rows": about.size}
        ports = (self._position, self._velocity)
        declare_signals(self, view, names_of("kinematics"), ports, lengths)
