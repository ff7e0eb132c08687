"""What every surface has that a tool may be pressed against."""

# No postponed annotations: older pydantic looks for inherited ones in the subclass's module.
import numpy as np
from pydantic import Field

from ..inputs.fields import Array, Finite, Point, validated


def _up() -> Array:
    up = np.array([0.0, 0.0, 1.0])
    up.setflags(write=False)
    return up


@validated
class Surface:
    """A plane below the tool.

    Args:
        normal: Out of the surface, towards the tool, in the base frame; of any length.
        gap: Distance of the tool from the surface at the start, along the normal [m];
            negative for a tool that is pressed in.
        believed_normal: What the law takes for the normal; by default the normal itself.
    """

    normal: Point = Field(default_factory=_up)
    gap: Finite = 0.0
    believed_normal: Point | None = None

    def __post_init__(self) -> None:
        for name, vector in (("normal", self.normal), ("believed_normal", self.believed_normal)):
            if vector is not None and not np.linalg.norm(vector) > 0.0:
                raise ValueError(f"{name}: must point somewhere, not be {vector.tolist()}")
        if not self.believed_normal_W.dot(self.normal_W) > 0.0:
            # Who presses the other way sees no force, and presses on.
            raise ValueError(
                "believed_normal: must be less than a right angle from the normal, "
                f"{self.normal.tolist()}, not {np.asarray(self.believed_normal).tolist()}"
            )

    @property
    def normal_W(self) -> Array:
        """The normal, of length 1, shape (3,)."""
        return np.asarray(self.normal / np.linalg.norm(self.normal))

    @property
    def believed_normal_W(self) -> Array:
        """The normal that the law takes for true, of length 1, shape (3,)."""
        if self.believed_normal is None:
            return self.normal_W
        return np.asarray(self.believed_normal / np.linalg.norm(self.believed_normal))
