"""A stick that is held: whether an arm behind the shield rests, tells why, and leaves again.

An operator holds a stick for some seconds, as a twist of the tool, as velocities of the joints, or
as a pose: into the arm's own body, into a table or a wall, or past the end of its reach. Then it is
moved back the way that it came::

    python benchmarks/held_stick.py --cases 10000 --kept FILE --jobs 2
    python benchmarks/held_stick.py --cases 200 --meshes FOLDER

Arm, period (1, 5, 10 ms), bounds of acceleration and jerk (50, 500, 5000 rad/s^3), the kind of
target, what it is held into, speed and start are drawn from the seed of each episode. Steps are in
C; each combination of the first three, with an obstacle and without, is built once. ``--numpy``
builds none.

An episode has these judgements:

- *limits*: velocities, their differences and second differences beyond a bound by more than 1e-9 of
  it, or positions beyond theirs;
- *collided*: the least distance of the motion, by the law's capsules between samples and, with
  ``--meshes``, by the makers' meshes as in `chunks.py`;
- *rests*: progress has ended when the tool goes no further than a millimetre along what is asked
  for until the stick is let go of; 2 s later no joint may be faster than 0.01 rad/s;
- *tells*: within 0.3 s of that, ``limited_by`` names what is in the way, a pair that is nearer than
  3 mm beyond the distance at which arms rest, or a limit, and ``blocked_for`` counts;
- *leaves*: 0.5 s after the stick is moved back, a joint has moved by a milliradian or more.

Episodes in which progress does not end are counted apart: an arm that slides along a wall.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from functools import cache, partial
from typing import Any

import numpy as np

from drake_rnn import (
    Arm,
    Array,
    InvalidInputError,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from kept_cases import Found, cases
from markdown_table import head, row
from shared_options import add_case_options

ARMS = ("panda", "fr3", "iiwa14", "ur5")
KINDS = ("twist", "velocity", "pose")
INTO = ("own body", "table", "wall", "end of reach")
PERIODS = (1e-3, 5e-3, 1e-2)
# Bounds of acceleration and jerk, of each of which a step is built [rad/s^2, rad/s^3].
BOUNDS = ((2.0, 50.0), (5.0, 500.0), (10.0, 5000.0))
# Times of holding and of leaving [s], and how long after progress has ended an arm is at rest [s].
HELD, LEFT, SETTLED = 9.0, 0.5, 2.0
# Progress that does not count [m], speed at rest [rad/s], motion that counts as leaving [rad].
PROGRESS, REST, LEAVES = 1e-3, 0.01, 1e-3
# Within which time the alarm is to tell [s], and how near a pair is in the way [m].
ALARM, NEAR = 0.3, 0.013
# What is beyond a limit, as a share of it.
EXACT = 1e-9


@cache
def arm_of(name: str) -> Arm:
    """Return an arm without a tool."""
    return load_arm(name, tool=None)


def scene(rng: np.random.Generator, into: str, arm: Arm, q: Array) -> tuple[list[Any], Array]:
    """Return obstacles, and the point that the stick is held towards, shape (3,) [m]."""
    p_WE = arm.kinematics().p_WE(q)
    out = p_WE[:2] / max(float(np.linalg.norm(p_WE[:2])), 1e-9)
    if into == "own body":
        return [], np.array([0.0, 0.0, rng.uniform(0.1, 0.5)])
    if into == "end of reach":
        way = np.append(out, rng.uniform(-0.5, 0.8))
        return [], p_WE + 3.0 * way
    if into == "table":
        height = p_WE[2] - rng.uniform(0.1, 0.3)
        size, center = [0.5, 0.5, 0.1], [*(p_WE[:2] + 0.1 * out), height - 0.05]
        target = np.array([*p_WE[:2], height - 1.0]) + np.append(rng.uniform(-0.4, 0.4, 2), 0.0)
    else:
        away = p_WE[:2] + rng.uniform(0.1, 0.25) * out
        angle = float(np.arctan2(out[1], out[0]))
        size, center = [0.06, 0.8, 0.8], [*away, float(p_WE[2])]
        box = {"kind": "box", "center": center, "size": size, "rpy": [0.0, 0.0, angle]}
        return [box], np.append(p_WE[:2] + out, p_WE[2]) + rng.uniform(-0.4, 0.4, 3)
    return [{"kind": "box", "center": center, "size": size}], target


def episode(seed: int, *, meshes: tuple[str, ...] = (), compiled: bool = True) -> Found:
    """Return what an episode comes to."""
    rng = np.random.default_rng(seed)
    name, kind, into = (str(rng.choice(each)) for each in (ARMS, KINDS, INTO))
    arm = arm_of(name)
    period = float(rng.choice(PERIODS))
    most, jerk = BOUNDS[rng.integers(len(BOUNDS))]
    limits = arm.limits.replace(
        velocity=np.minimum(arm.limits.velocity, 1.0), acceleration=most, jerk=jerk
    )
    speed = float(rng.uniform(0.05, 0.3))
    found: Found = {"arm": name, "kind": kind, "into": into, "period": period, "jerk": jerk}
    settings = ShieldSettings(compiled=compiled)
    for _ in range(50):
        q = arm.home + rng.uniform(-0.3, 0.3, arm.n)
        obstacles, target = scene(rng, into, arm, q)
        try:
            shield = Shield(arm, period, settings, start=q, limits=limits, obstacles=obstacles)
        except InvalidInputError:
            continue
        break
    else:
        return found | {"refused": True}
    return found | judged(shield, arm, kind, target, speed, obstacles, meshes)


def judged(
    shield: Shield,
    arm: Arm,
    kind: str,
    target: Array,
    speed: float,
    obstacles: list[Any],
    meshes: tuple[str, ...],
) -> Found:
    """Return how a shield does in an episode."""
    period, limits, kinematics = shield.period, shield.limits, arm.kinematics()
    clearance, _ = arm_clearance(arm, make_obstacles(obstacles), shield.position)
    p_start, R_start = kinematics.p_WE(shield.position), kinematics.R_WE(shield.position)
    way = (target - p_start) / np.linalg.norm(target - p_start)
    end = np.concatenate(
        (p_start + min(1.0, np.linalg.norm(target - p_start)) * way, _wxyz(R_start))
    )
    q, v, told = [shield.position], [np.zeros(arm.n)] * 3, []
    held, left = round(HELD / period), round(LEFT / period)
    places = [p_start]
    for k in range(held + left):
        t, sign = k * period, 1.0 if k < held else -1.0
        V_WE = np.concatenate((np.zeros(3), sign * speed * way))
        if kind == "twist":
            shield.follow_twists(V_WE, t=t)
        elif kind == "velocity":
            J = kinematics.J(q[-1])
            shield.follow_velocities(
                _bounded(J.T @ np.linalg.solve(J @ J.T + 1e-3 * np.eye(3), V_WE[3:])), t=t
            )
        elif k in (0, held):
            pose = end if k == 0 else np.concatenate((p_start, _wxyz(R_start)))
            _follow_pose(shield, kinematics, pose, speed, t)
        q.append(shield.command(t))
        v.append(shield.velocity)
        places.append(kinematics.p_WE(q[-1]))
        if k < held and k % max(round(0.05 / period), 1) == 0:
            status = shield.status
            told.append((t, status.blocked_for, status.limited_by))
    motion, speeds = np.array(q), np.array(v[3:])
    along = np.maximum.accumulate((np.array(places)[: held + 1] - p_start) @ way)
    ended = (
        period * int(np.flatnonzero(along < along[-1] - PROGRESS)[-1] + 1)
        if along[-1] > PROGRESS
        else 0.0
    )
    found: Found = {
        "beyond": _beyond(np.array(v), limits, period),
        "outside": float(limits.violation(motion).max()),
        "uncertified": shield.uncertified,
        "distance": float(clearance.least_along(motion).min()) if clearance.count else 1.0,
        "ended": ended,
        "left": float(np.abs(motion[-1] - motion[held]).max()),
    }
    if ended > HELD - SETTLED - 0.5:
        found["slides"] = True
    else:
        later = speeds[round((ended + SETTLED) / period) : held]
        found["speed"] = float(np.abs(later).max())
        found["told"] = _tells(told, ended, clearance, motion, period)
    if meshes:
        from chunks import Recount, meshes_of

        found["meshes"] = _recount(Recount, meshes_of(arm.name, meshes), obstacles).least(motion)[0]
    return found


def _bounded(v: Array) -> Array:
    """Return velocities that a source may send, in the same direction, shape (n,) [rad/s]."""
    return v * min(1.0, 1.0 / max(float(np.abs(v).max()), 1e-9))


def _follow_pose(shield: Shield, kinematics: Any, pose: Array, speed: float, t: float) -> None:
    """Lead the tool straight to a pose, from where it is."""
    p_WE = kinematics.p_WE(shield.position)
    far = float(np.linalg.norm(pose[:3] - p_WE))
    count = max(int(np.ceil(far / (0.05 * speed))), 1) + 1
    rows = np.tile(pose, (count, 1))
    rows[:, :3] = np.linspace(p_WE, pose[:3], count)
    shield.follow_poses(rows, rate=20.0, start=t, t=t)


def _wxyz(R: Array) -> Array:
    from pydrake.math import RotationMatrix

    quaternion = RotationMatrix(R).ToQuaternion()
    return np.array(quaternion.wxyz())


def _tells(told: list[Any], ended: float, clearance: Any, motion: Array, period: float) -> bool:
    """Return whether the alarm tells the true reason in time."""
    for t, blocked_for, causes in told:
        if ended <= t <= ended + ALARM + 0.051 and blocked_for > 0.0 and causes:
            gaps = clearance.gaps(motion[round(t / period)])
            near = {frozenset(clearance.names[k]) for k in np.flatnonzero(gaps < NEAR)}
            pairs = {frozenset(each.split(" and ")) for each in causes if " and " in each}
            if not pairs or pairs & near:
                return True
    return False


def _beyond(v: Array, limits: Any, period: float) -> float:
    """Return by which share velocities, or their differences, are beyond a limit at most."""
    orders = (limits.velocity, limits.acceleration, limits.jerk)
    return max(
        float((np.abs(np.diff(v, n=k, axis=0)) / period**k / bound).max() - 1.0)
        for k, bound in enumerate(orders)
    )


def _recount(recount: Any, meshes: Any, obstacles: list[Any]) -> Any:
    """Return distances by the makers' meshes among boxes."""
    from pydrake.math import RigidTransform, RollPitchYaw

    from motion_bench_maker import Solid

    solids = [
        Solid(
            "box",
            tuple(each["size"]),
            RigidTransform(RollPitchYaw(each.get("rpy", [0.0, 0.0, 0.0])), each["center"]),
        )
        for each in obstacles
    ]
    return recount(meshes, tuple(solids))


