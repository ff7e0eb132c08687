"""Measure what a robot is sent by a shield's process that is stopped at random.

The process commands a Panda at 1 kHz, in C, on ways past the balls and about itself. It is stopped
by SIGSTOP for 5, 50 or 500 ms, again and again. A robot's driver reads its commands, a period
apart; limits are judged by differences of these positions alone, distances by the clearance's
capsules::

    python benchmarks/stopped_process.py 60 --busy 6
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np

from drake_rnn import Array, CommandReader, Shield, ShieldSettings, load_arm
from drake_rnn.drive.shared_cycles import SIMULATED, raise_priority
from markdown_table import head, row

PERIOD = 1e-3
#: How long it is stopped [s], and how often.
LENGTHS, SHARES = (5e-3, 5e-2, 0.5), (0.5, 0.4, 0.1)
V, A, J = 1.0, 5.0, 100.0
BALLS = [[0.55, 0.35 * np.cos(a), 0.45 + 0.3 * np.sin(a)] for a in (0.0, np.pi)]


def stop_at_random(process: int, until: threading.Event, count: list[int]) -> None:
    """Stop a process again and again, until an event."""
    rng = np.random.default_rng(0)
    while not until.wait(rng.uniform(0.05, 0.4)):
        os.kill(process, signal.SIGSTOP)
        time.sleep(rng.choice(LENGTHS, p=SHARES))
        os.kill(process, signal.SIGCONT)
        count[0] += 1


def sent(shield: Shield, seconds: float) -> Array:
    """Return the positions that a robot is sent, shape (k, n) [rad]."""
    home = np.asarray(shield.arm.home)
    ways = np.array([1.0, 0.6, 0.3, 0.4, 0.3, 0.4, 0.6])
    reader, begin, rows, due = CommandReader(shield.path), time.monotonic(), [], 0.0
    while (t := begin + len(rows) * PERIOD) < begin + seconds:
        while (now := time.monotonic()) < t:
            time.sleep(t - now)
        if now >= due:
            times = now - begin + np.arange(16) / 20.0
            chunk = home + 0.6 * np.sin(1.2 * times)[:, None] * ways
            shield.follow_positions(chunk, rate=20.0, start=now)
            due = now + 0.1
        rows.append(reader.position_at(t))
    return np.array(rows)


def measure(seconds: float, busy: int, stopped: bool) -> None:
    """Print a row."""
    arm = load_arm("panda")
    limits = arm.limits.replace(velocity=V, acceleration=A, jerk=J)
    obstacles = [{"kind": "ball", "center": list(map(float, c)), "radius": 0.06} for c in BALLS]
    options = {"limits": limits, "obstacles": obstacles, "process": True}
    line, others = [sys.executable, "-c", "while True: pass"], []
    with Shield(arm, PERIOD, ShieldSettings(compiled=True), **options) as shield:
        (child,) = multiprocessing.active_children()
        until, count = threading.Event(), [0]
        thread = threading.Thread(target=stop_at_random, args=(child.pid, until, count))
        others = [subprocess.Popen(line) for _ in range(busy)]
        try:
            if stopped:
                thread.start()
            # A robot's driver comes before other programs.
            with raise_priority(SIMULATED):
                q = sent(shield, seconds)
        finally:
            until.set()
            for other in others:
                other.kill()
                other.wait()
            if stopped:
                thread.join()
        late, stops, refused = shield.late_stops, shield.late_samples, shield.counts.refused
        gaps = min(float(shield.clearance.gaps(each).min()) for each in q[::5])
    assert not refused
    v, a, j = (np.abs(np.diff(q, n=n, axis=0)).max() / PERIOD**n for n in (1, 2, 3))
    beyond = (f"{max(x / most - 1.0, 0.0):.0e}" for x, most in ((v, V), (a, A), (j, J)))
    row(busy, count[0], len(q), stops, late, *beyond, f"{1e3 * gaps:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("--busy", type=int, nargs="+", default=[0, 6])
    options = parser.parse_args()
    columns = ("busy programs", "times stopped", "positions", "samples of stops", "late stops")
    head(*columns, "beyond v", "a", "jerk", "least distance [mm]")
    for busy in options.busy:
        for stopped in (False, True):
            measure(options.seconds, busy, stopped)


if __name__ == "__main__":
    main()
