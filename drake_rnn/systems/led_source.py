"""The desired position of an arm whose path goes along with the tool of another one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..paths.led import LedPath
from ..robot.kinematics import ArmKinematics
from ..signals import DESIRED_POSITION, SIGNALS
from .block import Block


class LedSource(Block):
    """Source of the desired position, now and at the next sample, by what the leading arm commands.

    Its inputs are ``now`` and ``next``, the joint positions of the leading arm at a sample and at
    the next one, shape (n,) [rad]; until they are known it rests at its start.

    Args:
        path: The path.
        kinematics: Kinematics of the leading arm.
        start: Where that arm starts, shape (n,) [rad].
        period: Sampling period [s].
        axes: Axes of the task.
    """

    def __init__(
        self,
        path: LedPath,
        kinematics: ArmKinematics,
        start: Array,
        period: float,
        axes: Sequence[int],
    ) -> None:
        super().__init__()
        kept = list(axes)
        for port, signal, ahead in (
            ("now", DESIRED_POSITION, 0.0),
            ("next", SIGNALS[DESIRED_POSITION].ahead, period),
        ):
            joints = self.DeclareVectorInputPort(port, start.size)

            def calc(
                context: Context, output: Any, joints: Any = joints, ahead: float = ahead
            ) -> None:
                q = joints.Eval(context)
                q = start if np.isnan(q).any() else q
                t = context.get_time() + ahead
                output.set_value(path.beside(t, kinematics.p_WE(q))[kept])

            tickets = {joints.ticket(), self.time_ticket()}
            self.DeclareVectorOutputPort(signal, len(kept), calc, tickets)
