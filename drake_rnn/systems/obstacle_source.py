"""Obstacles that move, and where they are measured to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..inputs.fields import Array
from ..paths import PlacedPath
from .block import Block
from .white_noise import WhiteNoise


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
