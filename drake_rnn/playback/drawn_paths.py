"""Base classes of drawings of paths: how the page sets them up, draws and records them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

from pydrake.geometry import MeshcatAnimation

from ..inputs.fields import Array
from .curves import Curves
from .packing import rounded
from .views import View


class Label(NamedTuple):
    """A name and a line below it, which the page keeps below a point as the view turns.

    Attributes:
        text: The name, and the line below it.
        point: The point, shape (3,) [m].
    """

    text: tuple[str, str]
    point: Array

    def as_data(self) -> dict[str, Any]:
        """Return the label as the page reads it."""
        name, told = self.text
        return {"name": name, "told": told, "point": rounded(self.point)}


class DrawnPaths(ABC):
    """A desired path and a traced one in the scene; the methods are called in this order.

    Attributes:
        legend: Scale of the force arrow; None without one.
        labels: Labels of what is drawn.
    """

    legend: str | None = None
    labels: Sequence[Label] = ()

    @abstractmethod
    def set_up(self) -> Array:
        """Draw the surface that the paths lie on, if there is one.

        Returns:
            Points that must be above the ground, shape (k, 3) [m].
        """

    @abstractmethod
    def draw(self, floor: float) -> None:
        """Draw the paths, and any stand below them, from the ground at height ``floor`` [m]."""

    @abstractmethod
    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how they move; ``time`` of each frame, shape (f,) [s]."""

    @abstractmethod
    def views(self) -> dict[str, View]:
        """Return the views "arm", "close" and "path"."""

    @abstractmethod
    def grows(self) -> list[dict[str, Any]]:
        """Return which meshes grow with time, and how."""

    def scaled(self) -> list[dict[str, Any]]:
        """Return the objects that the page draws thicker or thinner, to suit the view."""
        return []


class DrawnCurves(DrawnPaths):
    """Paths in the air, each drawn as a tube.

    Args:
        curves: The desired and the traced path of each motion.
        points: The points of all of them where they are drawn, shape (k, 3) [m].
    """

    def __init__(self, curves: Sequence[Curves], points: Array) -> None:
        self._curves = curves
        self._points = points

    def set_up(self) -> Array:
        """Return the points of all paths, which lie on no surface."""
        return self._points

    def draw(self, floor: float) -> None:
        """Draw all paths, and a ball on each; paths in the air have no stand."""
        for curves in self._curves:
            curves.draw()

    def record(self, recording: MeshcatAnimation, time: Array) -> None:
        """Record how the balls move; ``time`` of each frame, shape (f,) [s]."""
        for curves in self._curves:
            curves.record(recording, time)

    def grows(self) -> list[dict[str, Any]]:
        """Return how the traced paths grow."""
        return [grows for curves in self._curves for grows in curves.grows()]

    def scaled(self) -> list[dict[str, Any]]:
        """Return the radii of all tubes, balls and boxes."""
        return [scaled for curves in self._curves for scaled in curves.scaled()]
