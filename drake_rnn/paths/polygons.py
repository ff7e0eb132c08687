"""Curves of straight edges: the square, its corners sharp or rounded, and the parallelogram."""

from __future__ import annotations

import math
from cmath import exp
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator

from ..inputs.fields import Array, Length, Positive, Vector, validated
from ..inputs.keys import Meaning
from .curve import TURN
from .planar import Planar

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
        """Number of segments: four with sharp corners, otherwise one."""
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
        turned = _RIGHT_TURNS[edge]
        way = (edges - edge) * quarter
        rate = quarter / (TURN / 4)
        if way < straight or self._radius == 0.0:
            z = complex(straight / 2 - way, -self.size / 2)
            return turned * z, -turned * rate, 0j
        spoke = turned * exp(-1j * (math.pi / 2 + (way - straight) / self._radius))
        z = turned * complex(-straight, -straight) / 2 + self._radius * spoke
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
        """Number of segments: four, one per edge."""
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
