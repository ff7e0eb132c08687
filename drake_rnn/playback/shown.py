"""What a page shows beside the arm."""

from __future__ import annotations

from typing import Protocol

from pydrake.geometry import Meshcat, MeshcatAnimation

from ..inputs.fields import Array
from .camera import Boxes
from .free_motion import FreeMotion
from .pressing import pressing_of
from .replayed_motion import ReplayedMotion
from .surface_drawing import SurfaceDrawing


class Shown(Protocol):
    """A path that is desired, and one that is traced."""

    def set_up(self, meshcat: Meshcat) -> Array:
        """Draw what it lies on, if anything.

        Returns:
            Points above the ground, shape (k, 3) [m].
        """

    def aim(self, meshcat: Meshcat) -> None:
        """Put the camera where it is seen best."""

    def draw(self, meshcat: Meshcat) -> None:
        """Put it into the scene."""

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Let it move, with frames at these times, shape (f,) [s]."""

    @property
    def legend(self) -> str | None:
        """What an arrow means, if there is one."""


def shown_of(motion: ReplayedMotion, boxes: Boxes) -> Shown:
    """Of a tool in the air, the paths there; of one on a surface, what it draws."""
    pressing = pressing_of(motion)
    if pressing is None:
        return FreeMotion(motion, boxes)
    return SurfaceDrawing(motion, boxes, pressing)
