"""The arm at the kinematic level: it is where it is commanded to be."""

from __future__ import annotations

from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough


class Mirror(Diagram):
    """An ideal arm: ``position`` and ``velocity`` out are those in, shape (n,) [rad, rad/s].

    Args:
        size: Number of joints.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        builder = DiagramBuilder()
        for name in ("position", "velocity"):
            block = builder.AddNamedSystem(name, PassThrough(size))
            builder.ExportInput(block.get_input_port(), f"{name}_commanded")
            builder.ExportOutput(block.get_output_port(), name)
        builder.BuildInto(self)
