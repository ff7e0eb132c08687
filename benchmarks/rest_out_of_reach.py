"""Print how arms rest whose target is out of reach: speeds, and ways to the nearest point.

Each target moves out of reach within 3 s, by a straight line in any direction, and stays. A row is
of an arm, a task and a Jacobian; a column of an acceleration and a time, acceleration over jerk,
where 0 is without a bound of the jerk. A cell tells how many arms rest near the nearest point, the
largest speed of a joint in the last second of ten, and the largest way: by how much the error (the
orientation weighed by the lever) is larger than the least one within the position limits, which is
found from the end of the run and from random postures around it (`scipy.optimize.least_squares`).

    python benchmarks/rest_out_of_reach.py --targets 5
    python benchmarks/rest_out_of_reach.py --arms panda --tasks pose --jacobians learned

An arm that is no shipped one is given as a model, its frame and the joint to lock::

    --model so101.urdf gripper_frame_link gripper
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

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
VELOCITY = 1.0
#: Accelerations [rad/s^2], and the times of acceleration over jerk [s].
LIMITS = ((3.0, 0.0), (3.0, 0.01), (3.0, 0.05), (3.0, 0.2), (3.0, 1.0), (1.0, 0.0), (0.3, 0.0))
#: Speed below which an arm rests [rad/s], and way within which it is at the nearest point [m].
SLOW, NEAR = 0.005, 0.005
ARMS = Arms()

Change = dict[str, Any]
Limits = list[tuple[float, float]]


class Row(NamedTuple):
    """What a row is of.

    Attributes:
        arm: Changes of an experiment that make it one of the arm.
        task: ``xyz`` or ``pose``.
        law: Changes that make it one of the law.
    """

    arm: Change
    task: str
    law: Change


def changes(row: Row, most: float, over: float, period: float) -> Change:
    """Return the changes that make an experiment of a cell, without the path."""
    limits = {"velocity": VELOCITY, "acceleration": most}
    return (
        row.arm
        | row.law
        | {
            "task": row.task,
            "limits": limits | ({"jerk": most / over} if over else {}),
            "on_unreachable": "follow",
            "period": period,
            "duration": MOVES + RESTS,
            "window": None,
            "accept": None,
        }
    )


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


def cells(row: Row, limits: Limits, asked: argparse.Namespace) -> tuple[np.ndarray, np.ndarray]:
    """Return speeds [rad/s] and ways [m] of a row, each of shape (limits, targets)."""
    plain = row._replace(task="xyz", law={"law": {"kind": "adaptive"}})
    outs = ways_out(changes(plain, *limits[0], asked.period), asked.targets, asked.seed)
    cases = [(changes(row, *each, asked.period), by) for each, by in product(limits, outs)]
    experiments = [made(*case) for case in cases]
    many = run_many(experiments, record=["position"])
    last = round(1.0 / asked.period) + 1
    speeds = [abs(np.diff(q[-last:], axis=0)).max() / asked.period for q in many.series["position"]]
    ends = zip(experiments, cases, many.position, strict=True)
    ways = [excess(experiment, by, q) for experiment, (_, by), q in ends]
    shape = len(limits), len(outs)
    return np.reshape(speeds, shape), np.reshape(ways, shape)


def cell(speeds: np.ndarray, ways: np.ndarray) -> str:
    """Return a cell of a table, of speeds [rad/s] and ways [m] of some runs."""
    good = (speeds < SLOW) & (ways < NEAR)
    return f"{good.sum()} of {good.size}: {speeds.max():.2g}, {ways.max() * 1e3:.2g} mm"


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="*", default=["panda", "iiwa14", "ur5", "fr3"])
    parser.add_argument("--model", nargs=3, metavar=("FILE", "FRAME", "LOCK"))
    parser.add_argument("--tasks", nargs="*", default=["xyz", "pose"])
    parser.add_argument("--jacobians", nargs="*", default=["known", "learned"])
    parser.add_argument("--acceleration", type=float, help="only the columns of this one")
    parser.add_argument("--over", nargs="*", type=float, help="only the columns of these times")
    parser.add_argument("--targets", type=int, default=4)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--period", type=float, default=4e-3)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    limits = [
        (most, over)
        for most, over in LIMITS
        if asked.acceleration in (None, most) and (asked.over is None or over in asked.over)
    ]
    arms: dict[str, Change] = {name: {"arm": name} for name in asked.arms}
    if asked.model is not None:
        model, frame, lock = asked.model
        description = {"model": model, "frame": frame, "lock": {lock: 0.0}}
        home = proposed_home(load_arm(**description)).tolist()
        arms[Path(model).stem] = {"arm": description, "start": home}
    names = list(product(arms, asked.tasks, asked.jacobians))
    rows = [
        Row(arms[name], task, {"law": {"kind": "adaptive", "jacobian": jacobian}})
        for name, task, jacobian in names
    ]
    columns = [f"{most:g} rad/s^2, {over:g} s" for most, over in limits]
    head("arm", "task", "J", *columns)
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("spawn")) as pool:
        counts = [limits] * len(rows), [asked] * len(rows)
        for of, (speeds, ways) in zip(names, pool.map(cells, rows, *counts), strict=True):
            row(*of, *map(cell, speeds, ways))
            sys.stdout.flush()


if __name__ == "__main__":
    main()
