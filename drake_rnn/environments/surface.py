"""The base class of all surfaces that a tool can be pressed against."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from typing import Annotated

import numpy as np
from pydantic import Field

from ..inputs.fields import Array, Finite, Point, validated
from ..inputs.keys import Meaning


def _up() -> Array:
    up = np.array([0.0, 0.0, 1.0])
    up.setflags(write=False)
    return up


@validated
class Surface:
    """A plane below the tool."""

    normal: Annotated[
        Point,
        Meaning(
            "Normal out of the surface, towards the tool, in the base frame, shape (3,); of any "
            "length.",
        ),
    ] = Field(default_factory=_up)
    gap: Annotated[
        Finite,
        Meaning(
            "Distance of the tool from the surface at the start, along the normal; negative for "
            "a tool that is pressed in.",
            unit="m",
        ),
    ] = 0.0
    believed_normal: Annotated[
        Point | None,
        Meaning("Normal that the law assumes, shape (3,); by default the true one."),
    ] = None

    #: Whether it is a plane, on which a path must lie.
    is_plane = True

    def __post_init__(self) -> None:
        for name, vector in (("normal", self.normal), ("believed_normal", self.believed_normal)):
            if vector is not None and not np.linalg.norm(vector) > 0.0:
                raise ValueError(f"{name}: must not be zero")
        if not self.believed_normal_W.dot(self.normal_W) > 0.0:
            # A law that presses in the opposite direction would measure no force and keep moving.
            raise ValueError(
                "believed_normal: must be less than a right angle from the normal, "
                f"{self.normal.tolist()}, not {np.asarray(self.believed_normal).tolist()}"
            )

    @property
    def normal_W(self) -> Array:
        """Unit normal in the base frame, shape (3,)."""
        return np.asarray(self.normal / np.linalg.norm(self.normal))

    @property
    def believed_normal_W(self) -> Array:
        """Unit normal that the law assumes, in the base frame, shape (3,)."""
        if self.believed_normal is None:
            return self.normal_W
        return np.asarray(self.believed_normal / np.linalg.norm(self.believed_normal))

    def overhang(self, points: Array, p_WS: Array) -> float:
        """Return how far ``points`` lie beyond its edges [m]; 0 for a surface without edges.

        Args:
            points: Points in the base frame, shape (k, 3) [m].
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """
        return 0.0
