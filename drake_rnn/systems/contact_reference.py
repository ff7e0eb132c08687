"""Desired pressing force on a surface, and the surface's normal."""

from __future__ import annotations

from typing import Annotated, Any

from pydrake.systems.framework import Context

from ..inputs.fields import Array, NonNegative, Positive, Time, between, validated
from ..inputs.keys import Meaning
from ..laws.parts.rise import smooth_rise
from .block import Block


@validated
class ForceProfile:
    """A pressing force, constant once it has risen."""

    value: Annotated[Positive, between(0.0, 1e6), Meaning("Final force.", unit="N")]
    rise_time: Annotated[
        Time | None,
        Meaning(
            "Time in which the force rises smoothly from ``initial``; None for a force that is "
            "constant from the start.",
            unit="s",
        ),
    ] = None
    initial: Annotated[
        NonNegative,
        Meaning("Force at the start; only with ``rise_time``.", unit="N"),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.initial > 0.0 and self.rise_time is None:
            raise ValueError(f"initial: must be 0 without rise_time, not {self.initial:g}")

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        if self.rise_time is None:
            return self.value
        return self.initial + (self.value - self.initial) * float(smooth_rise(t, self.rise_time))


class ContactReference(Block):
    """Source of ``normal_WE``, shape (3,), and ``normal_force_desired``, shape (1,) [N].

    Args:
        normal: Outward unit normal of the surface in the world frame, shape (3,).
        force: Desired pressing force.
    """

    def __init__(self, normal: Array, force: ForceProfile) -> None:
        super().__init__()

        def normal_WE(context: Context, output: Any) -> None:
            output.set_value(normal)

        def normal_force_desired(context: Context, output: Any) -> None:
            output.set_value([force.at(context.get_time())])

        self.DeclareVectorOutputPort("normal_WE", 3, normal_WE, {self.nothing_ticket()})
        # A constant force is computed only once.
        varies = self.nothing_ticket() if force.rise_time is None else self.time_ticket()
        self.DeclareVectorOutputPort("normal_force_desired", 1, normal_force_desired, {varies})
