"""placo among obstacles: its constraint against self-collisions, obstacles in the arm's URDF."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np
import placo

from drake_rnn import Array
from peer_schemes.obstacle_scheme import ObstacleScheme
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.placo_scheme import Placo
from peer_schemes.scheme import in_the_middle
from peer_schemes.shapes import Shapes


class PlacoAmong(in_the_middle(Placo), ObstacleScheme):
    """Placo, linearised at the middle of the sample, with `AvoidSelfCollisions` as a hard one."""

    name = "placo"
    setting = "hard"
    priority: ClassVar[str] = "hard"
    chosen: ClassVar[Mapping[str, Any]] = {"margin": 0.02, "trigger": 0.03}
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {
        "margin": (0.005, 0.01, 0.02),
        "trigger": (0.03, 0.1),
    }

    def __init__(self, task: ObstacleTask) -> None:
        self._shapes = Shapes(task)
        super().__init__(task)
        avoided = self._solver.add_avoid_self_collisions_constraint()
        avoided.configure("avoid", self.priority, self.chosen.get("weight", 1.0))
        avoided.self_collisions_margin = self.chosen["margin"]
        avoided.self_collisions_trigger = self.chosen["trigger"]

    def _read(self, task: ObstacleTask) -> placo.RobotWrapper:
        with TemporaryDirectory() as folder:
            file, pairs = Path(folder) / "arm.urdf", Path(folder) / "pairs.json"
            file.write_text(self._shapes.urdf)
            pairs.write_text(json.dumps(self._shapes.pairs))
            robot = placo.RobotWrapper(str(file))
            robot.load_collision_pairs(str(pairs))
        return robot

    def gaps(self, q: Array) -> Array:
        self.pose(q)
        return np.array([distance.min_distance for distance in self._robot.distances()])


class PlacoSoft(PlacoAmong):
    """The same as a soft constraint, as placo's users are told to have it."""

    name = "placo, soft"
    setting = "soft"
    priority = "soft"
    chosen: ClassVar[Mapping[str, Any]] = {"margin": 0.03, "trigger": 0.03, "weight": 0.01}
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {
        "margin": (0.01, 0.02, 0.03),
        "trigger": (0.03,),
        "weight": (0.01, 1.0, 100.0),
    }


SCHEMES = (PlacoAmong, PlacoSoft)
