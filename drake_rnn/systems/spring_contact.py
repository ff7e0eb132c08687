"""The force on a point from a surface that gives way like a spring."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from ..environments.elastic_surface import ElasticSurface
from ..fields import Array


class SpringContact(LeafSystem):
    """At the kinematic level: a force proportional to depth, and none above the surface.

    The input is ``p_WE``, shape (3,) [m]; the output ``contact_force``, shape (3,) [N], in the
    world frame.

    Args:
        surface: Its normal and stiffness.
        p_WS: A point of it, shape (3,) [m].
    """

    def __init__(self, surface: ElasticSurface, p_WS: Array) -> None:
        super().__init__()
        n, stiffness = surface.normal_W, surface.stiffness
        height = float(n.dot(p_WS))
        p_WE = self.DeclareVectorInputPort("p_WE", 3)

        def contact_force(context: Context, output: Any) -> None:
            depth = height - float(n.dot(p_WE.Eval(context)))
            output.set_value(stiffness * depth * n if depth > 0.0 else np.zeros(3))

        self.DeclareVectorOutputPort("contact_force", 3, contact_force, {p_WE.ticket()})
