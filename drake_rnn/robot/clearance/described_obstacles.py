"""The obstacles that a document describes: single shapes, and those of model files."""

from __future__ import annotations

from typing import Any

from ...inputs.complaints import require_several
from . import obstacles
from .model_obstacle import ModelObstacle
from .obstacles import Obstacle

#: Their classes by kind.
KINDS = {**obstacles.OBSTACLES, "model": ModelObstacle}


def make_obstacles(given: list[Any]) -> list[Obstacle]:
    """Return the obstacles of a document, each a single shape; a model consists of several.

    Args:
        given: For each, its ``kind`` and fields.

    Raises:
        InvalidInputError: If there are too many, a kind is unknown, a field is wrong, or a file
            cannot be read or has joints that move.
    """
    require_several("obstacles", given)
    return obstacles.make_obstacles(given, KINDS)
