"""Drive franka-sim's FR3 through pylibfranka, with both its rules, and print what happened.

Each motion takes 2 s: to a target up to 0.5 m away, at once, or along a nephroid that is passed in
1 to 2 s, within the limits of a drive. The law stands beside the pacer as on a robot::

    python -m venv /path/to/venv && /path/to/venv/bin/pip install franka-sim==1.1.7
    python benchmarks/fr3_live.py --judge /path/to/venv/bin/python
    python benchmarks/fr3_live.py --judge /path/to/venv/bin/python --beside --kept FILE
    python benchmarks/fr3_live.py --judge /path/to/venv/bin/python --both

By default the pacer calls the law in C; with ``--no-compiled`` the law is a process beside it, and
``--both`` drives each motion in both ways, in turn. ``--beside`` runs a campaign on all cores
meanwhile, ``--busy`` further programs that keep cores busy. With ``--kept`` a run goes on where one
has ended. ``--bare SECONDS`` first counts how often a bare loop of 1 kHz with the pacer's priority
is woken late: no law can be in time where that is not.

The robot has a core of its own and a high priority, where the system lets it, as it has a computer
of its own in reality. A target out of reach is left out, and the next seed taken. These laws do not
look at the arm's own bodies; where a motion ends at one of them, the simulated robot is started
anew.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import count as count_from
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import FR3, drive_experiment, driven_experiment
from drake_rnn.drive import DriveSettings, PacedConnection
from drake_rnn.drive.shared_cycles import LAW, NOBODY, PACER, raise_priority
from drake_rnn.errors import InvalidInputError, RobotError
from drake_rnn.experiment import Experiment, forecasts
from drive_iiwa import beside_a_campaign
from franka_sim_server import HOST, Server, served
from markdown_table import head, row
from shared_options import add_judge, add_kept

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
    """What a motion came to.

    Attributes:
        reflex: What the robot aborted it for; empty if it did not.
        stopped: Why it was stopped otherwise; likewise.
        cycles, late, lost: Cycles of the run; of these, those that the pacer answered without the
            law, though no cycle was lost; and those that the robot lost.
        answers: Times to answer of all cycles in which the robot was moved [us].
        following: Largest difference of measured and commanded velocity [rad/s].
        load: Load of the machine at its end.
    """

    reflex: str = ""
    stopped: str = ""
    cycles: int = 0
    late: int = 0
    lost: int = 0
    answers: list[int] = field(default_factory=list)
    following: float = 0.0
    load: float = 0.0


def drive(experiment: Experiment, server: Server, *, compiled: bool) -> Found:
    """Drive a motion, and return what it came to."""
    connection = PacedConnection(HOST)
    try:
        result, outcome = drive_experiment(experiment, FR3, connection, QUICK, compiled=compiled)
    except RobotError as error:
        return Found(stopped=str(error), load=os.getloadavg()[0])
    except InvalidInputError:
        # No way leads from where the last motion has ended, at the arm's own bodies.
        server.kill()
        server.start()
        return drive(experiment, server, compiled=compiled)
    cycles = connection.cycles()
    moving = np.flatnonzero(cycles["source"] != NOBODY)
    of_motion = slice(moving[0] if moving.size else 0, None)
    ends = outcome.origin + result.record["until_s"]
    ran = (cycles["time"] > outcome.origin) & (cycles["time"] < ends - 0.5 * FR3.period)
    lost = int((cycles["passed"][of_motion].astype(int) - 1).clip(0).sum())
    without_law = (cycles["source"] != LAW) & (cycles["passed"] == 1)
    # With the last answer the robot is handed back, which waits for it.
    answers = 1e6 * (cycles["answered"] - cycles["heard"])[of_motion][:-1]
    off = cycles["velocity_measured"][1:] - cycles["velocity_commanded"][:-1]
    is_reflex = "reflex" in result.failure
    return Found(
        result.failure if is_reflex else "",
        "" if is_reflex else result.failure,
        int(ran.sum()),
        int((ran & without_law).sum()),
        lost,
        answers.round().astype(int).tolist(),
        float(np.abs(off[ran[1:]]).max()) if ran.any() else 0.0,
        os.getloadavg()[0],
    )


def print_row(name: str, motions: list[Found]) -> None:
    """Print the row of motions of one kind."""
    microseconds = np.concatenate([motion.answers for motion in motions])
    answers = np.quantile(microseconds, [0.5, 0.99, 0.999, 1.0])
    reflexes = [motion for motion in motions if motion.reflex]
    # Cycles that are lost at the end of a motion have no answer that would tell.
    without_loss = sum(not each.lost and "communication" not in each.reflex for each in reflexes)
    late, loads = [motion.late for motion in motions], [motion.load for motion in motions]
    row(
        name,
        len(motions),
        f"{len(reflexes)} ({without_loss})",
        sum(bool(motion.stopped) for motion in motions),
        sum(motion.cycles for motion in motions),
        f"{sum(late)} ({max(late)})",
        sum(motion.lost for motion in motions),
        " / ".join(f"{answer:.0f}" for answer in answers),
        f"{max(motion.following for motion in motions):.2f}",
        f"{min(loads):.1f} to {max(loads):.1f}",
    )
    for motion in motions:
        if why := motion.reflex or motion.stopped:
            print(f"{name}: {why}, after {motion.lost} lost cycles", file=sys.stderr)
    sys.stdout.flush()


def print_lateness(seconds: float) -> None:
    """Print how late a loop of 1 kHz wakes that does nothing else, at the pacer's priority."""
    late = np.zeros(round(seconds / FR3.period))
    with raise_priority(PACER):
        begun = time.monotonic()
        for k in range(late.size):
            due = begun + k * FR3.period
            time.sleep(max(0.0, due - time.monotonic()))
            late[k] = time.monotonic() - due
    # Cycles that fall due while it sleeps on are late for the same stall.
    stalls = (late > FR3.period) & (np.diff(late, prepend=0.0) > 0.0)
    lost = [f"{int((stalls & (late > n * FR3.period)).sum())} lose {n} or more" for n in (1, 3, 5)]
    worst = f"at worst {1e3 * late.max():.1f} ms late"
    print(f"A bare loop, {late.size} cycles: {', '.join(lost)}; {worst}", file=sys.stderr)


