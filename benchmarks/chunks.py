"""How chunks of a policy are made safe: by the shield, Ruckig, klimits, a low pass and a clamp.

A policy sends chunks of 8 to 50 targets at 10 to 50 Hz, 0 to 0.8 s after it saw the arm, along a
smooth motion that each chunk mistakes by up to 0.3 rad; with noise, NaN, gaps, and chunks that
overtake each other. Half of the streams are joint positions, half poses of the tool. A third have
nothing near, a third five balls round the arm, a third balls and a floor. Arms change from stream
to stream::

    python benchmarks/chunks.py --streams 1000

The shield pursues the way through the chunks. The others, which take no chunks, get at each sample
where the newest chunk is at that time, which is the best that can be given to them; they have no
part in streams of poses. ``--kept FILE`` keeps the figures of each stream.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RotationMatrix

from drake_rnn import (
    Array,
    InvalidInputError,
    JointLimits,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options
from streams import ACCELERATION, JERK, PERIOD, VELOCITY, klimits, low_pass, ruckig

DURATION, ENDS = 4.0, 3.0
ARMS = ("panda", "iiwa14", "ur5", "gen3", "fr3")


class Message(NamedTuple):
    """A chunk on its way.

    Attributes:
        arrives: Time at which it comes [s].
        start: Time of its first target [s].
        rate: Targets a second.
        values: The targets, shape (k, width).
    """

    arrives: float
    start: float
    rate: float
    values: Array


def motion(rng: np.random.Generator, home: Array) -> Any:
    """Return a smooth motion as a function of times, shape (k,)."""
    size, rate = rng.uniform(0.02, 0.25, home.size), rng.uniform(0.1, 0.4, home.size)
    phase = rng.uniform(0.0, 2.0 * np.pi, home.size)

    def at(t: Array) -> Array:
        turn = 2.0 * np.pi * rate * np.asarray(t)[..., None] + phase
        return np.asarray(home + size * (np.sin(turn) - np.sin(phase)))

    return at


def messages(rng: np.random.Generator, smooth: Any, pose_of: Any) -> list[Message]:
    """Return the chunks of a stream, in the order in which they come."""
    rows, rate = int(rng.integers(8, 51)), rng.uniform(10.0, 50.0)
    delay, wrong = rng.uniform(0.0, 0.8), rng.choice([0.0, 0.05, 0.3])
    every = rng.uniform(0.3, 0.8) * rows / rate
    sent, t = list[Message](), 0.0
    while t < ENDS:
        times = t + np.arange(rows) / rate
        q = smooth(times) + rng.uniform(-wrong, wrong, smooth(times).shape[1])
        q = q + 1e-3 * rng.normal(size=q.shape)
        values = q if pose_of is None else np.array([pose_of(each) for each in q])
        if rng.random() < 0.2:
            values[rng.integers(rows), rng.integers(values.shape[1])] = np.nan
        if rng.random() > 0.05:
            late = 0.5 * rng.random() if rng.random() < 0.1 else 0.0
            sent.append(Message(t + delay + late, t, rate, values))
        t += every
    return sorted(sent, key=lambda each: each.arrives)


def clamp(limits: JointLimits, home: Array, _: Any) -> Any:
    """Return what caps each change of the position, as LeRobot's robots can."""
    q = home

    def follow(target: Array | None) -> Array:
        nonlocal q
        if target is not None and np.isfinite(target).all():
            most = VELOCITY * PERIOD
            inside = np.clip(target, limits.position_lower, limits.position_upper)
            q = q + np.clip(inside - q, -most, most)
        return q

    return follow


OTHERS = {"Ruckig": ruckig, "klimits": klimits, "low pass of 3 Hz": low_pass, "clamp": clamp}


def obstacles(seed: int, arm: Any) -> list[dict[str, Any]]:
    """Return what stands round an arm, free where it is at home; in a third of streams nothing."""
    kind, rng = seed % 3, np.random.default_rng((seed, 1))
    if kind == 0:
        return []
    things = []
    for _ in range(12):
        way = rng.normal(size=3)
        center = arm.kinematics().p_WE(arm.home) + way / np.linalg.norm(way) * rng.uniform(0.1, 0.4)
        things.append({"kind": "ball", "center": center.tolist(), "radius": 0.04})
    clearance, _ = arm_clearance(arm, make_obstacles(things), arm.home)
    gaps, names = clearance.gaps(arm.home), [other for _, other in clearance.names]
    near = {name for name, gap in zip(names, gaps, strict=True) if gap < 0.02}
    balls = [ball for k, ball in enumerate(things) if f"ball {k + 1}" not in near][:5]
    floor = {"kind": "half_space", "normal": [0.0, 0.0, 1.0], "point": [0.0, 0.0, -0.3]}
    return [*balls, floor] if kind == 2 else balls


def _others(sent: list[Message], width: int) -> list[Array | None]:
    """Return where the newest chunk is at each sample, for those that take no chunks."""
    targets, newest, k = list[Array | None](), None, 0
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        while k < len(sent) and sent[k].arrives <= t:
            if newest is None or sent[k].start >= newest.start:
                newest = sent[k]
            k += 1
        if newest is None:
            targets.append(None)
            continue
        whole = np.isfinite(newest.values).all(axis=1)
        times = (newest.start + np.arange(len(whole)) / newest.rate)[whole]
        column = (np.interp(t, times, newest.values[whole, i]) for i in range(width))
        targets.append(np.array(list(column)))
    return targets


