r"""A pinhole camera: where a point of the world is in its image.

The camera's frame C has its origin in the lens, x to the right of the image, y down and z forward,
as OpenCV and Drake have it. A point at (x, y, z) in C is seen at

.. math:: u = c_u + f x / z, \qquad v = c_v + f y / z

in pixels from the image's upper left corner, with the focal length f and the principal point c.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError, OldName
from ..inputs.fields import Angle, Array, Finite, Point, Positive, between, validated, zeros
from ..inputs.keys import Meaning

#: Depth from which on a point is in front of a camera [m].
NEAR = 0.01
# Of cameras with wide and with long lenses [px].
_Focal = Annotated[Positive, between(1.0, 1e5)]
_Pixels = Annotated[int, Field(strict=True, ge=1, le=100_000)]


@validated
class Pinhole:
    """A camera without distortion.

    Where it is fixed to another frame than the world, that one is meant where W is said.
    """

    position: Annotated[Point, Meaning("Position of the lens in W, shape (3,).", unit="m")]
    look_at: Annotated[
        Point,
        Meaning("Point in W that is seen at the principal point, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    roll: Annotated[
        Angle,
        Meaning(
            "Turn of the camera about the way it looks; at 0 the image's vertical is upright in W.",
            unit="rad",
        ),
    ] = 0.0
    focal_length: Annotated[_Focal, Meaning("Focal length.", unit="px")] = 600.0
    image_size: Annotated[
        tuple[_Pixels, _Pixels],
        Meaning("Width and height of the image.", unit="px"),
    ] = (640, 480)
    principal_point: Annotated[
        tuple[Finite, Finite] | None,
        Meaning("Where the way that it looks meets the image; by default the middle.", unit="px"),
    ] = None

    def __post_init__(self) -> None:
        if np.linalg.norm(self.look_at - self.position) < NEAR:
            raise ValueError(
                f"look_at: must be {NEAR:g} m or more from position, not {self.look_at.tolist()}"
            )

    @cached_property
    def R_WC(self) -> Array:
        """Orientation of the camera's frame in W, shape (3, 3)."""
        z = self.look_at - self.position
        z = z / np.linalg.norm(z)
        # Straight down or up, the image's vertical is along W's x axis.
        upright = np.abs(z[2]) < 1.0 - 1e-9
        x = np.cross(z, [0.0, 0.0, 1.0] if upright else [1.0, 0.0, 0.0])
        x /= np.linalg.norm(x)
        y = np.cross(z, x)
        c, s = np.cos(self.roll), np.sin(self.roll)
        return np.stack((c * x + s * y, c * y - s * x, z), axis=1)

    @property
    def center(self) -> Array:
        """The principal point, shape (2,) [px]."""
        if self.principal_point is not None:
            return np.array(self.principal_point)
        return 0.5 * np.array(self.image_size)

    def depth(self, p_WP: Array) -> Array:
        """Return how far points are in front of the lens, shape (...) [m].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].
        """
        return np.asarray((p_WP - self.position) @ self.R_WC[:, 2])

    def project(self, p_WP: Array) -> Array:
        """Return where points are in the image, shape (..., 2) [px].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        p_CP = self._in_camera(p_WP)
        return np.asarray(self.center + self.focal_length * p_CP[..., :2] / p_CP[..., 2:])

    def J(self, p_WP: Array) -> Array:
        """Return the derivatives of `seen` by the positions, shape (..., 2, 3) [px/m].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        p_CP = self._in_camera(p_WP)
        x, y, z = np.moveaxis(p_CP, -1, 0)
        none, one = np.zeros_like(z), np.ones_like(z)
        rows = np.stack((one, none, -x / z, none, one, -y / z), axis=-1)
        rows = rows.reshape(*z.shape, 2, 3) * (self.focal_length / z)[..., None, None]
        return np.asarray(rows @ self.R_WC.T)

    def margin(self, pixels: Array) -> Array:
        """Return how far points are from the image's edge [px], less than 0 where out of it.

        Args:
            pixels: Where they are in the image, shape (..., 2) [px].
        """
        return np.minimum(pixels, np.array(self.image_size) - pixels).min(axis=-1)

    def _in_camera(self, p_WP: Array) -> Array:
        p_CP = (p_WP - self.position) @ self.R_WC
        if not (nearest := p_CP[..., 2].min()) >= NEAR:
            raise InvalidInputError(
                f"camera: a point is {nearest:.3g} m in front of the camera at "
                f"{self.position.tolist()}, and is seen from {NEAR:g} m on"
            )
        return np.asarray(p_CP)

    seen = OldName("project")
