"""Curves in a plane."""

# No postponed annotations: see `path`.
from abc import abstractmethod
from cmath import exp
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field
from pydrake.math import RollPitchYaw, RotationMatrix

from ..inputs.fields import Angle, Angles, Array, Point, validated, zeros
from .cone import coned
from .curve import Curve, Triple
from .path import Motion

_AXES: dict[str, list[int]] = {"xy": [0, 1], "xz": [0, 2], "yz": [1, 2]}


@validated
class Planar(Curve):
    """A curve in a plane.

    Args:
        plane: Axes of the base frame along which the curve's x and y lie.
        angle: Rotation of the curve within its plane, from x to y [rad].
        rotation: Roll, pitch and yaw of the plane about the base's fixed axes, shape (3,) [rad].
        centre: Position of the curve's own origin in the base frame, shape (3,) [m]; if None, the
            path starts at the arm's start, apart from ``offset``.
        cone: Half angle of the cone about the plane's normal that every axis of the end effector
            traces in a lap [rad]; 0 for a path without an orientation.
    """

    plane: Literal["xy", "xz", "yz"] = "xy"
    angle: Angle = 0.0
    rotation: Angles = Field(default_factory=zeros)
    centre: Point | None = None
    cone: Angle = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.centre is not None:
            self._require_no_offset("centre")
        if not 0.0 <= self.cone < np.pi:
            raise ValueError(f"cone: must be at least 0 and less than pi, not {self.cone:g}")

    @property
    def turns(self) -> bool:
        """Whether the end effector turns along the path."""
        return self.cone != 0.0

    def evaluate_rotation(self, t: float) -> Motion:
        return coned(self._axes, self.cone, self.phase_at(t) or (0.0, 0.0, 0.0))

    @cached_property
    def _axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors along the curve's x and y and normal to its plane, each of shape (3,)."""
        weights = np.array(self._components)
        x, y = weights.real, -weights.imag
        return x, y, np.cross(x, y)

    @abstractmethod
    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """Return z relative to the curve's own origin, and its two derivatives by phase [m]."""

    @cached_property
    def _components(self) -> tuple[complex, complex, complex]:
        """Weights w such that Re(w z) is the component of z along x, y and z of the base."""
        R = RotationMatrix(RollPitchYaw(*self.rotation)).matrix()[:, _AXES[self.plane]]
        wx, wy, wz = (complex(x, -y) * exp(1j * self.angle) for x, y in R)
        return wx, wy, wz

    @property
    def has_place(self) -> bool:
        """Whether a ``centre`` says where the curve lies."""
        return self.centre is not None

    @cached_property
    def _first(self) -> complex:
        return self.curve(0.0)[0]

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        z, dz, ddz = self.curve(phase)
        z -= self._first
        a, b, c = self._components
        return (
            ((a * z).real, (b * z).real, (c * z).real),
            ((a * dz).real, (b * dz).real, (c * dz).real),
            ((a * ddz).real, (b * ddz).real, (c * ddz).real),
        )

    def start_point(self, p_WE: Array) -> Array:
        """See `RelativePath.start_point`; with a ``centre``, the arm's start does not matter."""
        if self.centre is None:
            return super().start_point(p_WE)
        first: Array = np.array([(w * self._first).real for w in self._components])
        return self.centre + first
