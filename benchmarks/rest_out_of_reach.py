"""Print how arms rest whose target is out of reach: speeds, and ways to the nearest point.

Each target moves out of reach within 3 s, by a straight line in any direction, and stays. A row is
of an arm, a task and a Jacobian; a column of an acceleration and a time, acceleration over jerk,
where 0 is without a bound of the jerk. A cell tells how many arms rest near the nearest point, the
largest speed of a joint in the last second of ten, and the largest way: by how much the error (the
orientation weighed by the lever) is larger than the least one within the position limits, which is
found from the end of the run and from random postures around it (Levenberg and Marquardt).

With ``--least`` a cell also tells the largest least time that any motion within velocity and
acceleration would need from where the arm is when the target comes to rest, until all joints rest
within 5 mm of the nearest point: bang, cruise and bang of each joint, all at once.

All arms, limits and targets of a task and a Jacobian run side by side::

    python benchmarks/rest_out_of_reach.py --targets 50 --compiled
    python benchmarks/rest_out_of_reach.py --arms panda --tasks pose --jacobians learned
    python benchmarks/rest_out_of_reach.py --jacobians known --acceleration 0.3 --rests 20 --least

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

from drake_rnn import Experiment, load_experiment, run_many
from drake_rnn.experiment import Arms
from drake_rnn.robot.limits import JointLimits
from drake_rnn.robot.load_arm import load_arm, screws_of
from drake_rnn.robot.postures import proposed_home
from drake_rnn.robot.rotation import rotation_error
from drake_rnn.robot.screws import Screws
from markdown_table import head, row

#: Time in which the target moves [s].
MOVES = 3.0
VELOCITY = 1.0
#: Accelerations [rad/s^2], and the times of acceleration over jerk [s].
LIMITS = (
    *((3.0, over) for over in (0.0, 0.01, 0.05, 0.2, 1.0)),
    *((most, 0.0) for most in (1.0, 0.3)),
)
#: Speed below which an arm rests [rad/s], and way within which it is at the nearest point [m].
SLOW, NEAR = 0.005, 0.005
#: Postures from which the nearest point is sought, and how far they are apart [rad].
SOUGHT, SPREAD, ROUNDS = 4, 0.3, 200
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


def changes(row: Row, most: float, over: float, asked: argparse.Namespace) -> Change:
    """Return the changes that make an experiment of a cell, without the path."""
    limits = {"velocity": VELOCITY, "acceleration": most}
    return (
        row.arm
        | row.law
        | {
            "task": row.task,
            "limits": limits | ({"jerk": most / over} if over else {}),
            "on_unreachable": "follow",
            "period": asked.period,
            "duration": MOVES + asked.rests,
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


class Goal(NamedTuple):
    """Where arms of one kind are to be, each of shape (robots, ...).

    Attributes:
        arm: Kinematics of the arms.
        p: Where the end effectors are to be, shape (..., 3) [m].
        R: How they are to be turned, shape (..., 3, 3).
        lever: Length that weighs an error of the orientation, 0 without one [m].
    """

    arm: Screws
    p: np.ndarray
    R: np.ndarray
    lever: float

    def errors(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return errors, shape (..., 6) [m], and their Jacobians, shape (..., 6, n)."""
        pose = self.arm.at(q)
        turned = self.lever * rotation_error(pose.R_WE, self.R)
        error = np.concatenate((turned, self.p - pose.p_WE), axis=-1)
        return error, np.concatenate((self.lever * pose.J_omega, pose.J), axis=-2)

    def least(self, q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Return the least errors near postures, shape (...) [m], within position limits."""
        q, damping = np.clip(q, lower, upper), np.full(len(q), 1e-2)
        error, J = self.errors(q)
        for _ in range(ROUNDS):
            slope = np.einsum("kij,ki->kj", J, error)
            free = ~((q <= lower) & (slope < 0.0) | (q >= upper) & (slope > 0.0))
            J_free = J * free[:, None, :]
            H = J_free.swapaxes(-1, -2) @ J_free + damping[:, None, None] * np.eye(q.shape[-1])
            step = np.linalg.solve(H, (slope * free)[..., None])[..., 0]
            tried = np.clip(q + step, lower, upper)
            error_there, J_there = self.errors(tried)
            better = (error_there**2).sum(axis=-1) < (error**2).sum(axis=-1)
            q = np.where(better[:, None], tried, q)
            error = np.where(better[:, None], error_there, error)
            J = np.where(better[:, None, None], J_there, J)
            damping = np.clip(np.where(better, damping / 3.0, damping * 4.0), 1e-9, 1e6)
        return np.linalg.norm(error, axis=-1)


def goal_of(experiments: list[Experiment]) -> Goal:
    """Return where arms of experiments of one arm and task are to be."""
    first = experiments[0]
    arm = screws_of(first.arm)
    at_start = arm.at(first.start)
    lever = getattr(first.law, "lever", 0.0) * first.holds_orientation
    p = np.array([at_start.p_WE + each.document.path["by"] for each in experiments])
    return Goal(arm, p, np.broadcast_to(at_start.R_WE, (len(p), 3, 3)), lever)


def least_errors(goal: Goal, q: np.ndarray, limits: JointLimits) -> np.ndarray:
    """Return the least errors around postures, shape (k, n) [rad], shape (k,) [m]."""
    rng, least = np.random.default_rng(0), np.full(len(q), np.inf)
    for number in range(SOUGHT):
        begin = q + (SPREAD if number else 0.0) * rng.normal(size=q.shape)
        found = goal.least(begin, limits.position_lower, limits.position_upper)
        least = np.minimum(least, found)
    return least


def farthest(v: np.ndarray, most: float, time: np.ndarray) -> np.ndarray:
    """Return how far joints get that rest after a time, shape (k, n) [rad].

    Args:
        v: Velocities at its beginning, shape (k, n) [rad/s].
        most: Largest acceleration [rad/s^2].
        time: The times, shape (k, 1) [s].
    """
    peak = np.minimum(0.5 * (most * time + v), VELOCITY)
    cruise = np.maximum(time - (2.0 * peak - v) / most, 0.0)
    return (2.0 * peak**2 - v**2) / (2.0 * most) + peak * cruise


def least_times(
    goal: Goal, limits: JointLimits, least: np.ndarray, motions: np.ndarray, asked: Any
) -> np.ndarray:
    """Return in which times any motion could rest near the nearest points, shape (k,) [s].

    Args:
        goal: Where the arms are to be.
        limits: Limits of the joints.
        least: The least errors, shape (k,) [m].
        motions: Joint positions at all samples, shape (k, samples, n) [rad].
        asked: What the command asks for.
    """
    begin = round(MOVES / asked.period)
    q, most = motions[:, begin], float(limits.acceleration.min())
    v = (q - motions[:, begin - 1]) / asked.period
    short = abs(v).max(axis=1) / most
    long = np.full(len(q), MOVES + asked.rests)
    for _ in range(10):
        time = 0.5 * (short + long)[:, None]
        lower = np.maximum(q - farthest(-v, most, time), limits.position_lower)
        upper = np.minimum(q + farthest(v, most, time), limits.position_upper)
        there = [goal.least(start, lower, upper) for start in (q, motions[:, -1])]
        is_near = np.minimum(*there) <= least + NEAR
        short, long = np.where(is_near, short, time[:, 0]), np.where(is_near, time[:, 0], long)
    return long


def cells(rows: list[Row], limits: Limits, asked: argparse.Namespace) -> list[list[str]]:
    """Return the cells of rows."""
    experiments = []
    for each in rows:
        plain = each._replace(task="xyz", law={"law": {"kind": "adaptive"}})
        outs = ways_out(changes(plain, *LIMITS[0], asked), asked.targets, asked.seed)
        cases = product(limits, outs)
        experiments += [made(changes(each, *most, asked), by) for most, by in cases]
    many = run_many(experiments, record=["position"], compiled=asked.compiled)
    last, size, texts = round(1.0 / asked.period) + 1, asked.targets, []
    for begin in range(0, len(experiments), size):
        alike = experiments[begin : begin + size]
        motions = np.array(many.series["position"][begin : begin + size])
        speeds = abs(np.diff(motions[:, -last:], axis=1)).max(axis=(1, 2)) / asked.period
        goal, bounds = goal_of(alike), alike[0].limits
        least = least_errors(goal, motions[:, -1], bounds)
        ways = np.linalg.norm(goal.errors(motions[:, -1])[0], axis=-1) - least
        text = cell(speeds, ways)
        if asked.least:
            text += f", {least_times(goal, bounds, least, motions, asked).max():.1f} s"
        texts.append(text)
    return [texts[k : k + len(limits)] for k in range(0, len(texts), len(limits))]


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
    parser.add_argument("--rests", type=float, default=10.0, help="how long the target rests [s]")
    parser.add_argument("--least", action="store_true", help="tell least times as well")
    parser.add_argument("--compiled", action="store_true", help="compile the laws to C")
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
    kinds = list(product(asked.tasks, asked.jacobians))
    groups = [
        [
            Row(arm, task, {"law": {"kind": "adaptive", "jacobian": jacobian}})
            for arm in arms.values()
        ]
        for task, jacobian in kinds
    ]
    columns = [f"{most:g} rad/s^2, {over:g} s" for most, over in limits]
    head("arm", "task", "J", *columns)
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("spawn")) as pool:
        counts = [limits] * len(groups), [asked] * len(groups)
        for of, found in zip(kinds, pool.map(cells, groups, *counts), strict=True):
            for name, texts in zip(arms, found, strict=True):
                row(name, *of, *texts)
            sys.stdout.flush()


if __name__ == "__main__":
    main()
