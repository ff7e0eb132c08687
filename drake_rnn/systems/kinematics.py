"""The arm's kinematics as signals."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from ..arms import Arm
from ..errors import SimulationError
from ..fields import Array

#: Rows of the position of E that a task is about.
TASKS = {"xyz": (0, 1, 2), "xy": (0, 1)}


class Kinematics(LeafSystem):
    """Where E, the arm's task frame, is and how it moves, seen from the world W.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs
    are, with the m rows of the task, ``p_WE`` and ``v_WE`` = J velocity, (m,) [m, m/s], ``J``,
    (m, n) flat, ``Jdot_v``, (m,) [m/s^2], and whole, ``R_WE``, (3, 3) flat, and ``J_omega``,
    (3, n) flat.

    Args:
        arm: The arm.
        task: A key of `TASKS`.
    """

    def __init__(self, arm: Arm, task: str = "xyz") -> None:
        super().__init__()
        self.arm = arm
        rows = list(TASKS[task])
        m, n = len(rows), arm.n
        every_row = m == 3
        arm_kinematics = arm.kinematics()
        self._position = self.DeclareVectorInputPort("position", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        at_q = {self._position.ticket()}
        at_q_v = {self._position.ticket(), self._velocity.ticket()}

        def task_rows(value: Array) -> Array:
            return value if every_row else value[rows]

        def declare(name: str, size: int, prerequisites: set[Any], value: Any) -> None:
            def calc(context: Context, output: Any) -> None:
                output.set_value(value(context))

            self.DeclareVectorOutputPort(name, size, calc, prerequisites)

        def p_WE(context: Context) -> Array:
            q = self._position.Eval(context)
            p = arm_kinematics.p_WE(q)
            if p[0] - p[0] != 0.0:
                raise SimulationError(f"{self.get_name()}: position is {q}", context.get_time())
            return task_rows(p)

        def J(context: Context) -> Array:
            return task_rows(arm_kinematics.J(self._position.Eval(context)))

        def v_WE(context: Context) -> Array:
            return J(context) @ self._velocity.Eval(context)

        def Jdot_v(context: Context) -> Array:
            q, v = self._position.Eval(context), self._velocity.Eval(context)
            return task_rows(arm_kinematics.Jdot_v(q, v))

        declare("p_WE", m, at_q, p_WE)
        declare("R_WE", 9, at_q, lambda c: arm_kinematics.R_WE(self._position.Eval(c)).ravel())
        declare("v_WE", m, at_q_v, v_WE)
        declare("J", m * n, at_q, lambda context: J(context).ravel())
        declare(
            "J_omega", 3 * n, at_q, lambda c: arm_kinematics.J_omega(self._position.Eval(c)).ravel()
        )
        declare("Jdot_v", m, at_q_v, Jdot_v)
