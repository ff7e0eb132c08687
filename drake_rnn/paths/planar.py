"""Curves in a plane."""

# No postponed annotations: see `path`.
from abc import abstractmethod
from functools import cached_property
from typing import Annotated

import numpy as np

from ..inputs.fields import Angle, Array, validated
from ..inputs.keys import Meaning
from .cone import coned
from .curve import Curve, Triple
from .in_plane import InPlane
from .path import Motion


@validated
class Planar(InPlane, Curve):
    """A curve in a plane."""

    cone: Annotated[
        Angle,
        Meaning(
            "Half angle of the cone about the plane's normal that every axis of the end effector "
            "traces in a lap; 0 for a path without an orientation.",
            unit="rad",
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_place()
        if not 0.0 <= self.cone < np.pi:
            raise ValueError(f"cone: must be at least 0 and less than pi, not {self.cone:g}")

    @property
    def turns(self) -> bool:
        """Whether the end effector turns along the path."""
        return self.cone != 0.0

    def evaluate_rotation(self, t: float) -> Motion:
        return coned(self._axes, self.cone, self.phase_at(t) or (0.0, 0.0, 0.0))

    @abstractmethod
    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """Return z relative to the curve's own origin, and its two derivatives by phase [m]."""

    @cached_property
    def _first(self) -> complex:
        return self.curve(0.0)[0]

    @property
    def _first_point(self) -> Array:
        return np.array([(w * self._first).real for w in self._components])

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        z, dz, ddz = self.curve(phase)
        z -= self._first
        a, b, c = self._components
        return (
            ((a * z).real, (b * z).real, (c * z).real),
            ((a * dz).real, (b * dz).real, (c * dz).real),
            ((a * ddz).real, (b * ddz).real, (c * ddz).real),
        )
