"""The contact force at the kinematic level."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..environments.elastic_surface import ElasticSurface
from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from .block import Block


class SpringContact(Block):
    """Force on E's origin from a surface that acts as a spring, proportional to the depth.

    The input is ``position`` of the joints, shape (n,) [rad], the output ``contact_force``, shape
    (3,) [N], in the world frame.

    Args:
        surface: Surface with its normal and stiffness.
        p_WS: A point of the surface, shape (3,) [m].
        n: Number of joints.
        kinematics: Kinematics of the arm.
    """

    def __init__(
        self, surface: ElasticSurface, p_WS: Array, n: int, kinematics: ArmKinematics
    ) -> None:
        super().__init__()
        normal, stiffness = surface.normal_W, surface.stiffness
        height = float(normal.dot(p_WS))
        position = self.DeclareVectorInputPort("position", n)

        def contact_force(context: Context, output: Any) -> None:
            p_WE = kinematics.p_WE(position.Eval(context))
            depth = height - float(normal.dot(p_WE))
            output.set_value(stiffness * depth * normal if depth > 0.0 else np.zeros(3))

        self.DeclareVectorOutputPort("contact_force", 3, contact_force, {position.ticket()})
