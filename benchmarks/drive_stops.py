"""Why a differential drive is not certified as other joints are: its stop is an arc.

    python benchmarks/drive_stops.py --scenes 100

A law with obstacles certifies stops in which each joint slows down by itself, so that a base goes
straight on while it turns. A drive that slows down, forward and turning, each by its own limit,
goes along an arc with the same turn at every moment. The first table has how far the base is from
the straight stop at most; the second, among the boxes of `base_goals.py`, random postures at random
speeds of which the straight stop stays clear by 10 mm, and what becomes of the arc.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from base_goals import scene
from drake_rnn import arm_clearance, load_arm, make_obstacles
from drake_rnn.robot.postures import random_postures
from markdown_table import head, row

# Steps of a stop, and how often its distances are looked at.
_STEPS, _EVERY = 400, 20
_DISTANCE = 0.01
Array = np.ndarray


def stop(speeds: Array, limits: Array) -> Array:
    """Return the way of a stop from speeds forward and turning, in the frame of its beginning.

    Args:
        speeds: Speeds where it begins, shape (2,) [m/s, rad/s].
        limits: Largest decelerations, shape (2,) [m/s^2, rad/s^2].

    Returns:
        Way straight on, x and y of the arc, and the turn at each step, shape (steps, 4).
    """
    time = np.linspace(0.0, max(np.abs(speeds) / limits), _STEPS)[:, None]
    rates = np.sign(speeds) * np.maximum(np.abs(speeds) - limits * time, 0.0)
    turn = _integral(rates[:, 1], time[:, 0])
    parts = (rates[:, 0], rates[:, 0] * np.cos(turn), rates[:, 0] * np.sin(turn))
    return np.stack([*(_integral(part, time[:, 0]) for part in parts), turn], axis=1)


def _integral(rate: Array, time: Array) -> Array:
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)
    return np.concatenate(([0.0], np.cumsum(steps)))


def aside(way: Array) -> float:
    """Return how far an arc is from the straight stop at most [m]."""
    return float(np.hypot(way[:, 1] - way[:, 0], way[:, 2]).max())


def postures_along(q: Array, x: Array, y: Array, turn: Array) -> Array:
    """Return the postures of a base that moves by x and y in its own frame, and turns."""
    c, s = np.cos(q[2]), np.sin(q[2])
    postures = np.tile(q, (len(x), 1))
    postures[:, :3] += np.stack([c * x - s * y, s * x + c * y, turn], axis=1)
    return postures


def gaps_of_stops(number: int, arm: Any, per_scene: int) -> list[tuple[float, float, float]]:
    """Return least distances along straight stops and along arcs, and how far these are apart."""
    rng = np.random.default_rng([56, number])
    clearance, _ = arm_clearance(arm, make_obstacles(scene(rng)), arm.home)
    found = []
    for q in random_postures(arm, per_scene, int(rng.integers(2**31))):
        limits = arm.limits.bounds
        speeds = rng.uniform(-1.0, 1.0, 2) * limits["velocity"][[0, 2]]
        way = stop(speeds, limits["acceleration"][[0, 2]])
        at = way[::_EVERY]
        straight = postures_along(q, at[:, 0], 0.0 * at[:, 0], at[:, 3])
        arc = postures_along(q, at[:, 1], at[:, 2], at[:, 3])
        least = (float(clearance.gaps(each).min()) for each in (straight, arc))
        found.append((*least, aside(way)))
    return found


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--stops", type=int, default=100, help="of each scene")
    options = parser.parse_args()
    arm = load_arm("panda", base={"model": "cart", "area": [[-2, -2], [2, 2]]})
    bounds = arm.limits.bounds
    fastest, limits = bounds["velocity"][[0, 2]], bounds["acceleration"][[0, 2]]
    head("share of both speeds", "arc from straight stop [mm]")
    for share in (0.25, 0.5, 0.75, 1.0):
        row(share, f"{1e3 * aside(stop(share * fastest, limits)):.1f}")
    numbers = range(options.scenes)
    rows = np.array([each for n in numbers for each in gaps_of_stops(n, arm, options.stops)])
    clear = rows[rows[:, 0] >= _DISTANCE]
    within = clear[:, 1] >= clear[:, 0] - clear[:, 2] - 1e-9
    head("straight stops clear by 10 mm", "arcs below 5 mm", "arcs that collide",
         "least distance of an arc [mm]", "arcs nearer by more than the first table says",
         )  # fmt: skip
    row(len(clear), int((clear[:, 1] < 0.005).sum()), int((clear[:, 1] < 0.0).sum()),
        f"{1e3 * clear[:, 1].min():.1f}", int((~within).sum()))  # fmt: skip


if __name__ == "__main__":
    main()
