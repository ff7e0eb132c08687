"""Whether a Franka FR3's controller would accept commands, by its constants and by franka-sim.

The commands of the adaptive law for the motions of `fr3_motions.py`, with and without the envelope
of the velocity, and those of mink and of Ruckig behind it, are judged

- by the constants that libfranka publishes, written out here once more, and
- by franka-sim's `MotionLimitChecker`, in an environment of its own, as velocities and as the
  positions that they lead to::

    python -m venv /path/to/venv && /path/to/venv/bin/pip install franka-sim==1.1.7
    python benchmarks/fr3_conformance.py --judge /path/to/venv/bin/python

Without ``--judge`` only the constants judge. The last rows need mink and ruckig. With ``--kept
FILE`` what was found of each block of motions is kept as a line of that file, and not made again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import Adaptive, Arm, Array, JointLimits, load_arm
from fr3_motions import PERIOD, STEPS, Commands, Errand, adaptive, mink, ruckig
from kept_cases import Found, cases
from markdown_table import head, row
from shared_options import add_judge, add_kept

_COMMAND = "python benchmarks/fr3_conformance.py"
#: Acceleration from which to its opposite the robot lets a velocity go at once [rad/s^2].
SLOW = 2.4
#: Motions that are made and judged at a time.
BLOCK = 1000

# The constants of the robot, base to flange, as libfranka 0.21 publishes them.
LOWER = np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196])
UPPER = np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196])
VELOCITY = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
OFFSET = np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35])
DECELERATION = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])
ACCELERATION, JERK, TOLERANCE = 10.0, 5000.0, 1e-3


@dataclass(frozen=True)
class Objections:
    """What the constants object to in a motion.

    Attributes:
        count: Number of commands that break anything.
        kinds: What is broken.
        distance: Least distance of the velocity to the robot's envelope [rad/s].
    """

    count: int
    kinds: list[str]
    distance: float


def by_constants(start: Array, velocity: Array) -> Objections:
    """Judge held velocities, from rest, of an arm that follows them exactly.

    Args:
        start: Joint positions at the start, shape (7,) [rad].
        velocity: The velocities, shape (k, 7) [rad/s].
    """
    still = np.zeros((1, start.size))
    acceleration = np.diff(velocity, axis=0, prepend=still) / PERIOD
    jerk = np.diff(acceleration, axis=0, prepend=still) / PERIOD
    q = start + PERIOD * np.vstack((still, np.cumsum(velocity, axis=0)))
    # The velocity is held from one of these positions to the next, and judged at both.
    distance = np.minimum(_distance(q[:-1], velocity), _distance(q[1:], velocity))
    broken = {
        "envelope": distance < 0.0,
        "acceleration": np.abs(acceleration) > ACCELERATION,
        "jerk": np.abs(jerk) > JERK,
        "position": (q[1:] < LOWER) | (q[1:] > UPPER),
    }
    count = int(np.any(list(broken.values()), axis=(0, 2)).sum())
    kinds = [name for name, samples in broken.items() if samples.any()]
    return Objections(count, kinds, float(distance.min()))


def _distance(q: Array, v: Array) -> Array:
    """Return how far velocities are below the robot's envelope, shape (k, 7) [rad/s]."""
    up, down = (
        np.minimum(
            VELOCITY,
            np.maximum(0.0, np.sqrt(2.0 * DECELERATION * np.maximum(room, 0.0)) - OFFSET),
        )
        - TOLERANCE
        for room in (UPPER - q, q - LOWER)
    )
    return np.minimum(up - v, down + v)


