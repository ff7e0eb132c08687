"""How the obstacles of a document move."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.modules import Modules
from ..paths import PlacedPath, RelativePath
from ..robot.clearance.obstacles import Obstacle
from ..systems import ObstacleMotions
from .path import described_path

# At how many times of a run speeds are looked at, and what they may be beyond by.
_LOOKED, _ROUNDING = 4001, 1e-9


def obstacle_motions(
    ordered: list[tuple[int, Obstacle]], duration: float, modules: Modules
) -> ObstacleMotions:
    """Return how obstacles that may move do.

    Args:
        ordered: The obstacles with their numbers in the document, in the order of their signal.
        duration: Duration of the run [s].
        modules: Modules that may be imported for a path.

    Raises:
        InvalidInputError: If a path is wrong, has a place of its own, or leads faster than the
            speed that is counted on.
    """
    paths = tuple(_path(f"obstacles[{k}]", each, duration, modules) for k, each in ordered)
    return ObstacleMotions(paths, np.array([each.error for _, each in ordered]))


def _path(key: str, obstacle: Obstacle, duration: float, modules: Modules) -> PlacedPath | None:
    if obstacle.moves is None or obstacle.speed is None:
        return None
    path = described_path(obstacle.moves, f"{key}.moves", modules)
    if not isinstance(path, RelativePath) or path.frame != "base":
        raise InvalidInputError(
            f"{key}.moves: must be a path along the axes of the base, which begins where the "
            "obstacle is"
        )
    placed = path.placed(np.zeros(3))
    times = np.linspace(0.0, duration, _LOOKED)
    fastest = max(float(np.linalg.norm(placed.position(float(t))[1])) for t in times)
    if fastest > obstacle.speed * (1.0 + _ROUNDING):
        raise InvalidInputError(
            f"{key}.moves: reaches {fastest:.3g} m/s, where speed counts on at most "
            f"{obstacle.speed:g} m/s"
        )
    return placed
