"""Random goals of an arm on a mobile base, on a floor of 4 x 4 m among five boxes.

    python benchmarks/base_goals.py --cases 1000

Each case has boxes, a start and a goal of its own: a position of the tool, which some free posture
reaches. A way there is planned in all joints, of base and arm at once, and followed by a guard at
100 Hz, within every bound of the base and up to 1.5 rad/s, 6 rad/s^2 and 200 rad/s^3 of the arm.
"collided" counts cases in which a pair of capsules came below 0, or the rectangle of the base that
is drawn met that of a box, which is looked at without the package.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import (
    Goal,
    Guard,
    InvalidInputError,
    JointStream,
    arm_clearance,
    load_arm,
    make_obstacles,
    plan_motion,
)
from drake_rnn.robot.postures import random_postures

# Half of the floor's side, and of the base that is drawn, as in models/cart [m].
_HALF, _BASE = 2.0, np.array([0.28, 0.22])
_BOXES, _PERIOD, _CLEAR = 5, 0.01, 0.03
_ARM = {"velocity": 1.5, "acceleration": 6.0, "jerk": 200.0}


def scene(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Return five boxes that stand on the floor."""
    boxes = []
    for number in range(_BOXES):
        size = rng.uniform([0.2, 0.2, 0.2], [0.6, 0.6, 1.2])
        center = np.append(rng.uniform(-_HALF, _HALF, 2), 0.5 * size[2])
        boxes.append({"kind": "box", "name": f"box {number + 1}"})
        boxes[-1] |= {"center": center.tolist(), "size": size.tolist()}
    return boxes


def rectangles_meet(pose: np.ndarray, box: dict[str, Any]) -> bool:
    """Return whether the base, at x, y and yaw, meets a box, by the axes that may part them."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    R = np.array([[c, -s], [s, c]])
    signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    base = pose[:2] + (signs * _BASE) @ R.T
    other = np.array(box["center"][:2]) + signs * 0.5 * np.array(box["size"][:2])
    for axis in (*R.T, *np.eye(2)):
        one, two = base @ axis, other @ axis
        if one.max() < two.min() or two.max() < one.min():
            return False
    return True


def run_case(number: int, arm: Any, seconds: float) -> dict[str, Any]:
    """Return what becomes of a case."""
    rng = np.random.default_rng([55, number])
    while True:
        boxes = scene(rng)
        clearance, _ = arm_clearance(arm, make_obstacles(boxes), arm.home)
        postures = random_postures(arm, 60, int(rng.integers(2**31)))
        starts = np.tile(arm.home, (60, 1))
        starts[:, :3] = postures[:, :3]
        starts = starts[clearance.gaps(starts).min(axis=1) > _CLEAR]
        free = postures[clearance.gaps(postures).min(axis=1) > _CLEAR]
        # A tool above the floor.
        heights = [arm.kinematics().p_WE(q)[2] for q in free]
        free = free[np.array(heights) > 0.1] if len(free) else free
        if len(starts) and len(free):
            break
    start, p_WE = starts[0], arm.kinematics().p_WE(free[0])
    case: dict[str, Any] = {"number": number}
    began = time.process_time()
    try:
        goal = Goal(p_WE=p_WE, seconds=seconds)
        plan = plan_motion(arm, goal, start, period=_PERIOD, clearance=clearance, seed=number)
    except InvalidInputError as error:
        return {**case, "refused": str(error), "planning": time.process_time() - began}
    planning = time.process_time() - began
    law = JointStream(limits=arm.limits, home=start, clearance=clearance, **plan.stream)
    guard = Guard(law, _PERIOD, compiled=False)
    targets = plan.targets(plan.duration + 1.0).position
    q = np.array([start, *(guard.command(target) for target in targets)])
    v = np.diff(q, axis=0, prepend=q[:1], append=q[-1:]) / _PERIOD
    limits, ratios = arm.limits, {}
    rates = {"velocity": v, "acceleration": np.diff(v, axis=0) / _PERIOD}
    rates["jerk"] = np.diff(rates["acceleration"], axis=0) / _PERIOD
    for name, rate in rates.items():
        ratios[name] = float((np.abs(rate) / limits.bounds[name]).max())
    beyond = np.maximum(limits.position_lower - q, q - limits.position_upper).max()
    return {
        **case,
        "planning": planning,
        "duration": plan.duration,
        "way": float(np.linalg.norm(np.diff(q[:, :2], axis=0), axis=1).sum()),
        "error": float(np.linalg.norm(arm.kinematics().p_WE(q[-1]) - p_WE)),
        "least": float(clearance.least_along(q).min()),
        "meets": any(rectangles_meet(pose, box) for pose in q[:, :3] for box in boxes),
        "beyond": float(beyond),
        "uncertified": float(guard.part("uncertified").item()),
        "held_back": float(guard.part("held_back").item()),
        **ratios,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0, help="longest search of a way")
    parser.add_argument("--rows", type=Path, help="file of cases, to which it is added")
    options = parser.parse_args()
    area = [[-_HALF, -_HALF], [_HALF, _HALF]]
    arm = load_arm("panda", base={"model": "cart", "area": area})
    bounds = {k: np.minimum(arm.limits.bounds[k], most) for k, most in _ARM.items()}
    arm = arm.with_limits(arm.limits.replace(**bounds))
    rows = []
    if options.rows is not None and options.rows.exists():
        rows = [json.loads(line) for line in options.rows.read_text().splitlines()]
    for number in range(len(rows), options.cases):
        rows.append(run_case(number, arm, options.seconds))
        if options.rows is not None:
            with options.rows.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    print_table(rows)


def print_table(rows: list[dict[str, Any]]) -> None:
    """Print what the cases came to."""
    done = [row for row in rows if "refused" not in row]
    reached = [row for row in done if row["error"] < 1e-3]
    collided = [row for row in done if row["least"] < 0.0 or row["meets"]]
    most = max(max(row[k] for k in _ARM) for row in done) - 1.0
    planning = [row["planning"] for row in rows]
    head = (
        "cases", "no way", "reached within 1 mm", "share", "collided", "least distance [mm]",
        "samples held back", "uncertified", "bounds beyond by", "beyond the floor [m]",
        "planning, median and 95 % [s]", "motion, median [s]", "way of the base, mean [m]",
    )  # fmt: skip
    entries = (
        len(rows), len(rows) - len(done), len(reached), f"{100 * len(reached) / len(rows):.1f} %",
        len(collided), f"{1e3 * min(row['least'] for row in done):.2f}",
        f"{sum(row['held_back'] for row in done):.0f}",
        f"{sum(row['uncertified'] for row in done):.0f}", f"{most:.0e}",
        f"{max(0.0, *(row['beyond'] for row in done)):.0e}",
        f"{np.median(planning):.2f}, {np.quantile(planning, 0.95):.2f}",
        f"{np.median([row['duration'] for row in done]):.2f}",
        f"{np.mean([row['way'] for row in done]):.2f}",
    )  # fmt: skip
    print(f"| {' | '.join(head)} |")
    print(f"|{'---|' * len(head)}")
    print(f"| {' | '.join(map(str, entries))} |")


if __name__ == "__main__":
    main()
