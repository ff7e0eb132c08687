"""The tasks among obstacles: random balls, an arm led into itself, a tool led into walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from avoidance import document, scene
from drake_rnn import Array, Experiment, Path, TrajectoryPath, load_experiment
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.clearance.capsules import Solids
from drake_rnn.robot.clearance.obstacles import Obstacle, make_obstacles
from peer_schemes.tasks import Task

#: The law of ours that all tasks are stated for.
BASE = "adaptive_nephroid_known"
BALLS, ITSELF, WALLS, FAR = "balls", "itself", "walls", "far"
# The time between the knots of a path's spline [s].
_KNOTS = 0.05
# How long the nephroid is followed, of which a lap takes 8 s [s].
_NEPHROID = 6.0
# How far balls are from the arm at the start that it is not to notice [m].
_FAR = 0.3
# How far the tool is led into the arm's own base, and how long once there and back takes.
_INTO_ITSELF, _THERE_AND_BACK = 0.25, 6.0
# How far the tool is led to the side and down, how long each takes, and how far the walls are from
# its nearest capsule when it starts.
_ASIDE, _DOWN, _EACH, _WALL, _TABLE = 0.1, 0.2, 4.0, 0.015, 0.05


class ObstacleTask(Task):
    """A position to follow, with something in the way.

    Args:
        name: Its name.
        changes: Changes to the document of `BASE`, obstacles among them.
        lap: Time in which the path is passed once [s].
        path: Path made in Python, in place of that of the experiment; None without one.

    Attributes:
        clearance: The arm's capsules and the obstacles, which judge every scheme.
        obstacles: The obstacles.
        blind: The same experiment with a law that keeps its bounds and avoids nothing.
    """

    def __init__(
        self, name: str, changes: dict[str, Any], lap: float, path: Path | None = None
    ) -> None:
        experiment = load_experiment(BASE, changes)
        super().__init__(name, experiment, lap, oriented=False, path=path)
        assert self.experiment.clearance is not None
        self.clearance: Clearance = self.experiment.clearance
        self.obstacles: Sequence[Obstacle] = self.experiment.obstacles
        self.blind: Experiment = load_experiment(BASE, {**changes, "law.avoidance": "none"})
        if path is not None:
            self.blind = self.blind.with_path(path)


def ten_balls(seed: int) -> ObstacleTask:
    """Return the nephroid among ten balls of 3 to 8 cm, clear of the arm at the start.

    Args:
        seed: Which ten: the balls of two scenes of `benchmarks/avoidance.py`.
    """
    changes = _lasting(_NEPHROID)
    balls = [*scene(2 * seed, changes), *scene(2 * seed + 1, changes)]
    return ObstacleTask(f"{BALLS} {seed}", {**changes, "obstacles": balls}, lap=8.0)


def far_balls() -> ObstacleTask:
    """Return the nephroid with ten balls of 5 cm that are 0.3 m and more from the arm."""
    changes, rng = _lasting(_NEPHROID), np.random.default_rng(0)
    alone = load_experiment(BASE, {**changes, "obstacles": []})
    assert alone.clearance is not None
    balls: list[dict[str, Any]] = []
    while len(balls) < 10:
        center = rng.uniform(-1.2, 1.2, 3).tolist()
        ball = {"kind": "ball", "center": center, "radius": 0.05}
        clearance = replace(alone.clearance, solids=Solids.of(make_obstacles([ball])))
        if clearance.gaps(alone.start)[len(clearance.own) :].min() > _FAR:
            balls.append(ball)
    return ObstacleTask(FAR, {**changes, "obstacles": balls}, lap=8.0)


def into_itself() -> ObstacleTask:
    """Return a tool led into the arm's own base and out again."""
    changes = _lasting(_THERE_AND_BACK)

    def way(t: Array) -> Array:
        back = 0.5 * _INTO_ITSELF * (1.0 - np.cos(2.0 * np.pi * t / _THERE_AND_BACK))
        low = 0.6 * back
        return np.stack((-back, 0.0 * t, -low), axis=1)

    return ObstacleTask(ITSELF, {**changes, "obstacles": []}, _THERE_AND_BACK, _led(changes, way))


def into_walls() -> ObstacleTask:
    """Return a tool led into a wall beside it and back, then into a table below it and back.

    The proportions are those of pink's example of a quadruped that squats within a barrier of its
    position, at half the speed: a bound at the start, and 0.1 m beyond; then a bound 0.05 m below
    the start, and 0.2 m below it.
    """
    changes = _lasting(2.0 * _EACH)

    def way(t: Array) -> Array:
        sway = np.abs(np.sin(np.pi * t / _EACH))
        first = t < _EACH
        return np.stack((0.0 * t, _ASIDE * sway * first, -_DOWN * sway * ~first), axis=1)

    empty = load_experiment(BASE, {**changes, "obstacles": []})
    assert empty.clearance is not None
    arm = empty.clearance.arm
    ends = arm.segments_in_world(arm.poses.at(empty.start))
    tool = np.array([body == "tool" for body in arm.bodies])
    low = (ends.min(axis=1) - arm.radii[:, None])[tool].min(axis=0)
    side = (ends.max(axis=1) + arm.radii[:, None])[tool].max(axis=0)[1]
    x, y, _ = empty.p_WE_start
    obstacles = [
        # Below the wrist, which is wider.
        _box("wall", [x, side + _WALL + 0.1, low[2] - 0.03], [0.3, 0.2, 0.2]),
        _box("table", [x, y, low[2] - _TABLE - 0.05], [0.3, 0.6, 0.1]),
    ]
    return ObstacleTask(WALLS, {**changes, "obstacles": obstacles}, 2.0 * _EACH, _led(changes, way))


def _box(name: str, center: list[float], size: list[float]) -> dict[str, Any]:
    return {"kind": "box", "name": name, "center": [float(x) for x in center], "size": size}


def _lasting(duration: float) -> dict[str, Any]:
    changes = document("panda", 1.0, None)
    return {**changes, "duration": duration, "window": [0.5 * duration, duration]}


def _led(changes: dict[str, Any], way: Callable[[Array], Array]) -> Path:
    """Return a path by ways from where the tool starts, shape (k, 3) at times (k,)."""
    start = load_experiment(BASE, {**changes, "obstacles": []}).p_WE_start
    times = np.arange(0.0, changes["duration"] + 2.0 * _KNOTS, _KNOTS)
    spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, (start + way(times)).T)
    return TrajectoryPath(trajectory=spline)
