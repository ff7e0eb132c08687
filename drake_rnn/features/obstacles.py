"""The section ``obstacles``: what an arm is to stay clear of, and how it moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..paths import Path, PlacedPath, RelativePath
from ..robot.clearance import Clearance
from ..robot.clearance.obstacles import Obstacle
from ..systems.block import Block
from .sensing import WhiteNoise

# At how many times of a run speeds are looked at, and what they may be beyond by.
_LOOKED, _ROUNDING = 4001, 1e-9


#: Makes the path that a section of a document describes, of a key.
MakePath = Callable[[Mapping[str, Any], str], Path]


def obstacle_motions(
    obstacles: Sequence[Obstacle],
    clearance: Clearance | None,
    duration: float,
    make_path: MakePath,
) -> ObstacleMotions | None:
    """Return how the obstacles move that may, in the order of their signal; None without any.

    Args:
        obstacles: The obstacles, in the order of the document.
        clearance: What the arm is to stay clear of, which counts those that may move.
        duration: Duration of the run [s].
        make_path: Makes the path of an obstacle.

    Raises:
        InvalidInputError: If a path is wrong, has a place of its own, or leads faster than the
            speed that is counted on.
    """
    if clearance is None or not clearance.solids.moving.size:
        return None
    numbers = {obstacle.name: k for k, obstacle in enumerate(obstacles)}
    found = [numbers[clearance.solids.names[k]] for k in clearance.solids.moving]
    ordered = [(f"obstacles[{k}]", obstacles[k]) for k in found]
    paths = tuple(_path(key, each, duration, make_path) for key, each in ordered)
    return ObstacleMotions(paths, np.array([each.error for _, each in ordered]))


def _path(key: str, obstacle: Obstacle, duration: float, make_path: MakePath) -> PlacedPath | None:
    if obstacle.moves is None or obstacle.speed is None:
        return None
    path = make_path(obstacle.moves, f"{key}.moves")
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


@dataclass(frozen=True, eq=False)
class ObstacleMotions:
    """How far obstacles have gone from where they are stated.

    Attributes:
        paths: The path of each of the m obstacles that may move; None for one that does not.
        errors: Largest error of each one's measured position, shape (m,) [m].
    """

    paths: tuple[PlacedPath | None, ...]
    errors: Array

    def at(self, t: float) -> Array:
        """Return p_WO, shape (m, 3) [m].

        Args:
            t: Time [s].
        """
        p_WO = np.zeros((len(self.paths), 3))
        for k, path in enumerate(self.paths):
            if path is not None:
                p_WO[k] = path.position(t)[0] - path.position(0.0)[0]
        return p_WO

    def along(self, times: Array) -> Array:
        """Return p_WO at times, shape (k, m, 3) [m]."""
        return np.array([self.at(float(t)) for t in times]).reshape(-1, len(self.paths), 3)


class ObstacleSource(Block):
    """Source of where obstacles are measured to be: the output ``p_WO``, shape (m * 3,) [m].

    Each one's position has the largest error that it may have, in a direction of its own at each
    sample.

    Args:
        motions: How the obstacles move.
        period: Sampling period [s].
        seed: Seed of the errors.
    """

    def __init__(self, motions: ObstacleMotions, period: float, seed: int = 0) -> None:
        super().__init__()
        size = 3 * len(motions.paths)
        noise = WhiteNoise(size, seed, stream=5)

        def measured(context: Context, output: Any) -> None:
            t = context.get_time()
            away = noise.sample(round(t / period)).reshape(-1, 3)
            away = away / np.linalg.norm(away, axis=1, keepdims=True)
            output.set_value((motions.at(t) + motions.errors[:, None] * away).ravel())

        self.DeclareVectorOutputPort("p_WO", size, measured, {self.time_ticket()})
