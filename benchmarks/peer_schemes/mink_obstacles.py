"""mink among obstacles: its limit of the velocities at which geometries approach each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import mink
import mujoco
import numpy as np

from drake_rnn import Array
from peer_schemes.mink_scheme import MinkBounded
from peer_schemes.obstacle_scheme import ObstacleScheme
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.scheme import in_the_middle
from peer_schemes.shapes import Shape, Shapes

# Farther than any two geometries that are compared [m].
_FAR = 10.0


class MinkAmong(in_the_middle(MinkBounded), ObstacleScheme):
    """Mink, linearised at the middle of the sample, with `CollisionAvoidanceLimit`.

    The limit bounds the way of a step by gain x distance / period, so that in terms of a barrier
    its rate is gain / period^2.
    """

    name = "mink"
    setting = "CollisionAvoidanceLimit, a limit of the user's own for the acceleration"
    chosen: ClassVar[Mapping[str, Any]] = {"gain": 2e-6, "minimum_distance": 0.02, "detection": 0.2}
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {
        "gain": (0.85, 2e-6, 5e-6),
        "minimum_distance": (0.01, 0.02),
        "detection": (0.2,),
    }

    def __init__(self, task: ObstacleTask) -> None:
        self._shapes = Shapes(task)
        super().__init__(task)
        model = self._configuration.model
        self._limits.append(
            mink.CollisionAvoidanceLimit(
                model,
                [([a], [b]) for a, b in self._shapes.pairs],
                gain=self.chosen["gain"],
                minimum_distance_from_collisions=self.chosen["minimum_distance"],
                collision_detection_distance=self.chosen["detection"],
            )
        )

    def _compiled(self, urdf: str) -> mujoco.MjModel:
        spec = mujoco.MjSpec.from_string(urdf)
        for shape in self._shapes.arm:
            _add(spec.body(shape.link), shape)
        for shape in self._shapes.obstacles:
            _add(spec.worldbody, shape)
        return spec.compile()

    def gaps(self, q: Array) -> Array:
        self.pose(q)
        model, data = self._configuration.model, self._configuration.data
        ids = [[model.geom(name).id for name in pair] for pair in self._shapes.pairs]
        return np.array([mujoco.mj_geomDistance(model, data, *pair, _FAR, None) for pair in ids])


def _add(body: mujoco.MjsBody, shape: Shape) -> None:
    kinds = mujoco.mjtGeom
    if shape.size is not None:
        kind, size = kinds.mjGEOM_BOX, 0.5 * shape.size
    elif shape.length == 0.0:
        kind, size = kinds.mjGEOM_SPHERE, [shape.radius, 0.0, 0.0]
    else:
        kind, size = kinds.mjGEOM_CAPSULE, [shape.radius, 0.5 * shape.length, 0.0]
    body.add_geom(
        name=shape.name,
        type=kind,
        size=size,
        pos=shape.X_LS.translation(),
        quat=shape.X_LS.rotation().ToQuaternion().wxyz(),
    )


SCHEMES = (MinkAmong,)
