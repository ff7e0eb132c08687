"""Labels of things in the scene: text of the page that stays beside its point as the view turns."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..inputs.fields import Array
from .packing import rounded


class Label(NamedTuple):
    """A name and a line below it, centred below a point of the scene.

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