def by_franka_sim(python: str, errands: Sequence[Errand], commands: Array) -> list[dict[str, Any]]:
    """Return what franka-sim's checker objects to in each motion, see `fr3_judge.py`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "commands.npz"
        np.savez(file, start=[errand.start for errand in errands], velocity=commands)
        judge = Path(__file__).with_name("fr3_judge.py")
        done = subprocess.run([python, judge, file], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"--judge: {python} could not judge: {done.stderr.strip()[-400:]}")
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


@dataclass(frozen=True)
class Asked:
    """What a row of the table is about.

    Attributes:
        name: Its name.
        count: Number of motions.
        of: What makes the commands.
        changes: Changes of the limits of the arm that the law is given.
        known: Whether J is known.
    """

    name: str
    count: int
    of: Commands
    changes: dict[str, Any]
    known: bool = True

    @property
    def block(self) -> int:
        """Number of motions at a time."""
        return min(BLOCK, self.count)


def found(asked: Asked, python: str | None, begin: int) -> Found:
    """Return what is objected to in the block of motions that begins with a seed."""
    arm = load_arm("fr3")
    limits = arm.limits.replace(**asked.changes)
    seeds = range(begin, begin + asked.block)
    errands = [Errand(arm, limits, seed, known=asked.known) for seed in seeds]
    commands = asked.of(errands)
    ours = [by_constants(e.start, v) for e, v in zip(errands, commands, strict=True)]
    theirs = [] if python is None else by_franka_sim(python, errands, commands)
    return {"constants": [asdict(each) for each in ours], "franka_sim": theirs}


def judge(asked: Asked, python: str | None, judged: int, kept: Path | None) -> None:
    """Print a row, if there are any motions of it; franka-sim judges the first of them."""
    if not asked.count:
        return
    name, blocks = f"{asked.name}, {asked.block} at a time", range(0, asked.count, asked.block)
    by_both = [begin for begin in blocks if python is not None and begin < judged]
    by_one = [begin for begin in blocks if begin not in by_both]
    made = cases(partial(found, asked, python), by_both, 1, kept, f"{name}, by franka-sim")
    made += cases(partial(found, asked, None), by_one, 1, kept, name)
    ours = [each for block in made for each in block["constants"]]
    theirs = [each for block in made for each in block["franka_sim"]]
    kinds = sorted({kind for each in ours for kind in each["kinds"]})
    cells = [_told([each["count"] for each in ours])]
    first, few = "", f" of {len(theirs)}" if len(theirs) < len(ours) else ""
    for mode in () if python is None else ("velocity", "position"):
        cells.append(_told([each[mode][0] for each in theirs]) + few)
        first = first or next((each[mode][1] for each in theirs if each[mode][1]), "")
    distance = min(each["distance"] for each in ours)
    samples = len(ours) * STEPS
    row(asked.name, len(ours), samples, *cells, f"{distance:.2g}", ", ".join(kinds) or "nothing")
    sys.stdout.flush()
    if first:
        print(f"{asked.name}: franka-sim's first objection: {first}", file=sys.stderr)


def _told(counts: list[int]) -> str:
    return f"{np.count_nonzero(counts)} ({sum(counts)})"


def cost() -> None:
    """Print what a step of the law takes with the envelope over one without, far from limits.

    Steps of both are taken in turns, and the fastest tenth of each counts: the machine's pace
    changes.
    """
    arm = load_arm("fr3")
    plain = arm.limits.replace(envelope_offset=None, envelope_deceleration=None)
    steps = [_step(arm, limits, arm.home) for limits in (arm.limits, plain)]
    times = np.array([[_timed(step) for step in steps] for _ in range(4000)])
    best = np.quantile(times, 0.1, axis=0)
    head("J", "step with the envelope over one without", made_by=f"{_COMMAND} --cost")
    row("known", f"{best[0] / best[1]:.2f}")


def _step(arm: Arm, limits: JointLimits, start: Array) -> Callable[[], Array]:
    """Return a step of the law at rest at its target."""
    kinematics = arm.kinematics()
    reading = Adaptive(limits=limits, home=start).sampled(PERIOD)
    p = kinematics.p_WE(start)
    u = {"position": start, "J": kinematics.J(start)}
    u |= {"p_WE": p, "p_WE_desired": p, "p_preview": p}
    x = reading.initial_state(np.random.default_rng(0), u)
    return lambda: reading.step(0.0, x, u, PERIOD)


def _timed(step: Callable[[], Array]) -> float:
    began = time.perf_counter()
    step()
    return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_judge(parser)
    parser.add_argument("--motions", type=int, default=5000, help="motions with J known")
    parser.add_argument("--learned", type=int, default=5000, help="motions with J learned")
    parser.add_argument("--judged", type=int, default=5000, help="of each, judged by franka-sim")
    parser.add_argument("--others", type=int, default=24, help="motions of each other kind")
    add_kept(parser)
    parser.add_argument("--cost", action="store_true", help="time a step of the law instead")
    options = parser.parse_args()
    if options.cost:
        return cost()
    for name in ("motions", "learned", "others"):
        if (count := getattr(options, name)) > BLOCK and count % BLOCK:
            parser.error(f"--{name}: must be a multiple of {BLOCK} or less, not {count}")
    plain = {"envelope_offset": None, "envelope_deceleration": None}
    few = options.others
    rows = [
        Asked("adaptive, J known", options.motions, adaptive, {}),
        Asked("adaptive, J learned", options.learned, adaptive, {}, known=False),
        Asked("adaptive, J known, without the envelope", few, adaptive, plain),
        *(
            Asked(
                f"adaptive, J known, no bound of the jerk, {told} rad/s^2", few, adaptive, changes
            )
            for told, changes in (
                (f"{SLOW:g}", {"acceleration": SLOW, "jerk": None}),
                ("9.999", {"jerk": None}),
            )
        ),
        Asked("mink, limits of position and velocity", few, mink, {}),
        Asked("Ruckig behind mink", few, ruckig, {}),
    ]
    theirs = ["franka-sim, as velocities", "franka-sim, as positions"] if options.judge else []
    head(
        *("commands", "motions", "samples", "objected to, motions (samples): constants", *theirs),
        *("least distance to the envelope [rad/s]", "what the constants object to"),
        made_by=f"{_COMMAND} --judge PYTHON --judged {options.judged}",
    )
    missing = [name for name in ("mink", "ruckig") if few and find_spec(name) is None]
    for asked in rows[: -2 if missing else None]:
        judge(asked, options.judge, options.judged, options.kept)
    if missing:
        sys.exit(f"{' and '.join(missing)}: not installed; the rows with it are left out")


if __name__ == "__main__":
    main()
