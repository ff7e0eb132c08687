"""pink among obstacles: its barrier against self-collisions, obstacles as geometry of the base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import pinocchio
from pink import Configuration
from pink.barriers import SelfCollisionBarrier

from drake_rnn import Array
from peer_schemes.obstacle_scheme import ObstacleScheme
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.pink_scheme import Pink
from peer_schemes.scheme import in_the_middle
from peer_schemes.shapes import Shapes


class PinkAmong(in_the_middle(Pink), ObstacleScheme):
    """Pink, linearised at the middle of the sample, with `SelfCollisionBarrier`."""

    name = "pink"
    setting = "SelfCollisionBarrier"
    chosen: ClassVar[Mapping[str, Any]] = {
        "n_collision_pairs": 30,
        "gain": 2.0,
        "d_min": 0.01,
        "safe_displacement_gain": 1e-4,
    }
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {
        "n_collision_pairs": (10, 30),
        "gain": (2.0,),
        "d_min": (0.01,),
        "safe_displacement_gain": (0.0, 1e-4),
    }

    def __init__(self, task: ObstacleTask) -> None:
        super().__init__(task)
        self._barriers = (SelfCollisionBarrier(**self.chosen),)

    def _configured(self, model: pinocchio.Model, task: ObstacleTask) -> Configuration:
        shapes = Shapes(task)
        with_shapes = pinocchio.buildModelFromXML(shapes.urdf)
        for limit in ("velocityLimit", "lowerPositionLimit", "upperPositionLimit"):
            setattr(with_shapes, limit, getattr(model, limit))
        geometry = pinocchio.buildGeomFromUrdfString(
            with_shapes, shapes.urdf, pinocchio.GeometryType.COLLISION
        )
        for pair in shapes.pairs:
            # Pinocchio numbers the geometries of a link.
            ids = (geometry.getGeometryId(f"{name}_0") for name in pair)
            geometry.addCollisionPair(pinocchio.CollisionPair(*ids))
        return Configuration(
            with_shapes, with_shapes.createData(), task.start,
            collision_model=geometry, collision_data=geometry.createData(),
        )  # fmt: skip

    def gaps(self, q: Array) -> Array:
        self.pose(q)
        results = self._configuration.collision_data.distanceResults
        return np.array([result.min_distance for result in results])


SCHEMES = (PinkAmong,)