def print_table(rows: list[Found]) -> None:
    """Print how all episodes ended, by what the stick was held into."""
    titles = ("held into", "episodes", "limits broken", "least distance [mm]", "collided")
    titles += ("slide on", "at rest", "told in time", "left")
    head(*titles)
    rows = [each for each in rows if "refused" not in each]
    groups = {into: [r for r in rows if r["into"] == into] for into in INTO} | {"all": rows}
    for into, group in groups.items():
        if not group:
            continue
        rest = [r for r in group if "slides" not in r]
        least = min(min(r["distance"], r.get("meshes", 1.0)) for r in group)
        cells = (
            len(group),
            sum(r["beyond"] > EXACT or r["outside"] > EXACT for r in group),
            f"{1e3 * least:.2f}",
            sum(min(r["distance"], r.get("meshes", 1.0)) <= 0.0 for r in group),
            len(group) - len(rest),
            f"{sum(r['speed'] < REST for r in rest)} of {len(rest)}",
            f"{sum(r['told'] for r in rest)} of {len(rest)}",
            f"{sum(r['left'] >= LEAVES for r in group)} of {len(group)}",
        )
        row(into, *cells)
    fails = Counter(
        (r["arm"], r["kind"], r["into"], r["period"])
        for r in rows
        if r.get("speed", 0.0) >= REST or r["left"] < LEAVES
    )
    for key, count in fails.most_common(20):
        print(*key, count)


def main() -> None:
    """Run the episodes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=100, help="number of episodes")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--numpy", action="store_true", help="make steps by NumPy")
    parser.add_argument("--meshes", action="append", default=[], help="folder of makers' meshes")
    add_case_options(parser)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    seeds = range(options.first, options.first + options.cases)
    task = partial(episode, meshes=tuple(options.meshes), compiled=not options.numpy)
    print_table(cases(task, seeds, options.jobs, options.kept, "held stick"))


if __name__ == "__main__":
    main()
