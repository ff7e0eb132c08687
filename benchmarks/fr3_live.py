"""Drive franka-sim's FR3 through pylibfranka, with both its rules, and print what happened.

Each motion takes 2 s: to a target up to 0.5 m away, at once, or along a nephroid that is passed in
1 to 2 s, within the limits of a drive. The law stands beside the pacer as on a robot::

    python -m venv /path/to/venv && /path/to/venv/bin/pip install franka-sim==1.1.7
    python benchmarks/fr3_live.py --judge /path/to/venv/bin/python
    python benchmarks/fr3_live.py --judge /path/to/venv/bin/python --busy 2

The robot has a core of its own and a high priority, where the system lets it, as it has a computer
of its own in reality. ``--busy`` starts further programs that keep cores busy. A target out of
reach is left out, and the next seed taken. These laws do not look at the arm's own bodies; where a
motion ends at one of them, the simulated robot is started anew.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count as count_from
from itertools import islice
from typing import Any

import numpy as np

from drake_rnn import FR3, Array, drive_experiment, driven_experiment
from drake_rnn.drive import DriveSettings, PacedConnection
from drake_rnn.drive.shared_cycles import LAW, NOBODY
from drake_rnn.errors import InvalidInputError, RobotError
from drake_rnn.experiment import Experiment, forecasts
from franka_sim_server import HOST, Server, served
from markdown_table import head, row
from shared_options import add_judge

_COMMAND = "python benchmarks/fr3_live.py"
DURATION = 2.0
ADAPTIVE = {"kind": "adaptive", "braking": 2.0, "feedback_limit": 1.0}
LAWS = {
    "adaptive, J known": ADAPTIVE,
    "adaptive, J learned": ADAPTIVE | {"jacobian": "learned"},
    "SLC, J known": {"kind": "simultaneous_learning", "jacobian": "known"},
}
#: The way to the start is none of what is looked at.
QUICK = DriveSettings(approach_velocity=1.0, approach_acceleration=3.0, approach_jerk=100.0)


def document(law: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the experiment of a motion."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        size, period = rng.uniform(0.02, 0.08), rng.uniform(1.0, 2.0)
        plane = str(rng.choice(["xy", "yz", "xz"]))
        path = {"kind": "nephroid", "plane": plane, "size": float(size), "period": float(period)}
    else:
        way = rng.normal(size=3)
        way *= rng.uniform(0.1, 0.5) / np.linalg.norm(way)
        path = {"kind": "rest", "offset": way.tolist()}
    return {
        "arm": "fr3",
        "path": path,
        "law": law,
        "period": 1e-3,
        "duration": DURATION,
        "seed": seed,
    }


def experiments(law: dict[str, Any]) -> Iterator[Experiment]:
    """Yield motions whose targets are in reach."""
    for seed in count_from(0):
        experiment = driven_experiment(document(law, seed), FR3)
        try:
            forecasts(experiment)
        except InvalidInputError:
            continue
        yield experiment


@dataclass
class Found:
    """What motions of one kind came to.

    Attributes:
        reflexes: What the robot aborted motions for, with the cycles that it had lost in them.
        stopped: Why others were stopped.
        cycles, late, lost: Cycles of the runs; of these, those that the pacer answered without the
            law; and those that the robot lost.
        answers: Times to answer of all cycles in which the robot was moved [s].
        following: Largest differences of measured and commanded velocity in a motion [rad/s].
        loads: Load of the machine at the end of each motion.
    """

    reflexes: list[tuple[str, int]] = field(default_factory=list)
    stopped: list[str] = field(default_factory=list)
    cycles: int = 0
    late: list[int] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    answers: list[Array] = field(default_factory=list)
    following: list[float] = field(default_factory=list)
    loads: list[float] = field(default_factory=list)


def driven(found: Found, experiment: Experiment, server: Server) -> None:
    """Drive a motion, and add what it came to."""
    connection = PacedConnection(HOST)
    try:
        result, drive = drive_experiment(experiment, FR3, connection, QUICK)
    except RobotError as error:
        found.stopped.append(str(error))
        return
    except InvalidInputError:
        # No way leads from where the last motion has ended, at the arm's own bodies.
        server.kill()
        server.start()
        return driven(found, experiment, server)
    cycles = connection.cycles()
    moving = np.flatnonzero(cycles["source"] != NOBODY)
    of_motion = slice(moving[0] if moving.size else 0, None)
    ends = drive.origin + result.record["until_s"]
    ran = (cycles["time"] > drive.origin) & (cycles["time"] <= ends)
    lost = int((cycles["passed"][of_motion].astype(int) - 1).clip(0).sum())
    if "reflex" in result.failure:
        found.reflexes.append((result.failure, lost))
    elif result.status != "complete":
        found.stopped.append(result.failure)
    found.cycles += int(ran.sum())
    found.late.append(int((ran & (cycles["source"] != LAW)).sum()))
    found.lost.append(lost)
    # With the last answer the robot is handed back, which waits for it.
    found.answers.append((cycles["answered"] - cycles["heard"])[of_motion][:-1])
    off = cycles["velocity_measured"][1:] - cycles["velocity_commanded"][:-1]
    found.following.append(float(np.abs(off[ran[1:]]).max()) if ran.any() else 0.0)
    found.loads.append(os.getloadavg()[0])


def told(name: str, found: Found) -> None:
    """Print the row of motions of one kind."""
    microseconds = 1e6 * np.concatenate(found.answers)
    median, rare, worst = np.quantile(microseconds, [0.5, 0.999, 1.0])
    # Cycles that are lost at the end of a motion have no answer that would tell.
    without_loss = sum(not lost and "communication" not in why for why, lost in found.reflexes)
    row(
        name,
        len(found.late),
        f"{len(found.reflexes)} ({without_loss})",
        len(found.stopped),
        found.cycles,
        f"{sum(found.late)} ({max(found.late)})",
        sum(found.lost),
        f"{median:.0f} / {rare:.0f} / {worst:.0f}",
        f"{max(found.following):.2f}",
        f"{min(found.loads):.1f} to {max(found.loads):.1f}",
    )
    reflexes = (f"{why}, after {lost} lost cycles" for why, lost in found.reflexes)
    for why in [*reflexes, *found.stopped]:
        print(f"{name}: {why}", file=sys.stderr)
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_judge(parser, required=True)
    parser.add_argument("--known", type=int, default=50, help="motions with J known")
    parser.add_argument("--learned", type=int, default=50, help="motions with J learned")
    parser.add_argument("--slc", type=int, default=20, help="motions of SLC")
    parser.add_argument("--busy", type=int, default=0, help="further programs that are busy")
    asked = parser.parse_args()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(asked.busy)]
    head(
        *("law", "motions", "reflexes (without a lost cycle)", "other stops", "cycles"),
        *("late (most in a motion)", "lost", "answers [us]: median / p99.9 / worst"),
        *("velocity off [rad/s]", "load"),
        made_by=f"{_COMMAND} --judge PYTHON" + (f" --busy {asked.busy}" if asked.busy else ""),
    )
    try:
        with served(asked.judge) as server:
            for name, count in zip(LAWS, (asked.known, asked.learned, asked.slc), strict=True):
                found = Found()
                for experiment in islice(experiments(LAWS[name]), count):
                    driven(found, experiment, server)
                if count:
                    told(name, found)
    finally:
        for process in busy:
            process.kill()


if __name__ == "__main__":
    main()
