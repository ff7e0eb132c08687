"""What one arm's law sees of another arm beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..laws.layout import Layout
from ..robot.clearance.neighbour import Neighbour
from .block import Block


class NeighbourSource(Block):
    """Source of the signals by which a law sees another arm, from the state of that arm's law.

    Its input ``state`` is the other controller's ``state``, or its ``next_state`` if that arm
    chooses first. Until that state is initialized the arm rests where it starts.

    Args:
        neighbour: The other arm, as the law knows it.
        layout: Layout of the other law's state.
        start: Where the other arm starts, shape (n,) [rad].
    """

    def __init__(self, neighbour: Neighbour, layout: Layout, start: Array) -> None:
        super().__init__()
        port = self.DeclareVectorInputPort("state", layout.size)
        at_rest = {name: np.zeros(start.size) for name in ("commanded", "v", "a")}
        at_rest["commanded"] = start
        for signal, part in neighbour.parts.items():
            at, _ = layout.parts[part]

            def calc(
                context: Context, output: Any, at: slice = at, first: Array = at_rest[part]
            ) -> None:
                seen = port.Eval(context)[at]
                output.set_value(first if np.isnan(seen).any() else seen)

            self.DeclareVectorOutputPort(signal, start.size, calc, {port.ticket()})
