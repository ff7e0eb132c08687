"""How hard a surface is to be pressed, and where it faces."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context, LeafSystem

from ..inputs.fields import Array, NonNegative, Positive, validated
from ..laws.parts.rise import smooth_rise


@validated
class ForceProfile:
    """A pressing force, constant once it has risen.

    Args:
        value: [N].
        rise_time: In which it rises from ``initial``, smoothly [s]; None for at once.
        initial: Goes with a rise_time [N].
    """

    value: Positive
    rise_time: Positive | None = None
    initial: NonNegative = 0.0

    def __post_init__(self) -> None:
        if self.initial > 0.0 and self.rise_time is None:
            raise ValueError(f"initial: goes with rise_time; without, {self.initial:g} is not used")

    def at(self, t: float) -> float:
        """The force asked for at time ``t`` [N]."""
        if self.rise_time is None:
            return self.value
        return self.initial + (self.value - self.initial) * float(smooth_rise(t, self.rise_time))


class ContactReference(LeafSystem):
    """``normal_WE``, shape (3,), and ``normal_force_desired``, shape (1,) [N].

    Args:
        normal: Outward normal of the surface, of length 1, shape (3,).
        force: To press with.
    """

    def __init__(self, normal: Array, force: ForceProfile) -> None:
        super().__init__()

        def normal_WE(context: Context, output: Any) -> None:
            output.set_value(normal)

        def normal_force_desired(context: Context, output: Any) -> None:
            output.set_value([force.at(context.get_time())])

        self.DeclareVectorOutputPort("normal_WE", 3, normal_WE, {self.nothing_ticket()})
        # What never changes is computed once.
        varies = self.nothing_ticket() if force.rise_time is None else self.time_ticket()
        self.DeclareVectorOutputPort("normal_force_desired", 1, normal_force_desired, {varies})
