"""OInK among obstacles: its barrier against self-collisions, obstacles in the arm's URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, ClassVar

import numpy as np
from roboplan.core import Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import SelfCollisionBarrier, SelfCollisionBarrierOptions

from drake_rnn import Array
from peer_schemes.obstacle_scheme import ObstacleScheme
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.roboplan_scheme import OInK
from peer_schemes.scheme import in_the_middle
from peer_schemes.shapes import Shapes


class OInKAmong(in_the_middle(OInK), ObstacleScheme):
    """OInK, linearised at the middle of the sample, with `SelfCollisionBarrier`."""

    name = "OInK"
    setting = "SelfCollisionBarrier, ProxQP to 1e-9"
    solver: ClassVar[dict[str, float]] = {"eps_abs": 1e-9, "max_iter": 200}
    chosen: ClassVar[Mapping[str, Any]] = {
        "n_collision_pairs": 30,
        "gain": 2.0,
        "d_min": 0.01,
        "safe_displacement_gain": 1.0,
    }
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {
        "n_collision_pairs": (10, 30),
        "gain": (2.0,),
        "d_min": (0.01,),
        "safe_displacement_gain": (0.0, 1.0),
    }

    def __init__(self, task: ObstacleTask) -> None:
        super().__init__(task)
        options = SelfCollisionBarrierOptions(**self.chosen)
        self._barriers.append(SelfCollisionBarrier(self._oink, self._scene, task.period, options))

    def _read(self, task: ObstacleTask) -> Scene:
        shapes = Shapes(task)
        scene = Scene("arm", loadUrdfSceneDescriptionFromXml(shapes.urdf))
        named = {frozenset(pair) for pair in shapes.pairs}
        every = [shape.name for shape in (*shapes.arm, *shapes.obstacles)]
        scene.setCollisions(
            [pair for pair in combinations(every, 2) if frozenset(pair) not in named], False
        )
        return scene

    def gaps(self, q: Array) -> Array:
        """OInK shows no distances."""
        return np.full(self.task.clearance.count, np.nan)


SCHEMES = (OInKAmong,)
