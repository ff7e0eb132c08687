"""A cat's head: a circle with bumps; `drake_rnn.paths` gives the formula."""

from __future__ import annotations

import math
from cmath import exp
from typing import Annotated, Literal

from ..inputs.fields import Length, validated
from ..inputs.keys import Meaning
from .planar import Planar

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
