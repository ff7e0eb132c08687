"""A straight line, with a turn on the way if asked for."""

# No postponed annotations: see `path`.
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.common.eigen_geometry import AngleAxis

from ..errors import InvalidInputError
from ..inputs.fields import Array, Point, validated, zeros
from ..inputs.keys import Meaning
from .curve import TURN, Curve, Triple
from .path import Motion
from .relative import RelativePath

_STRAIGHT: Triple = (0.0, 0.0, 0.0)


@validated
class Line(Curve):
    """A straight line, passed once."""

    kind: Literal["line"] = "line"
    summary = "A straight line, passed once."
    by: Annotated[
        Point | None,
        Meaning("End relative to the first point, shape (3,); give this or ``to``.", unit="m"),
    ] = None
    to: Annotated[Point | None, Meaning("End, shape (3,).", unit="m")] = None
    turn: Annotated[
        Point,
        Meaning(
            "Rotation vector by which the end effector turns on the way, shape (3,) [rad]: about "
            "its direction, by its length.",
            unit="rad",
        ),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.by is None) == (self.to is None):
            raise ValueError("give either by or to")
        if self.by is not None and not self.by.any() and not self.turn.any():
            raise ValueError("by: must not be zero without a turn; kind: rest stays")

    @property
    def closed(self) -> bool:
        return False

    @property
    def turns(self) -> bool:
        """Whether there is a turn on the way."""
        return bool(self.turn.any())

    @cached_property
    def _rate(self) -> Triple:
        """Displacement for each radian of phase [m]."""
        if self.by is None:
            raise InvalidInputError(
                "to: how far that is depends on where the path begins; place the path first"
            )
        x, y, z = (self.by / TURN).tolist()
        return x, y, z

    def begun_at(self, p_FE: Array) -> RelativePath:
        if self.to is None:
            return self
        return replace(self, by=self.to - self.start_point(p_FE), to=None)

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        x, y, z = self._rate
        return (phase * x, phase * y, phase * z), self._rate, _STRAIGHT

    def evaluate_rotation(self, t: float) -> Motion:
        phase = self.phase_at(t)
        angle, rate, gain = (TURN if t > 0.0 else 0.0, 0.0, 0.0) if phase is None else phase
        size = float(np.linalg.norm(self.turn))
        axis = self.turn / size if size else np.array((1.0, 0.0, 0.0))
        R = AngleAxis(size * angle / TURN, axis).rotation()
        return R, self.turn * (rate / TURN), self.turn * (gain / TURN)
