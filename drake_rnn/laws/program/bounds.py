"""Bounds of a scheme: joint velocities within their limits, position limits folded in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from ...arrays.algebra import functions_of
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ..layout import Signals
from .costs import Shapes


class Bounds(Protocol):
    """Lower and upper bounds of a scheme's variables x."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that they see, by name."""

    def box(self, u: Signals) -> tuple[Array, Array]:
        """Return the lower and upper bounds, shape (..., k) each."""

    def rates(self, u: Signals, x: Array) -> tuple[Array, Array]:
        """Return their time derivatives, shape (..., k) each."""


@dataclass(frozen=True, eq=False)
class VelocityBox:
    """Velocities that approach a position limit no faster than in proportion to the way left.

    Attributes:
        limits: Limits of the joints; that of the velocity is finite.
        stiffness: Velocity allowed per radian left to a position limit [1/s].
    """

    limits: JointLimits
    stiffness: Any

    @property
    def inputs(self) -> Shapes:
        """See `Bounds.inputs`."""
        return {"position": (self.limits.size,)}

    def box(self, u: Signals) -> tuple[Array, Array]:
        """See `Bounds.box`."""
        return self.limits.velocity_box(u["position"], self.stiffness)

    def rates(self, u: Signals, x: Array) -> tuple[Array, Array]:
        """See `Bounds.rates`; zero where the velocity limit is the narrower one."""
        lower, upper = self.box(u)
        fastest = self.limits.velocity
        where = functions_of(lower, x).where
        narrower = (abs(lower) < fastest), (abs(upper) < fastest)
        closing = -self.stiffness * x
        return where(narrower[0], closing, 0.0), where(narrower[1], closing, 0.0)
