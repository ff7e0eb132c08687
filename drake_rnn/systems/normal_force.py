"""The pressing component of a force."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context

from .block import Block


class NormalForce(Block):
    """Component ``normal_force``, shape (1,) [N], of ``force`` along ``normal_WE``, shape (3,)."""

    def __init__(self) -> None:
        super().__init__()
        force = self.DeclareVectorInputPort("force", 3)
        normal = self.DeclareVectorInputPort("normal_WE", 3)

        def normal_force(context: Context, output: Any) -> None:
            output.set_value([normal.Eval(context).dot(force.Eval(context))])

        seen = {force.ticket(), normal.ticket()}
        self.DeclareVectorOutputPort("normal_force", 1, normal_force, seen)
