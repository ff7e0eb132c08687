"""Whether a Franka FR3's controller would accept commands, by its constants and by franka-sim.

Random motions at full limits, whose targets jump or follow a nephroid, half of them from random
postures. The commands of the adaptive law, with and without the envelope of the velocity, and those
of mink and of Ruckig behind it, are judged

- by the constants that libfranka publishes, written out here once more, and
- by franka-sim's `MotionLimitChecker`, in an environment of its own, as velocities and as the
  positions that they lead to::

    python -m venv /path/to/venv && /path/to/venv/bin/pip install franka-sim==1.1.7
    python benchmarks/fr3_conformance.py --judge /path/to/venv/bin/python

Without ``--judge`` only the constants judge. The last rows need mink and ruckig.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import Adaptive, Arm, Array, JointLimits, load_arm
from markdown_table import head, row
from peer_schemes.tasks import Braking, Task

_COMMAND = "python benchmarks/fr3_conformance.py"
PERIOD, STEPS = 1e-3, 2000
#: How the path is joined [m/s^2, m/s].
BRAKING, FASTEST = 2.0, 1.0
#: Acceleration from which to its opposite the robot lets a velocity go at once [rad/s^2].
SLOW = 2.4
#: Motions that are made and judged at a time.
BLOCK = 100
#: Random starts are this far within where joints may rest [rad].
INSIDE = 0.02

# The constants of the robot, base to flange, as libfranka 0.21 publishes them.
LOWER = np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196])
UPPER = np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196])
VELOCITY = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
OFFSET = np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35])
DECELERATION = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])
ACCELERATION, JERK, TOLERANCE = 10.0, 5000.0, 1e-3


class Errand(Task):
    """A motion that is asked for: a start, and where the end effector should be at each sample.

    Args:
        arm: The arm.
        limits: Limits that the law is given.
        seed: Decides on the motion.
        known: Whether J is known.
    """

    def __init__(self, arm: Arm, limits: JointLimits, seed: int, *, known: bool = True) -> None:
        rng = np.random.default_rng(seed)
        self.name, self.oriented, self.known, self.seed = f"errand {seed}", False, known, seed
        self.arm, self.limits, self.period, self.steps = arm, limits, PERIOD, STEPS
        lower, upper = arm.limits.resting
        drawn = rng.uniform(lower + INSIDE, upper - INSIDE)
        self.start = drawn if seed % 2 else arm.home
        kinematics = arm.kinematics()
        self.R_WE = np.broadcast_to(kinematics.R_WE(self.start), (STEPS + 2, 3, 3))
        ways = _jumps(rng) if seed % 4 < 2 else _nephroid(rng)
        self.p_WE = kinematics.p_WE(self.start) + ways


def _jumps(rng: np.random.Generator) -> Array:
    """Return targets that jump by up to 0.5 m each second, shape (STEPS + 2, 3) [m]."""
    ways = rng.normal(size=(-(-STEPS // 1000), 3))
    ways *= rng.uniform(0.1, 0.5, (len(ways), 1)) / np.linalg.norm(ways, axis=1, keepdims=True)
    return np.repeat(ways, 1000, axis=0)[np.minimum(np.arange(STEPS + 2), STEPS - 1)]


def _nephroid(rng: np.random.Generator) -> Array:
    """Return a nephroid in a random plane, passed in 1 to 2 s, shape (STEPS + 2, 3) [m]."""
    plane, _ = np.linalg.qr(rng.normal(size=(3, 2)))
    size, lap = rng.uniform(0.02, 0.08), rng.uniform(1.0, 2.0)
    phase = 2.0 * np.pi * PERIOD * np.arange(STEPS + 2) / lap
    curve = np.stack(
        (3.0 * np.cos(phase) - np.cos(3.0 * phase), 3.0 * np.sin(phase) - np.sin(3.0 * phase)), -1
    )
    return size * (curve - curve[0]) @ plane.T


#: Velocities of an errand, held sample by sample, shape (STEPS, 7) [rad/s].
Commands = Callable[[Errand], Array]


def adaptive(errand: Errand) -> Array:
    """Return the commands of the adaptive law."""
    law = Adaptive(
        limits=errand.limits,
        home=errand.start,
        jacobian="known" if errand.known else "learned",
        braking=BRAKING,
        feedback_limit=FASTEST,
    )
    reading, kinematics = law.sampled(PERIOD), errand.arm.kinematics()
    q, x, commands = errand.start.copy(), None, np.empty((STEPS, errand.arm.n))
    for k in range(STEPS):
        u = {"position": q, "p_WE": kinematics.p_WE(q)}
        u |= {"p_WE_desired": errand.p_WE[k], "p_preview": errand.p_WE[k + 1]}
        if errand.known:
            u["J"] = kinematics.J(q)
        if x is None:
            x = reading.initial_state(np.random.default_rng(errand.seed), u)
        x = reading.step(k * PERIOD, x, u, PERIOD)
        commands[k] = reading.commanded_velocity((k + 1) * PERIOD, x)
        q = q + PERIOD * commands[k]
    return commands


def mink(errand: Errand) -> Array:
    """Return the commands of mink, within limits of position and velocity."""
    return np.array(list(_of_mink(errand, lambda v: v)))


def ruckig(errand: Errand) -> Array:
    """Return those of Ruckig behind mink, within limits of acceleration and jerk besides."""
    from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig, Synchronization

    n = errand.arm.n
    generator, given, made = Ruckig(n, PERIOD), InputParameter(n), OutputParameter(n)
    given.control_interface = ControlInterface.Velocity
    given.synchronization = Synchronization.No
    given.max_acceleration = errand.limits.require("acceleration", "Ruckig").tolist()
    given.max_jerk = errand.limits.require("jerk", "Ruckig").tolist()
    given.current_position = given.current_velocity = given.current_acceleration = [0.0] * n

    def shaped(v: Array) -> Array:
        given.target_velocity, given.target_acceleration = v.tolist(), [0.0] * n
        generator.update(given, made)
        made.pass_to_input(given)
        return np.array(made.new_velocity)

    return np.array(list(_of_mink(errand, shaped)))


def _of_mink(errand: Errand, shaped: Callable[[Array], Array]) -> Iterator[Array]:
    """Yield what is made of mink's velocities, sample by sample."""
    from peer_schemes.mink_scheme import Mink
    from peer_schemes.scheme import NoSolutionError

    class Brisk(Mink):
        braking = Braking(BRAKING, FASTEST, gain=100.0)

    scheme, q, v = Brisk(errand), errand.start.copy(), np.zeros(errand.arm.n)
    for k in range(STEPS):
        try:
            wanted = scheme.velocity(k, q, v)
        except NoSolutionError:
            wanted = np.zeros(errand.arm.n)
        v = shaped(wanted)
        yield v
        q = q + PERIOD * v


