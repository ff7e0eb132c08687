"""How an arm fares with a ball that comes at it from every side, while it follows its path.

The ball is aimed at a random point of the arm and passes through it at constant speed::

    python benchmarks/moving_obstacles.py --cases 200
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

from avoidance import document
from drake_rnn import load_experiment, simulate
from drake_rnn.robot.clearance.capsules import between_segments
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

NAME = "adaptive_nephroid_known"
# Speed that is counted on, and least speed of a ball [m/s]; the error of its measured place [m].
SPEED, SLOWEST, ERROR = 0.3, 0.05, 0.005
RADII, AWAY, APART = (0.03, 0.08), 0.6, 0.03
DURATION = 8.0


def ball(seed: int, changes: dict[str, Any]) -> dict[str, Any]:
    """Return a ball that is aimed at a point of the arm where it starts."""
    rng = np.random.default_rng(seed)
    empty = load_experiment(NAME, {**changes, "obstacles": []})
    assert empty.clearance is not None
    arm = empty.clearance.arm
    ends = arm.segments_in_world(arm.poses.at(empty.start))[arm.links > 0]
    while True:
        one, other = ends[rng.integers(len(ends))]
        aim = one + rng.uniform() * (other - one)
        away = rng.normal(size=3)
        away *= AWAY / np.linalg.norm(away)
        speed, radius = rng.uniform(SLOWEST, SPEED), float(rng.uniform(*RADII))
        to_arm = between_segments(np.tile(aim + away, (2, 1)), ends).distance
        if (to_arm - arm.radii[arm.links > 0]).min() > radius + APART:
            break
    return {
        "kind": "ball",
        "center": (aim + away).tolist(),
        "radius": radius,
        "speed": SPEED,
        "error": ERROR,
        "moves": {"kind": "line", "by": (-2.0 * away).tolist(), "period": 2.0 * AWAY / speed},
    }


def run(seed: int, avoids: bool) -> dict[str, float]:
    """Return what a case comes to."""
    changes = document("panda", 1.0, None)
    changes |= {"duration": DURATION, "window": [0.0, DURATION]}
    law = {} if avoids else {"law.avoidance": "none"}
    given = {**changes, **law, "obstacles": [ball(seed, changes)]}
    metrics = simulate(load_experiment(NAME, given)).metrics
    beyond = ("acceleration", "velocity", "position")
    return {
        "any": metrics["distance_min_m"],
        "moving": metrics["distance_moving_min_m"],
        "bounds": max(v for k, v in metrics.items() if k.startswith(beyond) and "violation" in k),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    add_case_options(parser)
    options = parser.parse_args()
    head(
        "law",
        "cases",
        "collided while it moved",
        "least distance while it moved [mm]",
        "hit while it stood still",
        "bounds beyond by",
    )
    for name, avoids in (("without avoidance", False), ("with", True)):
        task = partial(run, avoids=avoids)
        found = cases(task, range(options.cases), options.jobs, options.kept, name)
        of = {key: np.array([each[key] for each in found]) for key in found[0]}
        row(
            name,
            len(found),
            int((of["moving"] < 0.0).sum()),
            f"{1e3 * of['moving'].min():.2f}",
            int(((of["any"] < 0.0) & (of["moving"] >= 0.0)).sum()),
            f"{of['bounds'].max():.0e}",
        )


if __name__ == "__main__":
    main()
