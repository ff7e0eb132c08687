"""Bounds of joints as magnitudes, which may differ for the two directions.

This is the one place that says which of two bounds holds in a direction. Where both are the same
array, no operation is done that a single bound would not need, so that no bit changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ..arrays.algebra import clip, functions_of


class Sides(NamedTuple):
    """Magnitudes of a bound of joints, shape (..., n) each; the same array if it is one.

    Attributes:
        down: Bound of what is negative.
        up: Bound of what is positive.
    """

    down: Any
    up: Any

    @classmethod
    def of(cls, bound: Any) -> Sides:
        """Return the sides of a bound, which is an array if it is the same for both."""
        return bound if isinstance(bound, Sides) else cls(bound, bound)

    @property
    def are_one(self) -> bool:
        """Whether both are the same array."""
        return self.down is self.up

    @property
    def least(self) -> Any:
        """The smaller ones, shape (..., n)."""
        return self.up if self.are_one else functions_of(self.up).minimum(self.down, self.up)

    @property
    def largest(self) -> Any:
        """The larger ones, shape (..., n)."""
        return self.up if self.are_one else functions_of(self.up).maximum(self.down, self.up)

    @property
    def mirrored(self) -> Sides:
        """Those of joints whose positions are counted the other way."""
        return self if self.are_one else Sides(self.up, self.down)

    def toward(self, is_up: Any) -> Any:
        """Return the bounds in a direction, shape (..., n).

        Args:
            is_up: Whether it is that of what is positive, shape (..., n).
        """
        return self.up if self.are_one else functions_of(is_up).where(is_up, self.up, self.down)

    def against(self, v: Any) -> Any:
        """Return the bounds of what brakes velocities, shape (..., n)."""
        return self.up if self.are_one else self.toward(v < 0.0)

    def map(self, function: Callable[[Any], Any]) -> Sides:
        """Return what a function makes of them."""
        up = function(self.up)
        return Sides(up if self.are_one else function(self.down), up)

    def clip(self, values: Any) -> Any:
        """Return values within them, shape (..., n)."""
        return clip(values, -self.down, self.up)


#: A bound of joints: magnitudes, shape (..., n), or those of both directions.
Bound = Any