def run(seed: int) -> dict[str, Any]:
    """Return what a stream comes to, by who follows it; why, if a start is refused."""
    rng, arm = np.random.default_rng(seed), load_arm(ARMS[seed % len(ARMS)])
    kinematics = arm.kinematics()
    limits = arm.limits.replace(
        velocity=np.minimum(arm.limits.velocity, VELOCITY), acceleration=ACCELERATION, jerk=JERK
    )
    smooth, by_poses = motion(rng, arm.home), seed // 2 % 2 == 1

    def pose_of(q: Array) -> Array:
        R = RotationMatrix(kinematics.R_WE(q))
        return np.concatenate((kinematics.p_WE(q), R.ToQuaternion().wxyz()))

    sent = messages(rng, smooth, pose_of if by_poses else None)
    figures = partial(_figures, limits=limits, smooth=smooth, arm=arm, by_poses=by_poses)
    found: dict[str, Any] = {"seed": seed, "poses": by_poses, "kind": seed % 3}
    for name, on_path in (("shield", False), ("shield, on its path", True)):
        settings, things = ShieldSettings(on_path=on_path), obstacles(seed, arm)
        try:
            shield = Shield(arm, PERIOD, settings, limits=limits, obstacles=things)
        except InvalidInputError as error:
            return {**found, "refused": str(error)}
        began = time.process_time()
        q, refused = _shielded(shield, sent, by_poses)
        took = time.process_time() - began
        found[name] = figures(q, shield.clearance, took)
        found[name] |= {"refused": refused, "uncertified": shield.uncertified}
    targets = [] if by_poses else _others(sent, arm.n)
    for name, follower in OTHERS.items() if targets else ():
        other, began = follower(limits, arm.home, None), time.process_time()
        q = np.array([arm.home, *(other(target) for target in targets)])
        found[name] = figures(q, shield.clearance, time.process_time() - began)
    return found


def _shielded(shield: Shield, sent: list[Message], by_poses: bool) -> tuple[Array, int]:
    """Return what a shield commands, shape (k, n) [rad], and how many chunks it refused."""
    q, k, refused = [shield.position], 0, 0
    follow = shield.follow_poses if by_poses else shield.follow_positions
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        while k < len(sent) and sent[k].arrives <= t:
            try:
                follow(sent[k].values, sent[k].rate, sent[k].start, t)
            except InvalidInputError:
                refused += 1
            k += 1
        q.append(shield.command(t))
    return np.array(q), refused


def _figures(
    q: Array,
    clearance: Any,
    took: float,
    *,
    limits: JointLimits,
    smooth: Any,
    arm: Any,
    by_poses: bool,
) -> dict[str, float]:
    """Return how a motion keeps limits and distances, and how it follows."""
    kinematics = arm.kinematics()
    v = np.diff(np.vstack((q[:1],) * 3 + (q,)), axis=0) / PERIOD
    orders = (limits.velocity, limits.acceleration, limits.jerk)
    names = ("velocity", "acceleration", "jerk")
    passed = {
        name: float((np.abs(np.diff(v, n=k, axis=0)) / PERIOD**k / bound).max() - 1.0)
        for k, (name, bound) in enumerate(zip(names, orders, strict=True))
    }
    t = PERIOD * np.arange(len(q))
    some = slice(round(1.0 / PERIOD), round(ENDS / PERIOD))
    late = range(0, 200, 2)
    true, real = smooth(t), q
    if by_poses:
        true, real = (np.array([kinematics.p_WE(each) for each in x[::5]]) for x in (true, q))
        some, late = slice(round(0.2 / PERIOD), round(0.2 * ENDS / PERIOD)), range(0, 40)
    errors = [
        ((real[some] - true[some.start - k : some.stop - k]) ** 2).sum(axis=1).mean() for k in late
    ]
    return {
        **passed,
        "position": float(limits.violation(q).max()),
        "distance": float(clearance.least_along(q).min()),
        "error": float(np.sqrt(errors[0])),
        "delay": PERIOD * (5 if by_poses else 1) * late[int(np.argmin(errors))],
        "us": 1e6 * took / len(q),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    add_case_options(parser)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.streams)
    streams = cases(partial(run), seeds, options.jobs, options.kept, "chunks")
    refused = [each for each in streams if "refused" in each]
    print(f"{len(refused)} of {len(streams)} starts were not free, and were left out")
    streams = [each for each in streams if "refused" not in each]
    for by_poses, unit in ((False, "mrad"), (True, "mm")):
        _print([each for each in streams if each["poses"] == by_poses], unit)


def _print(streams: list[dict[str, Any]], unit: str) -> None:
    """Print the table of streams of one kind."""
    if not streams:
        return
    print()
    errors = (f"rms error [{unit}]", "delay [ms]", "us")
    head("by", "streams", "collided", "least distance [mm]", "q [rad]", "v", "a", "jerk", *errors)
    for name in ("shield", "shield, on its path", *OTHERS):
        if name not in streams[0]:
            continue
        of = {key: np.array([each[name][key] for each in streams]) for key in streams[0][name]}
        limits = ("position", "velocity", "acceleration", "jerk")
        row(
            name,
            len(streams),
            int((of["distance"] < 0.0).sum()),
            f"{1e3 * of['distance'].min():.2f}",
            *(f"{of[key].max():.0e}" for key in limits),
            f"{1e3 * np.median(of['error']):.1f}",
            f"{1e3 * np.median(of['delay']):.0f}",
            f"{np.median(of['us']):.0f}",
        )


if __name__ == "__main__":
    main()
