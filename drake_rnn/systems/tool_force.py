"""The force on a tool, as a sensor at its joint feels it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import Context, LeafSystem

from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics


class ToolForce(LeafSystem):
    """What a force-torque sensor between arm and tool says, the tool's weight taken off.

    Inputs are ``reaction_forces``, of a plant's joints, and ``position`` of the arm's joints,
    shape (n,) [rad]. The output ``tool_force``, shape (3,) [N], is the force that the
    surroundings exert on the tool, in the world frame; it includes what accelerates the tool.

    Args:
        arm: The arm; the tool moves with its frame E.
        joint: Index of the joint that holds it, among the reaction forces.
        R_EJ: Orientation in E of that joint's frame J on the tool, shape (3, 3): in it Drake
            tells the joint's reaction.
        mass: Of what that joint holds [kg].
        kinematics: Of the arm, to share what it computes with others who ask at the same
            posture; by default its own.
    """

    def __init__(
        self,
        arm: Arm,
        joint: int,
        R_EJ: Array,
        mass: float,
        kinematics: ArmKinematics | None = None,
    ) -> None:
        super().__init__()
        R_WE = (arm.kinematics() if kinematics is None else kinematics).R_WE
        weight: Array = mass * arm.gravity
        forces = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        position = self.DeclareVectorInputPort("position", arm.n)

        def tool_force(context: Context, output: Any) -> None:
            # The joint's own force on the tool.
            held = forces.Eval(context)[joint].translational()
            if not held.any():
                # A plant that has not made its first step has felt nothing yet.
                output.set_value(np.zeros(3))
                return
            output.set_value(-R_WE(position.Eval(context)).dot(R_EJ.dot(held)) - weight)

        seen = {forces.ticket(), position.ticket()}
        self.DeclareVectorOutputPort("tool_force", 3, tool_force, seen)