def read_kept(file: Path | None) -> dict[tuple[str, int], Found]:
    """Return what motions came to that were driven before, by row and number."""
    if file is None or not file.exists():
        return {}
    lines = map(json.loads, file.read_text().splitlines())
    return {(line["row"], line["motion"]): Found(**line["found"]) for line in lines}


def keep(file: Path | None, row: str, motion: int, found: Found) -> None:
    """Keep what a motion came to."""
    if file is not None:
        with file.open("a") as lines:
            lines.write(json.dumps({"row": row, "motion": motion, "found": vars(found)}) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_judge(parser, required=True)
    parser.add_argument("--known", type=int, default=50, help="motions with J known")
    parser.add_argument("--learned", type=int, default=50, help="motions with J learned")
    parser.add_argument("--slc", type=int, default=20, help="motions of SLC")
    parser.add_argument("--busy", type=int, default=0, help="further programs that are busy")
    parser.add_argument("--beside", action="store_true", help="a campaign runs meanwhile")
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--no-compiled", action="store_true", help="the law is beside the pacer")
    ways.add_argument("--both", action="store_true", help="each motion in both ways, in turn")
    parser.add_argument("--bare", type=float, default=0.0, help="duration of a bare loop [s]")
    add_kept(parser)
    asked = parser.parse_args()
    ways = [True, False] if asked.both else [not asked.no_compiled]
    known = read_kept(asked.kept)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(asked.busy)]
    head(
        *("law", "motions", "reflexes (without a lost cycle)", "other stops", "cycles"),
        *("late (most in a motion)", "lost", "answers [us]: median / p99 / p99.9 / worst"),
        *("velocity off [rad/s]", "load"),
        made_by=f"{_COMMAND} --judge PYTHON"
        + (" --both" if asked.both else " --no-compiled" if asked.no_compiled else "")
        + (" --beside" if asked.beside else "")
        + (f" --busy {asked.busy}" if asked.busy else ""),
    )
    try:
        with beside_a_campaign() if asked.beside else nullcontext(), served(asked.judge) as server:
            if asked.bare:
                print_lateness(asked.bare)
            for name, count in zip(LAWS, (asked.known, asked.learned, asked.slc), strict=True):
                rows: dict[str, list[Found]] = {}
                for number, experiment in enumerate(islice(experiments(LAWS[name]), count)):
                    for compiled in ways:
                        title = f"{name}, {'in C' if compiled else 'beside the pacer'}"
                        if (title, number) not in known:
                            found = drive(experiment, server, compiled=compiled)
                            known[title, number] = found
                            keep(asked.kept, title, number, found)
                        rows.setdefault(title, []).append(known[title, number])
                for title, motions in rows.items():
                    print_row(title, motions)
    finally:
        for process in busy:
            process.kill()


if __name__ == "__main__":
    main()