@dataclass(frozen=True)
class Objections:
    """What the constants object to in a motion.

    Attributes:
        samples: Commands that are objected to, by what they break.
        distance: Least distance of the velocity to the robot's envelope [rad/s].
    """

    samples: dict[str, Array]
    distance: float

    @property
    def count(self) -> int:
        """Number of commands that break anything."""
        return int(np.any(list(self.samples.values()), axis=0).sum())

    @property
    def kinds(self) -> list[str]:
        """What is broken."""
        return [name for name, broken in self.samples.items() if broken.any()]


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
    return Objections({name: x.any(axis=1) for name, x in broken.items()}, float(distance.min()))


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


def by_franka_sim(python: str, errands: list[Errand], commands: Array) -> list[dict[str, Any]]:
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


def judge(name: str, errands: list[Errand], of: Commands, python: str | None) -> None:
    """Print the row of commands of one kind, if there are any."""
    if not errands:
        return
    ours: list[Objections] = []
    theirs: list[dict[str, Any]] = []
    # All commands of thousands of motions would be large.
    for begin in range(0, len(errands), BLOCK):
        block = errands[begin : begin + BLOCK]
        commands = np.array([of(errand) for errand in block])
        ours += [by_constants(e.start, v) for e, v in zip(block, commands, strict=True)]
        theirs += [] if python is None else by_franka_sim(python, block, commands)
    kinds = sorted({kind for each in ours for kind in each.kinds})
    cells = [_told([each.count for each in ours])]
    first = ""
    for mode in () if python is None else ("velocity", "position"):
        cells.append(_told([each[mode][0] for each in theirs]))
        first = first or next((each[mode][1] for each in theirs if each[mode][1]), "")
    distance = min(each.distance for each in ours)
    samples = len(errands) * STEPS
    row(name, len(errands), samples, *cells, f"{distance:.2g}", ", ".join(kinds) or "nothing")
    sys.stdout.flush()
    if first:
        print(f"{name}: franka-sim's first objection: {first}", file=sys.stderr)


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
    parser.add_argument("--judge", metavar="PYTHON", help="a Python that has franka-sim")
    parser.add_argument("--motions", type=int, default=130, help="motions with J known")
    parser.add_argument("--learned", type=int, default=18, help="motions with J learned")
    parser.add_argument("--others", type=int, default=24, help="motions of each other kind")
    parser.add_argument("--cost", action="store_true", help="time a step of the law instead")
    options = parser.parse_args()
    if options.cost:
        return cost()
    arm = load_arm("fr3")
    plain = arm.limits.replace(envelope_offset=None, envelope_deceleration=None)

    def errands(count: int, limits: JointLimits = arm.limits, **changes: Any) -> list[Errand]:
        return [Errand(arm, limits, seed, **changes) for seed in range(count)]

    theirs = ["franka-sim, as velocities", "franka-sim, as positions"] if options.judge else []
    head(
        *("commands", "motions", "samples", "objected to, motions (samples): constants", *theirs),
        *("least distance to the envelope [rad/s]", "what the constants object to"),
        made_by=f"{_COMMAND} --judge PYTHON",
    )
    judge("adaptive, J known", errands(options.motions), adaptive, options.judge)
    judge("adaptive, J learned", errands(options.learned, known=False), adaptive, options.judge)
    few = errands(options.others)
    without = errands(options.others, plain)
    judge("adaptive, J known, without the envelope", without, adaptive, options.judge)
    slow = arm.limits.replace(acceleration=SLOW, jerk=None)
    name = f"adaptive, J known, no bound of the jerk, {SLOW:g} rad/s^2"
    judge(name, errands(options.others, slow), adaptive, options.judge)
    fast = arm.limits.replace(jerk=None)
    name = "adaptive, J known, no bound of the jerk, 9.999 rad/s^2"
    judge(name, errands(options.others, fast), adaptive, options.judge)
    if missing := [name for name in ("mink", "ruckig") if few and find_spec(name) is None]:
        sys.exit(f"{' and '.join(missing)}: not installed; the rows with it are left out")
    judge("mink, limits of position and velocity", few, mink, options.judge)
    judge("Ruckig behind mink", few, ruckig, options.judge)


if __name__ == "__main__":
    main()
