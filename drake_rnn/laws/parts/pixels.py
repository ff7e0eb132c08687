"""Pixels of points on a tool, which a law that follows positions takes as positions.

A pixel is taken to be so many metres at the tool. That is a guess: where it is wrong by a factor,
the gains of the law are, and its learned Jacobian makes up for all else.
"""

from __future__ import annotations

from typing import Any

from ..layout import Signals

#: Signals of pixels, and what they are to a law that follows positions.
PIXELS = {
    "pixels": "p_WE",
    "pixels_desired": "p_WE_desired",
    "pixels_preview": "p_preview",
}
#: Share of the softness that suits errors of positions which suits those of pixels: what turns
#: several points is seen less, and a task as soft as for positions gives that up.
FIRMER = 0.1


def in_metres(u: Signals, pixel_size: Any) -> Signals:
    """Return signals with the positions that pixels are taken to be [m].

    Args:
        u: Signals, of which pixels have the shape (..., 2 k), two for each point.
        pixel_size: What a pixel is taken to be at the tool [m].
    """
    return {**u, **{name: pixel_size * u[pixels] for pixels, name in PIXELS.items()}}
