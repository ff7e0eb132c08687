"""A camera that sees points on a tool, and other cameras that may come in its place."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.fields import Array, Length, NonNegative, Point, Positive, between, validated, zeros
from ..inputs.keys import Meaning
from .pinhole import Pinhole

# Sample times carry rounding errors [s].
_ROUNDING = 1e-9
# Largest noise that leaves anything to see [px].
_Noise = Annotated[NonNegative, between(0.0, 100.0)]


@validated
class CameraSwap(Pinhole):
    """A camera that comes in place of the former one, all at once."""

    time: Annotated[Positive, Meaning("Time from which on it is the one that sees.", unit="s")]


@validated
class ToolCamera(Pinhole):
    """A camera that sees points on a tool.

    A law with ``points`` sees pixels in place of the end effector's position, and is told
    ``pixel_size`` alone: nothing of where the camera is, of its lens, or of where the points are.
    """

    points: Annotated[
        Annotated[list[Point], Field(min_length=1, max_length=3)],
        Meaning(
            "Positions of one to three points on the tool in its frame E, shape (3,) each.",
            unit="m",
        ),
    ] = Field(default_factory=lambda: [zeros()])
    noise: Annotated[
        _Noise,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of each pixel.",
            unit="px",
        ),
    ] = 0.0
    pixel_size: Annotated[
        Length,
        Meaning(
            "What a pixel is taken to be at the tool [m]: the way between two points that the "
            "camera sees a pixel apart, as well as it is known.",
            unit="m",
        ),
    ] = 1e-3
    swaps: Annotated[
        list[CameraSwap],
        Meaning("Cameras that come in place of this one, in order."),
    ] = Field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        for number in range(1, len(self.points)):
            for other in range(number):
                if np.array_equal(self.points[number], self.points[other]):
                    raise InvalidInputError(
                        f"camera.points.{number}: must differ from points.{other}, "
                        f"{self.points[other].tolist()}"
                    )
        times = [swap.time for swap in self.swaps]
        for number, (before, after) in enumerate(pairwise(times), start=1):
            if after <= before:
                raise InvalidInputError(
                    f"camera.swaps.{number}.time: must be after that of the swap before it, "
                    f"{before:g} s, not {after:g}"
                )

    @cached_property
    def size(self) -> int:
        """Number of coordinates of all pixels, two for each point."""
        return 2 * len(self.points)

    @property
    def cameras(self) -> tuple[Pinhole, ...]:
        """All cameras, in the order in which they see."""
        return (self, *self.swaps)

    @property
    def swapped(self) -> tuple[float, float] | None:
        """Times of the first and the last swap [s]; None without one."""
        return (self.swaps[0].time, self.swaps[-1].time) if self.swaps else None

    def at(self, t: float) -> Pinhole:
        """Return the camera that sees at a time.

        Args:
            t: The time [s].
        """
        number = sum(t >= swap.time - _ROUNDING for swap in self.swaps)
        return self.cameras[number]

    def pixels(self, t: float, p_WE: Array, R_WE: Array) -> Array:
        """Return the pixels of the points, one point after the other, shape (size,) [px].

        Args:
            t: Time, which says which camera sees [s].
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        return self.at(t).seen(self.placed(p_WE, R_WE)).ravel()

    def tool_J(self, t: float, p_WE: Array, R_WE: Array, J_omega: Array, J: Array) -> Array:
        """Return the image Jacobian, shape (size, n) [px/rad].

        Args:
            t: Time, which says which camera sees [s].
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).
            J_omega: Jacobian of its rotation, shape (3, n).
            J: Jacobian of its position, shape (3, n) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        points = self.placed(p_WE, R_WE)
        arms = (points - p_WE)[:, None, :]
        # Each joint moves a point along with E, and round it.
        moved = J.T + np.cross(J_omega.T, arms)
        seen = self.at(t).J(points) @ np.swapaxes(moved, -1, -2)
        return seen.reshape(self.size, -1)

    def tool_margin(self, t: float, pixels: Array) -> float:
        """Return how far the points are from the image's edge [px], less than 0 out of it.

        Args:
            t: Time, which says which camera sees [s].
            pixels: Their pixels, shape (size,) [px].
        """
        return float(self.at(t).margin(pixels.reshape(-1, 2)).min())

    def placed(self, p_WE: Array, R_WE: Array) -> Array:
        """Return where the points of a tool are, shape (points, 3) [m].

        Args:
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).
        """
        return np.asarray(p_WE + self._rows @ R_WE.T)

    @cached_property
    def _rows(self) -> Array:
        return np.array(self.points)
