r"""Curves in a plane, where that plane lies, and how a tool may turn on the way.

- Curves that are sums of harmonics: circle, nephroid, four-ring, clover and deltoid.
- Curves of straight edges: the square, its corners sharp or rounded, and the parallelogram.
- A cat's head: a circle with bumps; `drake_rnn.paths` gives the formula.

On the way every axis of the end effector may trace a cone, by a rotation whose axis goes round.
With the cone's axis n and an axis u(0) at a right angle to it,

.. math::
    C(\varphi) = \exp(\theta [u(\varphi)]_\times), \quad u(\varphi) = \exp(\varphi [n]_\times) u(0),

turns about u, which itself turns about n. A path gives its rotation from the first orientation,
which is C(phi) C(0)^T. The angular velocity is phi' (n - C n).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from cmath import exp
from functools import cached_property
from math import cos, sin
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RollPitchYaw, RotationMatrix

from ..inputs.fields import (
    Angle,
    Angles,
    Array,
    Finite,
    Length,
    Point,
    Positive,
    Vector,
    between,
    validated,
    zeros,
)
from ..inputs.keys import Meaning
from .curve import TURN, Curve, Triple
from .path import Motion, RelativePath

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


def cone(
    axes: tuple[Array, Array, Array], angle: float, phase: tuple[float, float, float]
) -> Motion:
    """Return the rotation from the first orientation, and its angular velocity and acceleration.

    Args:
        axes: Unit vectors u(0), n x u(0) and n, each of shape (3,).
        angle: Half angle theta of the cone [rad].
        phase: Phase phi [rad], its rate and its second derivative.

    Returns:
        The rotation, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2], each of
        shape (3,).
    """
    first, second, normal = axes
    phi, rate, gain = phase
    C = AngleAxis(angle, cos(phi) * first + sin(phi) * second).rotation()
    axis = C @ normal
    w = rate * (normal - axis)
    alpha = gain * (normal - axis) - rate * np.cross(w, axis)
    return C @ AngleAxis(angle, first).rotation().T, w, alpha


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
        return cone(self._axes, self.cone, self.phase_at(t) or (0.0, 0.0, 0.0))

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


Harmonics = tuple[tuple[int, complex], ...]


@validated
class Trigonometric(Planar):
    """A curve z(f) that is the sum of c exp(i k f) over its ``harmonics`` (k, c)."""

    size: Annotated[
        Length,
        Meaning("Size of the curve: a radius or half a width, see the class [m].", unit="m"),
    ]

    @property
    @abstractmethod
    def harmonics(self) -> Harmonics:
        """Pairs of order k and coefficient c [m]."""

    @cached_property
    def _harmonics(self) -> tuple[tuple[complex, complex], ...]:
        return tuple((1j * k, c) for k, c in self.harmonics)

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        z = dz = ddz = 0j
        for ik, c in self._harmonics:
            term = c * exp(ik * phase)
            z += term
            term *= ik
            dz += term
            ddz += ik * term
        return z, dz, ddz


@validated
class Circle(Trigonometric):
    """A circle of radius ``size`` [m]."""

    kind: Literal["circle"] = "circle"
    summary = "A circle of radius size [m]."

    @property
    def harmonics(self) -> Harmonics:
        return ((1, self.size),)


@validated
class Nephroid(Trigonometric):
    """A nephroid, 4 by 8 times ``size`` [m].

    With uniform timing its top speed is 6 size w [m/s], where w = 2 pi / period.
    """

    kind: Literal["nephroid"] = "nephroid"
    summary = "A nephroid, 4 by 8 times size [m]."

    @property
    def harmonics(self) -> Harmonics:
        return (1, 3 * self.size), (3, -self.size)


@validated
class FourRing(Trigonometric):
    """Four rings around a centre: loops for ``ring`` > 1/3, four petals for ``ring`` = 1."""

    kind: Literal["four_ring"] = "four_ring"
    summary = "Four rings around a centre: loops for ring > 1/3, four petals for ring = 1."
    ring: Annotated[
        Finite,
        between(-100.0, 100.0),
        Meaning("Size of the loops relative to the curve."),
    ] = 0.7

    @property
    def harmonics(self) -> Harmonics:
        return (1, self.size), (-3, self.size * self.ring)


@validated
class Clover(Trigonometric):
    """A four-leaf clover (rose) with leaves of length ``size`` [m]; starts at ``begin``."""

    kind: Literal["clover"] = "clover"
    summary = "A four-leaf clover (rose) with leaves of length size [m]; starts at begin."
    begin: Annotated[
        Literal["tip", "centre"],
        Meaning("Where the curve begins: at a leaf's ``tip``, or in the ``centre``."),
    ] = "tip"

    @property
    def harmonics(self) -> Harmonics:
        half = self.size / 2
        if self.begin == "tip":
            return (3, half), (-1, half)
        return (3, -1j * half), (-1, 1j * half)


@validated
class Deltoid(Trigonometric):
    """A deltoid (tricuspid); ``size`` is the rolling circle's radius, a third of its reach [m]."""

    kind: Literal["deltoid"] = "deltoid"
    summary = (
        "A deltoid (tricuspid); size is the rolling circle's radius, a third of its reach [m]."
    )

    @property
    def harmonics(self) -> Harmonics:
        return (1, 2 * self.size), (-2, self.size)


