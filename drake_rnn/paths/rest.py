"""A fixed point in place of a path."""

# No postponed annotations: see `path`.
from typing import Literal

from ..inputs.fields import validated
from .curve import Curve, Period, Triple

_STILL: Triple = (0.0, 0.0, 0.0)


@validated
class Rest(Curve):
    """A fixed point: the arm's start or, with an ``offset``, a point away from it."""

    kind: Literal["rest"] = "rest"
    summary = "A fixed point: the arm's start or, with an offset, a point away from it."
    period: Period = 1.0

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        return _STILL, _STILL, _STILL
