"""How a guard fares with calls that come late, and with places of an obstacle that are wrong.

An arm swings to and fro between two postures, and a ball goes to where its tool will be next, by
turns, at its full speed. Time is that of a real loop: a command is reached a period after its call,
and the arm waits there until the next one, while the ball goes on::

    python benchmarks/late_calls.py --cases 200
    python benchmarks/late_calls.py --cases 200 --untimed     # calls that do not tell the time

Distances are those of balls from capsules whose ends Drake's plant places, in 20 instants of each
period where anything is near. A case ends when the ball touches an arm at rest, which is promised
nothing.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from drake_rnn import Arm, Array, Guard, JointStream, arm_clearance, load_arm, make_obstacles
from drake_rnn.robot.clearance.arm_capsules import capsules_of
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

ARMS = ("panda", "iiwa14", "ur5")
KINDS = (
    "late calls",
    "calls that jitter",
    "pauses",
    "another first place",
    "not measured",
    "outliers",
    "places of before",
    "a ball that is faster",
)
CALLS, INSTANTS, NEAR, FREE = 300, 20, 0.06, 0.05


class Distances:
    """Distances of a ball from an arm, by Drake's kinematics.

    Args:
        arm: The arm.
        bodies: Names of the bodies that count.
        center: Where the ball is stated, shape (3,) [m].
        radius: Its radius [m].
    """

    def __init__(self, arm: Arm, bodies: set[str], center: Array, radius: float) -> None:
        self._arm, self._plant = arm, arm.plant()
        self._context = self._plant.CreateDefaultContext()
        self._capsules = [c for c in capsules_of(arm)[0] if c.body in bodies]
        self._radii = np.array([c.radius for c in self._capsules]) + radius
        self._center = center

    def gap(self, q: Array, p_WO: Array) -> float:
        """Return the distance in a posture, shape (n,) [rad], of a ball moved by p_WO [m]."""
        plant = self._plant
        plant.SetPositions(self._context, self._arm.posture(plant, q))
        poses = (plant.GetBodyByName(c.body).EvalPoseInWorld(self._context) for c in self._capsules)
        ends = np.array(
            [[X @ end for end in c.ends] for X, c in zip(poses, self._capsules, strict=True)]
        )
        begin, way = ends[:, 0], ends[:, 1] - ends[:, 0]
        to = self._center + p_WO - begin
        length = np.maximum((way * way).sum(axis=1), 1e-18)
        share = np.clip((to * way).sum(axis=1) / length, 0.0, 1.0)
        return float((np.linalg.norm(to - share[:, None] * way, axis=1) - self._radii).min())

    def tool(self, q: Array) -> Array:
        """Return the way from the ball to the last body in a posture, shape (3,) [m]."""
        plant = self._plant
        plant.SetPositions(self._context, self._arm.posture(plant, q))
        capsule = self._capsules[-1]
        X = plant.GetBodyByName(capsule.body).EvalPoseInWorld(self._context)
        return np.asarray(X @ np.mean(capsule.ends, axis=0) - self._center)


@dataclass
class Ball:
    """A ball that goes at the tool by turns.

    Attributes:
        rng: What it decides by.
        speed: Its speed [m/s].
        margin: How near it comes to the arm by itself [m]; negative for right through it.
        place: How far it has gone, shape (3,) [m].
        spell: For how many more steps it goes.
    """

    rng: np.random.Generator
    speed: float
    margin: float
    place: Array
    spell: int = 0

    def go_on(self, distances: Distances, q: Array, ahead: Array, time: float) -> Array:
        """Go on for a time [s]; return where it is then.

        Args:
            distances: Distances from the arm.
            q: Where that is, shape (n,) [rad].
            ahead: Where it is going, likewise.
            time: The time.
        """
        if self.spell == 0 and self.rng.random() < 0.1:
            self.spell = int(self.rng.integers(20, 120))
        self.spell = max(self.spell - 1, 0)
        way = distances.tool(0.5 * (q + ahead)) - self.place
        step = min(self.speed * time, float(np.linalg.norm(way)))
        if self.spell and distances.gap(q, self.place) > self.margin + step:
            self.place = self.place + step * way / np.linalg.norm(way)
        return self.place


class Case:
    """One case.

    Args:
        seed: Its seed.
        kind: What is wrong in it.
        timed: Whether calls tell the time.
    """

    def __init__(self, seed: int, kind: str, timed: bool) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.kind, self.timed = kind, timed
        self.period = float(rng.choice([0.004, 0.008, 0.01]))
        arm = load_arm(ARMS[seed % len(ARMS)])
        home, jerk = np.asarray(arm.home), (None, 100.0)[seed // len(ARMS) % 2]
        self.swing = rng.uniform(0.3, 0.8) * np.eye(arm.n)[0] + rng.uniform(-0.2, 0.2, arm.n)
        self.home, radius = home, float(rng.uniform(0.03, 0.08))
        self.speed, self.error = rng.uniform(0.1, 0.4), float(rng.choice([0.0, 0.002, 0.005]))
        ball = {"kind": "ball", "radius": radius, "speed": self.speed, "error": self.error}
        tool, place = arm.kinematics().p_WE(home), np.zeros(3)
        while True:
            # One that has time to come begins farther away.
            least, most = (0.5, 1.0) if kind in (KINDS[0], KINDS[2]) else (0.2, 0.45)
            center = tool + rng.uniform(least, most) * _direction(rng)
            if kind == KINDS[3]:
                place = rng.uniform(0.3, 2.0) * _direction(rng)
                center = center - place
            obstacles = make_obstacles([{**ball, "center": center.tolist()}])
            clearance, _ = arm_clearance(arm, obstacles, home)
            bodies = {one for one, other in clearance.names if other == "ball 1"}
            self.distances = Distances(arm, bodies, center, radius)
            if min(self.distances.gap(home, p) for p in (np.zeros(3), place)) > FREE:
                break
        limits = arm.limits.replace(velocity=1.0, acceleration=4.0, jerk=jerk)
        faster = rng.uniform(1.5, 3.0) if kind == KINDS[7] else 1.0
        margin = float(rng.choice([-1.0, 0.006, 0.02]))
        self.ball = Ball(rng, faster * self.speed, margin, place)
        self.t, self.until, self.stale = 0.0, 0, self.ball.place
        self.away, self.q, self.aim = np.zeros(3), home, home
        # Where the arm is going, and how long it takes until then.
        self.goal, self.left = home, 0.0
        known = {} if kind == KINDS[3] and rng.random() < 0.5 else {"p_WO": self.measured(0)}
        law = JointStream(limits=limits, home=home, clearance=clearance)
        self.guard = Guard(law, self.period, compiled=False, **self.now(), **known)

    def now(self) -> dict[str, Any]:
        """Return the time as a call tells it."""
        return {"t": self.t} if self.timed else {}

    def measured(self, k: int) -> Array:
        """Return the place of the ball as measured at a call, shape (1, 3) [m]."""
        rng, kind, p = self.rng, self.kind, self.ball.place
        right = p + self.error * _direction(rng)
        if kind in KINDS[4:7] and k > self.until and rng.random() < 0.02:
            self.until = k + int(rng.integers(1, 50 if kind != KINDS[5] else 20))
            self.away = np.exp(rng.uniform(np.log(0.05), np.log(2.0))) * _direction(rng)
            self.stale = right
        if k < self.until:
            wrong = {KINDS[4]: np.full(3, np.nan), KINDS[5]: right + self.away}
            right = wrong.get(kind, self.stale)
        return right[None]

    def delay(self) -> float:
        """Return by how much the next call is late [s]."""
        rng, kind = self.rng, self.kind
        if kind == KINDS[1]:
            return float(rng.uniform(-0.5, 0.5)) * self.period
        if kind in (KINDS[0], KINDS[2]) and rng.random() < 0.04:
            return float(np.exp(rng.uniform(np.log(1e-3), np.log(2.0))))
        return 0.0

    def step(self, k: int) -> tuple[float, bool]:
        """Make a call; return the least distance until the next [m], and whether the arm moved."""
        aim = self.home + (self.swing if k // 80 % 2 == 0 else -self.swing)
        limits = self.guard.law.limits
        self.aim = np.clip(aim, limits.position_lower, limits.position_upper)
        q = self.guard.command(self.aim, self.measured(k), **self.now())
        if np.abs(q - self.goal).max() > 1e-12:
            self.goal, self.left = q, self.period
        delay, least, moved = self.delay(), np.inf, self.left > 0.0
        until = self.t + self.period + delay
        if moved:
            lasts = min(self.left, self.period + delay)
            begin, p = self.q, self.ball.place
            self.q = begin + lasts / self.left * (self.goal - begin)
            p_end = self.ball.go_on(self.distances, begin, self.aim, lasts)
            least = self._least(begin, self.q, p, p_end)
            self.t, self.left = self.t + lasts, max(self.left - lasts, 0.0)
        self._wait(until - self.t)
        self.t = until
        if self.kind == KINDS[2] and delay > 0.0:
            none = np.zeros(q.size)
            self.guard.resume(q, none, none, **self.now())
        return least, moved

    def _least(self, begin: Array, end: Array, p: Array, p_end: Array) -> float:
        least = min(self.distances.gap(begin, p), self.distances.gap(end, p_end))
        if least > NEAR:
            return least
        shares = np.linspace(0.0, 1.0, INSTANTS + 1)[1:-1]
        inner = (self.distances.gap(begin + s * (end - begin), p + s * (p_end - p)) for s in shares)
        return min(least, *inner)

    def _wait(self, time: float) -> None:
        """Let a time pass [s] in which the arm stands."""
        while time > 1e-12:
            step = min(time, self.period)
            self.ball.go_on(self.distances, self.q, self.aim, step)
            self.t, time = self.t + step, time - step


def _direction(rng: np.random.Generator) -> Array:
    away = rng.normal(size=3)
    return np.asarray(away / np.linalg.norm(away))


def run(number: int, timed: bool) -> dict[str, float]:
    """Return what a case comes to."""
    case = Case(number, KINDS[number % len(KINDS)], timed)
    guard, moving, hit = case.guard, np.inf, False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for k in range(CALLS):
            least, moved = case.step(k)
            moving = min(moving, least)
            hit = not moved and case.distances.gap(case.q, case.ball.place) < 0.0
            if hit or moving < 0.0:
                break
    return {
        "kind": float(number % len(KINDS)),
        "moving": moving,
        "hit": float(hit),
        "told": float(sum(guard.jumps.values()) + guard.part("uncertified").item() > 0),
        "stops": float(guard.late_stops),
        "calls": float(k + 1),
        "held": guard.part("held_back").item(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--untimed", action="store_true", help="calls do not tell the time")
    add_case_options(parser)
    options = parser.parse_args()
    task = partial(run, timed=not options.untimed)
    found = cases(task, range(options.cases), options.jobs, options.kept, str(options.untimed))
    head(
        "case",
        "cases",
        "touched while it moved",
        "of these untold",
        "least distance while it moved [mm]",
        "hit while it stood still",
        "told",
        "stopped by a late call",
        "samples held back",
    )
    for number, kind in enumerate(KINDS):
        of = [each for each in found if each["kind"] == number]
        if not of:
            continue
        touched = [each for each in of if each["moving"] < 0.0]
        row(
            kind,
            len(of),
            len(touched),
            sum(not each["told"] for each in touched),
            f"{1e3 * min(each['moving'] for each in of):.2f}",
            sum(int(each["hit"]) for each in of),
            sum(int(each["told"]) for each in of),
            sum(int(each["stops"]) for each in of),
            sum(int(each["held"]) for each in of),
        )


if __name__ == "__main__":
    main()
