"""How streams of joint targets are made safe: by the guard, Ruckig, klimits and a low pass.

A stream is what a slow source might send to an arm at 1 kHz: targets 10 to 50 times a second along
a smooth motion, with noise, jumps, gaps, NaN, and an end while it moves. Five balls stand round the
arm. All get the same targets, and the last one that was a number while there is none::

    python benchmarks/streams.py --streams 1000
    python benchmarks/streams.py --streams 1000 --collisions no

``--first`` is the seed of the first stream. With ``--kept FILE`` the figures of each stream are a
line of that file, and those that are there already are not run again.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from klimits import PosVelJerkLimitation, calculate_end_position, calculate_end_velocity
from ruckig import InputParameter, OutputParameter, Ruckig, Synchronization

from avoidance import document, scene
from drake_rnn import Array, Guard, JointLimits, JointStream, load_experiment
from drake_rnn.robot.clearance import Clearance
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

PERIOD, DURATION, ENDS = 1e-3, 2.5, 2.0
VELOCITY, ACCELERATION, JERK = 0.8, 3.0, 60.0
Follower = Callable[[Array | None], Array]


def source(seed: int, home: Array) -> tuple[Array, list[Array | None]]:
    """Return the smooth motion behind a stream, shape (k, n) [rad], and what is sent of it."""
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round(DURATION / PERIOD))[:, None]
    size, rate = rng.uniform(0.02, 0.2, home.size), rng.uniform(0.1, 0.5, home.size)
    phase = rng.uniform(0.0, 2.0 * np.pi, home.size)
    smooth = home + size * (np.sin(2.0 * np.pi * rate * t + phase) - np.sin(phase))
    sent: list[Array | None] = [None] * len(t)
    every, k = round(1.0 / (rng.uniform(10.0, 50.0) * PERIOD)), 0
    while k < round(ENDS / PERIOD):
        target = smooth[k] + 1e-3 * rng.normal(size=home.size)
        kind = rng.random()
        if kind < 0.05:
            target = target + rng.uniform(-0.5, 0.5, home.size)
        elif kind < 0.1:
            target = np.full(home.size, np.nan)
        if kind < 0.85:
            sent[k] = target
        k += every if rng.random() > 0.05 else round(0.3 / PERIOD)
    return smooth, sent


def guard(limits: JointLimits, home: Array, clearance: Clearance | None) -> Follower:
    law = JointStream(limits=limits, home=home, clearance=clearance)
    return Guard(law, PERIOD, compiled=False).command


def ruckig(limits: JointLimits, home: Array, _: Any) -> Follower:
    generator, given, found = Ruckig(home.size, PERIOD), InputParameter(home.size), None
    given.current_position = given.target_position = home.tolist()
    given.max_velocity = limits.velocity.tolist()
    given.max_acceleration, given.max_jerk = [ACCELERATION] * home.size, [JERK] * home.size
    given.synchronization = Synchronization.No
    found = OutputParameter(home.size)

    def follow(target: Array | None) -> Array:
        if target is not None and np.isfinite(target).all():
            # Ruckig knows no position limits.
            inside = np.clip(target, limits.position_lower, limits.position_upper)
            given.target_position = inside.tolist()
        generator.update(given, found)
        found.pass_to_input(given)
        return np.array(found.new_position)

    return follow


def klimits(limits: JointLimits, home: Array, _: Any) -> Follower:
    pairs = np.stack((limits.position_lower, limits.position_upper), axis=1)
    ones = np.ones((home.size, 1)) * [[-1.0, 1.0]]
    room = PosVelJerkLimitation(
        time_step=PERIOD,
        pos_limits=pairs.tolist(),
        vel_limits=(VELOCITY * ones).tolist(),
        acc_limits=(ACCELERATION * ones).tolist(),
        jerk_limits=(JERK * ones).tolist(),
        acceleration_after_max_vel_limit_factor=0.0001,
        normalize_acc_range=False,
        num_threads=1,
    )
    q, v, a, goal = home.copy(), np.zeros_like(home), np.zeros_like(home), home

    def follow(target: Array | None) -> Array:
        nonlocal q, v, a, goal
        if target is not None and np.isfinite(target).all():
            goal = target
        allowed, _ = room.calculate_valid_acceleration_range(q, v, a)
        # The velocity from which one can brake, and the acceleration that leads to it.
        way = goal - q
        gain = 0.5 * JERK / (2.0 * 0.9 * ACCELERATION)
        pace = np.minimum(gain * np.abs(way), np.sqrt(1.8 * ACCELERATION * np.abs(way)))
        lack = np.sign(way) * np.minimum(pace, VELOCITY) - v
        wanted = np.sign(lack) * np.minimum(np.sqrt(JERK * np.abs(lack)), np.abs(lack) / PERIOD)
        after = np.clip(wanted, allowed[:, 0], allowed[:, 1])
        q, v = (
            np.asarray(calculate_end_position(a, after, v, q, PERIOD)),
            np.asarray(calculate_end_velocity(a, after, v, PERIOD)),
        )
        a = after
        return q

    return follow


def low_pass(limits: JointLimits, home: Array, _: Any) -> Follower:
    rate, parts, goal = 2.0 * np.pi * 3.0, [home, home], home

    def follow(target: Array | None) -> Array:
        nonlocal goal
        if target is not None and np.isfinite(target).all():
            goal = target
        for k, before in enumerate((goal, parts[0])):
            parts[k] = parts[k] + (1.0 - np.exp(-rate * PERIOD)) * (before - parts[k])
        return parts[1]

    return follow


FOLLOWERS = {"guard": guard, "Ruckig": ruckig, "klimits": klimits, "low pass of 3 Hz": low_pass}


def run(seed: int, collisions: bool) -> dict[str, Any]:
    """Return what a stream comes to, by who follows it."""
    changes = document("panda", 1.0, None)
    obstacles = scene(seed, changes) if collisions else []
    made = load_experiment("adaptive_nephroid_known", {**changes, "obstacles": obstacles})
    clearance, home = made.clearance, made.start
    assert clearance is not None
    limits = made.limits.replace(velocity=VELOCITY, acceleration=ACCELERATION, jerk=JERK)
    smooth, sent = source(seed, home)
    moving = slice(0, round(ENDS / PERIOD))
    found: dict[str, Any] = {"seed": seed}
    for name, follower in FOLLOWERS.items():
        follow = follower(limits, home, clearance if collisions else None)
        began = time.process_time()
        q = np.array([home, *(follow(target) for target in sent)])
        took = time.process_time() - began
        found[name] = {
            **dict(_excess(q)),
            "position": float(limits.violation(q).max()),
            "distance": float(clearance.least_along(q[::5]).min()) if collisions else np.inf,
            "error": float(np.sqrt(((q[1:] - smooth)[moving] ** 2).mean())),
            "delay": _delay(q[1:][moving], smooth[moving]),
            "us": 1e6 * took / len(sent),
        }
    return found


def _excess(q: Array) -> Iterator[tuple[str, float]]:
    """Yield by how much limits are passed, as shares of them."""
    v = np.diff(np.vstack((q[:1],) * 3 + (q,)), axis=0) / PERIOD
    for order, (name, most) in enumerate(
        (("velocity", VELOCITY), ("acceleration", ACCELERATION), ("jerk", JERK))
    ):
        size = np.abs(np.diff(v, n=order, axis=0)) / PERIOD**order
        yield name, float(size.max() / most - 1.0)


def _delay(q: Array, smooth: Array) -> float:
    """Return the delay with which a motion fits the one behind it best [s]."""
    late = range(0, 600, 10)
    errors = [((q[600:] - smooth[600 - k : len(smooth) - k]) ** 2).mean() for k in late]
    return PERIOD * late[int(np.argmin(errors))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--collisions", choices=("yes", "no"), default="yes")
    add_case_options(parser)
    options = parser.parse_args()
    seen = options.collisions == "yes"
    task = partial(run, collisions=seen)
    among = "among balls" if seen else "nothing in the way"
    seeds = range(options.first, options.first + options.streams)
    _print(cases(task, seeds, options.jobs, options.kept, among), seen)


def _print(streams: list[dict[str, Any]], seen: bool) -> None:
    """Print the table of streams; with ``seen``, of those among obstacles."""
    errors = ("rms error [mrad]", "delay [ms]", "us")
    distance = ("collided", "least distance [mm]")
    head("by", "streams", *distance, "q [rad]", "v", "a", "jerk", *errors)
    for name in FOLLOWERS:
        of = {key: np.array([each[name][key] for each in streams]) for key in streams[0][name]}
        row(
            name,
            len(streams),
            int((of["distance"] < 0.0).sum()) if seen else "-",
            f"{1e3 * of['distance'].min():.2f}" if seen else "-",
            *(f"{of[key].max():.0e}" for key in ("position", "velocity", "acceleration", "jerk")),
            f"{1e3 * np.median(of['error']):.1f}",
            f"{1e3 * np.median(of['delay']):.0f}",
            f"{np.median(of['us']):.0f}",
        )


if __name__ == "__main__":
    main()
