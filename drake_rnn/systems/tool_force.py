"""The force on a tool as measured at its joint."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from .block import Block


class ToolForce(Block):
    """Reading of an ideal force-torque sensor between arm and tool, without the tool's weight.

    Inputs are ``reaction_forces`` of a plant's joints, and ``position`` of the arm's joints,
    shape (n,) [rad]. The output ``tool_force``, shape (3,) [N], is the force of the surroundings
    on the tool, in the world frame; it includes the tool's inertial force.

    Args:
        arm: The arm; the tool moves with its frame E.
        joint: Index of the joint that holds the tool, among the reaction forces.
        R_EJ: Orientation in E of that joint's frame J on the tool, shape (3, 3); Drake expresses
            the joint's reaction in J.
        mass: Mass that the joint holds [kg].
        kinematics: Kinematics of the arm, to share with other systems so that each posture is
            computed only once; by default a new instance.
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
            # Force of the joint on the tool, in J.
            held = forces.Eval(context)[joint].translational()
            if not held.any():
                # Before its first step the plant reports no reaction.
                output.set_value(np.zeros(3))
                return
            output.set_value(-R_WE(position.Eval(context)).dot(R_EJ.dot(held)) - weight)

        seen = {forces.ticket(), position.ticket()}
        self.DeclareVectorOutputPort("tool_force", 3, tool_force, seen)
