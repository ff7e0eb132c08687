"""A fixed point in place of a path."""

# No postponed annotations: see `path`.
from typing import Annotated, Literal

from pydantic import Field

from ..inputs.fields import validated
from .curve import Curve, Triple

_STILL: Triple = (0.0, 0.0, 0.0)


@validated
class Rest(Curve):
    """A fixed point: the arm's start or, with an ``offset``, a point away from it."""

    kind: Literal["rest"] = "rest"
    period: Annotated[float, Field(strict=True, ge=1e-3, le=1e6, allow_inf_nan=False)] = 1.0

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        return _STILL, _STILL, _STILL
