"""What a camera sees of a tool, step by step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..inputs.fields import Array


@dataclass(frozen=True)
class ImageMotion:
    """Pixels of points on a tool over k steps.

    Attributes:
        pixels: Pixels of the points, one point after the other, shape (k, 2 points) [px].
        desired: Their desired values, likewise.
        J: Image Jacobian, of pixels that are taken to be metres, shape (k, 2 points, n) [m].
        margin: How far the points are from the edge of the image, shape (k,) [px]; less than 0
            where one is out of it.
        swapped: Times at which the camera is swapped first and last [s]; None if it never is.
    """

    pixels: Array
    desired: Array
    J: Array
    margin: Array
    swapped: tuple[float, float] | None

    @cached_property
    def error(self) -> Array:
        """Distance of each point from where it is to be seen, shape (k, points) [px]."""
        away = (self.pixels - self.desired).reshape(len(self.pixels), -1, 2)
        return np.asarray(np.linalg.norm(away, axis=-1))

    @cached_property
    def farthest(self) -> Array:
        """Distance of the point that is farthest off, shape (k,) [px]."""
        return np.asarray(self.error.max(axis=-1))