_RIGHT_TURNS = (1 + 0j, -1j, -1 + 0j, 1j)


@validated
class Square(Planar):
    """A square, clockwise as seen with the plane's x to the right and y up."""

    kind: Literal["square"] = "square"
    summary = "A square, clockwise as seen with the plane's x to the right and y up."
    size: Annotated[Length, Meaning("Side length.", unit="m")]
    corners: Annotated[
        Literal["sharp", "rounded"],
        Meaning(
            '"sharp": four segments, from corner to corner. "rounded": one segment; the '
            "phase is proportional to the arc length, and the point starts at the end of a "
            "corner, on the edge along -x.",
        ),
    ] = "sharp"
    corner_radius: Annotated[
        Positive | None,
        Meaning("Radius of rounded corners, at most half the side.", unit="m"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.corners == "sharp" and self.corner_radius is not None:
            raise ValueError("corner_radius: only with corners: rounded")
        if self.corners == "rounded" and self.corner_radius is None:
            raise ValueError("corner_radius: must be given with corners: rounded")
        if self._radius > self.size / 2:
            raise ValueError(
                f"corner_radius: may be at most half the side, {self.size / 2:g}, "
                f"not {self._radius:g}"
            )

    @property
    def segments(self) -> int:
        """Number of segments, four with sharp corners and otherwise one."""
        return 4 if self.corners == "sharp" else 1

    @property
    def bends(self) -> tuple[float, ...]:
        """Phases at which the straight parts and the rounded corners meet [rad]."""
        if self.corners == "sharp":
            return ()
        straight, quarter = self._lengths
        return tuple(TURN / 4 * (i + x) for i in range(4) for x in (0.0, straight / quarter))

    @cached_property
    def _radius(self) -> float:
        return self.corner_radius or 0.0

    @cached_property
    def _lengths(self) -> tuple[float, float]:
        """Lengths of a straight part, and of a straight part with a corner [m]."""
        straight = self.size - 2 * self._radius
        return straight, straight + math.pi / 2 * self._radius

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        straight, quarter = self._lengths
        edges = phase / (TURN / 4)
        edge = min(int(edges), 3)
        direction = _RIGHT_TURNS[edge]
        way = (edges - edge) * quarter
        rate = quarter / (TURN / 4)
        if way < straight or self._radius == 0.0:
            z = complex(straight / 2 - way, -self.size / 2)
            return direction * z, -direction * rate, 0j
        spoke = direction * exp(-1j * (math.pi / 2 + (way - straight) / self._radius))
        z = direction * complex(-straight, -straight) / 2 + self._radius * spoke
        return z, -1j * spoke * rate, -spoke / self._radius * rate**2


def _pair(side: Array) -> Array:
    if side.size != 2:
        raise ValueError(f"must have 2 entries, not {side.size}")
    if not side.any():
        raise ValueError("must not be zero")
    return side


Side = Annotated[Vector, AfterValidator(_pair)]


@validated
class Parallelogram(Planar):
    """A parallelogram along the first of its two ``sides`` [m], then the second, and back."""

    kind: Literal["parallelogram"] = "parallelogram"
    summary = "A parallelogram along the first of its two sides [m], then the second, and back."
    sides: Annotated[
        tuple[Side, Side],
        Meaning("The two sides as vectors in the plane, shape (2, 2).", unit="m"),
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        u, v = self.sides
        if abs(u[0] * v[1] - u[1] * v[0]) < 1e-9 * np.linalg.norm(u) * np.linalg.norm(v):
            raise ValueError(f"sides: must not be parallel, as {u.tolist()} and {v.tolist()} are")

    @property
    def segments(self) -> int:
        """Four segments, one per edge."""
        return 4

    @cached_property
    def _edges(self) -> tuple[tuple[complex, complex], ...]:
        """Start point and vector of each edge [m]."""
        u, v = (complex(*side) for side in self.sides)
        return (-(u + v) / 2, u), ((u - v) / 2, v), ((u + v) / 2, -u), ((v - u) / 2, -v)

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        edges = phase / (TURN / 4)
        edge = min(int(edges), 3)
        start, side = self._edges[edge]
        return start + (edges - edge) * side, side / (TURN / 4), 0j


# Height, position S and width of each bump on the circle.
_BUMPS = (
    (0.4, 0.32 * math.pi, 0.17),
    (0.4, 0.68 * math.pi, 0.17),
    (-0.12, 0.5 * math.pi, 0.2),
    (-0.1, 1.5 * math.pi, 0.5),
    (-0.1, -0.5 * math.pi, 0.5),
)


@validated
class Cat(Planar):
    """A cat's head of radius ``size`` [m], ears up along the plane's y."""

    kind: Literal["cat"] = "cat"
    summary = "A cat's head of radius size [m], ears up along the plane's y."
    size: Annotated[Length, Meaning("Radius of the head, without the ears.", unit="m")]

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        S = phase - math.pi / 2
        R, dR, ddR = 1.0, 0.0, 0.0
        for height, place, width in _BUMPS:
            u = (S - place) / width
            bump = height * math.exp(-0.5 * u * u)
            R += bump
            dR -= bump * u / width
            ddR += bump * (u * u - 1.0) / (width * width)
        a = self.size * exp(1j * S)
        return a * R, a * complex(dR, R), a * complex(ddR - R, 2.0 * dR)
