"""Curves that are sums of harmonics: circle, nephroid, four-ring, clover and deltoid."""

from __future__ import annotations

from abc import abstractmethod
from cmath import exp
from functools import cached_property
from typing import Annotated, Literal

from ..inputs.fields import Finite, Length, between, validated
from ..inputs.keys import Meaning
from .planar import Planar

Harmonics = tuple[tuple[int, complex], ...]


@validated
class Trigonometric(Planar):
    """A curve z(f) that is the sum of c exp(i k f) over its ``harmonics`` (k, c)."""

    size: Annotated[
        Length,
        Meaning("Scale of the curve; each class says what it is the length of [m].", unit="m"),
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
