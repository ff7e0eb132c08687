"""Where a path lies that is given in a plane."""

# No postponed annotations: see `path`.
from abc import abstractmethod
from cmath import exp
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.math import RollPitchYaw, RotationMatrix

from ..inputs.fields import Angle, Angles, Array, Point, validated, zeros
from ..inputs.keys import Meaning
from .relative import RelativePath

_AXES: dict[str, list[int]] = {"xy": [0, 1], "xz": [0, 2], "yz": [1, 2]}


@validated
class InPlane(RelativePath):
    """A path given in a plane."""

    plane: Annotated[
        Literal["xy", "xz", "yz"],
        Meaning("Axes of the base frame along which the curve's x and y lie."),
    ] = "xy"
    angle: Annotated[
        Angle,
        Meaning("Rotation of the curve within its plane, from x to y.", unit="rad"),
    ] = 0.0
    rotation: Annotated[
        Angles,
        Meaning(
            "Roll, pitch and yaw of the plane about the base's fixed axes, shape (3,).",
            unit="rad",
        ),
    ] = Field(default_factory=zeros)
    centre: Annotated[
        Point | None,
        Meaning(
            "Position of the curve's own origin in the base frame, shape (3,); if None, the path "
            "starts at the arm's start, apart from ``offset``.",
            unit="m",
        ),
    ] = None

    @property
    def has_place(self) -> bool:
        """Whether a ``centre`` says where the curve lies."""
        return self.centre is not None

    def _require_place(self) -> None:
        """Raise a ValueError if the place is given twice."""
        if self.centre is not None:
            self._require_no_offset("centre")

    @cached_property
    def _components(self) -> tuple[complex, complex, complex]:
        """Weights w such that Re(w z) is the component of z along x, y and z of the base."""
        R = RotationMatrix(RollPitchYaw(*self.rotation)).matrix()[:, _AXES[self.plane]]
        wx, wy, wz = (complex(x, -y) * exp(1j * self.angle) for x, y in R)
        return wx, wy, wz

    @cached_property
    def _axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors along the curve's x and y and normal to its plane, each of shape (3,)."""
        weights = np.array(self._components)
        x, y = weights.real, -weights.imag
        return x, y, np.cross(x, y)

    @property
    def normal(self) -> Array:
        """Unit vector normal to the plane, along the axes of the path's frame, shape (3,)."""
        return self._axes[2]

    @property
    @abstractmethod
    def _first_point(self) -> Array:
        """First point relative to the curve's own origin, along the axes of the base, (3,) [m]."""

    def start_point(self, p_WE: Array) -> Array:
        """See `RelativePath.start_point`; with a ``centre``, the arm's start does not matter."""
        if self.centre is None:
            return super().start_point(p_WE)
        return np.asarray(self.centre + self._first_point)
