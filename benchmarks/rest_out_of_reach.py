"""Print how arms rest whose target is out of reach: speeds, and ways to the nearest point.

Each target moves out of reach within 3 s, by a straight line in any direction, and stays. The rows
are arms, tasks, Jacobians and times acceleration over jerk; 0 is without a bound of the jerk. The
speed is the largest of a joint in the last second of ten; the way is by how much the error (the
orientation weighed by the lever) is larger than the least one within the position limits, which is
found from the end of the run and from random postures around it (`scipy.optimize.least_squares`).

    python benchmarks/rest_out_of_reach.py --targets 5
    python benchmarks/rest_out_of_reach.py --arms panda --tasks pose --jacobians learned

An arm that is no shipped one is given as a model, its frame and the joint to lock::

    --model so101.urdf gripper_frame_link gripper
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from drake_rnn import Experiment, load_experiment, run_many
from drake_rnn.experiment import Arms
from drake_rnn.robot.load_arm import load_arm
from drake_rnn.robot.postures import proposed_home
from drake_rnn.robot.rotation import rotation_error
from markdown_table import head, row

#: Time in which the target moves, and for which it then rests [s].
MOVES, RESTS = 3.0, 10.0
VELOCITY, ACCELERATION = 1.0, 3.0
#: Speed below which an arm rests [rad/s], and way within which it is at the nearest point [m].
SLOW, NEAR = 0.005, 0.005
ARMS = Arms()

Change = dict[str, Any]


def changes(arm: Change, task: str, jacobian: str, over: float, period: float) -> Change:
    """Return the changes that make an experiment of a row, without the path."""
    limits = {"velocity": VELOCITY, "acceleration": ACCELERATION}
    return arm | {
        "task": task,
        "law": {"kind": "adaptive", "jacobian": jacobian},
        "limits": limits | ({"jerk": ACCELERATION / over} if over else {}),
        "on_unreachable": "follow",
        "period": period,
        "duration": MOVES + RESTS,
        "window": None,
        "accept": None,
    }


def made(given: Change, by: np.ndarray) -> Experiment:
    """Return the experiment whose target moves by a way, shape (3,) [m]."""
    path = {"kind": "line", "by": by.tolist(), "period": MOVES, "timing": "quintic"}
    return load_experiment("adaptive_nephroid_known", given | {"path": path}, arms=ARMS)


def ways_out(given: Change, count: int, seed: int) -> list[np.ndarray]:
    """Return ways of a target to places at least 8 % beyond the reach, in all directions."""
    rng = np.random.default_rng(seed)
    experiment = made(given, np.array([0.1, 0.0, 0.0]))
    kinematics, limits = experiment.arm.kinematics(), experiment.limits
    lower, upper = np.maximum(limits.position_lower, -3.1), np.minimum(limits.position_upper, 3.1)
    places = np.array([kinematics.p_WE(rng.uniform(lower, upper)) for _ in range(3000)])
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0)) * [0.0, 0.0, 1.0]
    reach = np.linalg.norm(places - middle, axis=1).max()
    start, found = kinematics.p_WE(experiment.start), []
    while len(found) < count:
        by = rng.normal(size=3)
        by *= rng.uniform(0.4, 1.2) * reach / np.linalg.norm(by)
        if np.linalg.norm(start + by - middle) > 1.08 * reach:
            found.append(by)
    return found


def excess(experiment: Experiment, by: np.ndarray, q: np.ndarray) -> float:
    """Return by how much the error at a posture, shape (n,), is larger than the least one [m]."""
    kinematics, limits = experiment.arm.kinematics(), experiment.limits
    target = kinematics.p_WE(experiment.start) + by
    R = kinematics.R_WE(experiment.start)
    lever = getattr(experiment.law, "lever", 0.0) * experiment.holds_orientation

    def errors(q: np.ndarray) -> np.ndarray:
        turned = lever * rotation_error(kinematics.R_WE(q), R)
        return np.concatenate((turned, target - kinematics.p_WE(q)))

    lower, upper = limits.position_lower, limits.position_upper
    rng = np.random.default_rng(0)
    least = np.inf
    for spread in (0.0, 0.3, 0.3, 0.3):
        begin = np.clip(q + spread * rng.normal(size=q.size), lower + 1e-9, upper - 1e-9)
        least = min(least, np.linalg.norm(least_squares(errors, begin, bounds=(lower, upper)).fun))
    return float(np.linalg.norm(errors(q)) - least)


def tell(name: str, arm: Change, asked: argparse.Namespace) -> None:
    """Print the rows of an arm."""
    rows = [
        (task, jacobian, over)
        for task in asked.tasks
        for jacobian in asked.jacobians
        for over in asked.over
    ]
    outs = ways_out(changes(arm, "xyz", "known", 0.05, asked.period), asked.targets, asked.seed)
    cases = [(made(changes(arm, *of, asked.period), by), by) for of in rows for by in outs]
    many = run_many([experiment for experiment, _ in cases], record=["position"])
    count = round(1.0 / asked.period)
    speeds, ways = [], []
    for (experiment, by), q in zip(cases, many.series["position"], strict=True):
        speeds.append(np.abs(np.diff(q[-count - 1 :], axis=0)).max() / asked.period)
        ways.append(excess(experiment, by, q[-1]))
    for k, of in enumerate(rows):
        part = slice(k * len(outs), (k + 1) * len(outs))
        fast, way = np.array(speeds[part]), np.array(ways[part])
        rest = f"{(fast < SLOW).sum()} of {fast.size}"
        told = f"{np.median(fast):.2g}", f"{fast.max():.2g}", f"{(way < NEAR).sum()} of {way.size}"
        row(name, *of, rest, *told, f"{np.median(way) * 1e3:.2f}", f"{way.max() * 1e3:.2f}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="*", default=["panda", "iiwa14", "ur5", "fr3"])
    parser.add_argument("--model", nargs=3, metavar=("FILE", "FRAME", "LOCK"))
    parser.add_argument("--tasks", nargs="*", default=["xyz", "pose"])
    parser.add_argument("--jacobians", nargs="*", default=["known", "learned"])
    parser.add_argument("--over", nargs="*", type=float, default=[0.0, 0.01, 0.05, 0.2, 1.0])
    parser.add_argument("--targets", type=int, default=5)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--period", type=float, default=4e-3)
    asked = parser.parse_args()
    head(
        "arm", "task", "J", "acceleration / jerk [s]", f"below {SLOW:g} rad/s", "median [rad/s]",
        "max [rad/s]", f"within {NEAR * 1e3:g} mm", "median [mm]", "max [mm]",
    )  # fmt: skip
    arms: dict[str, Change] = {name: {"arm": name} for name in asked.arms}
    if asked.model is not None:
        model, frame, lock = asked.model
        description = {"model": model, "frame": frame, "lock": {lock: 0.0}}
        home = proposed_home(load_arm(**description)).tolist()
        arms[model] = {"arm": description, "start": home}
    for name, arm in arms.items():
        tell(name, arm, asked)


if __name__ == "__main__":
    main()
