"""Measure what a call of a guard costs, and how even the commands of one in its own process are.

For a Panda, that keeps clear of nothing or of itself and a ball. The cost is that of a whole call,
with the time of the call and new targets at 50 Hz, and of the step alone; u is p_WE and J in
pydrake, in turn with it, and the least of each counts::

    python benchmarks/guard_times.py

Commands of a guard at 1 kHz with the jerk bounded, in a process of its own, compiled, while nothing
else is done, or while a process beside it is busy all the time::

    python benchmarks/guard_times.py --process 20

The same of a shield, which follows chunks of 16 postures or poses, 10 a second, on ways that lead
its arm past the balls and about itself::

    python benchmarks/guard_times.py --shield 20 --balls 1
    python benchmarks/guard_times.py --shield 60 --balls 1 6 23 --targets positions --busy

The time from the call to the command is that of a function which the process calls, as of a robot
that holds the last command; that from when a command is due is what `process=True` does, whose
commands go on along stops: it has the time in which the process wakes up besides.

Rates that a shield reaches in a loop of one's own, with steps by NumPy and in C, and what it costs
more than a guard::

    python benchmarks/guard_times.py --rates
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import product
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory

import numpy as np
from pydrake.math import RotationMatrix

from drake_rnn import (
    Arm,
    Array,
    Guard,
    GuardCommand,
    JointStream,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    load_experiment,
    make_obstacles,
)
from drake_rnn.compiled.library import built_step
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.laws.guard import LATE, Late, StepInPlace
from drake_rnn.shield.shield import law_of as shield_law
from many import bare_unit
from markdown_table import head, row

PERIOD, CALLS, CHUNK, TURNS = 1e-3, 2000, 50, 20
PERCENT = (50.0, 99.0, 99.9, 100.0)
_ROW = Struct("=ddd")


def law_of(jerk: float | None, *, clear: bool = False) -> JointStream:
    """Return a law of a Panda; one that is to keep clear of itself and a ball, if asked for."""
    arm = load_arm("panda")
    limits = arm.limits.replace(velocity=0.8, acceleration=3.0, jerk=jerk)
    home, clearance = np.asarray(arm.home), None
    if clear:
        ball = {"kind": "ball", "center": [0.307, -0.24, 0.59], "radius": 0.04}
        clearance, _ = arm_clearance(arm, make_obstacles([ball]), home)
    return JointStream(limits=limits, home=home, clearance=clearance)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--process", type=float, metavar="SECONDS")
    parser.add_argument("--shield", type=float, metavar="SECONDS")
    parser.add_argument("--balls", type=int, nargs="+", default=[1])
    parser.add_argument("--targets", nargs="+", choices=ROWS_OF, default=list(ROWS_OF))
    parser.add_argument("--busy", action="store_true", help="beside a busy process alone")
    parser.add_argument("--rates", action="store_true")
    options = parser.parse_args()
    if options.process is not None:
        measure_process(options.process)
        return
    if options.shield is not None:
        beside = (BUSY,) if options.busy else ("-", BUSY)
        measure_shield(options.shield, options.balls, options.targets, beside)
        return
    if options.rates:
        measure_rates()
        return
    head("bounded", "pairs", "steps by", "us a call of `command`", "u", "of these the step", "u")
    for bounded, jerk in (("acceleration", None), ("jerk", 60.0)):
        for clear, compiled in ((False, False), (False, True), (True, True)):
            law = law_of(jerk, clear=clear)
            call, step, unit = costs(law, compiled)
            units = f"{call / unit:.2f}", f"{step:.2f}", f"{step / unit:.2f}"
            pairs = 0 if law.clearance is None else law.clearance.count
            row(bounded, pairs, "C" if compiled else "NumPy", f"{call:.2f}", *units)


def costs(law: JointStream, compiled: bool) -> tuple[float, float, float]:
    """Return the time of a call, of the step in it, and the unit [us]."""
    rng = np.random.default_rng(0)
    targets = [law.home + rng.uniform(-1.0, 1.0, 7) if k % 20 == 0 else None for k in range(CALLS)]
    experiment = load_experiment("slc_nephroid_known")
    calls, steps, units = [], [], []
    for _ in range(TURNS if compiled else 3):
        units.append(bare_unit(experiment))
        calls.append(_call(Guard(law, PERIOD, t=0.0, compiled=compiled), targets))
        steps.append(_step(law, compiled, targets))
    # Of each part of the motion the least.
    least = (float(np.min(each, axis=0).mean()) for each in (calls, steps))
    return *least, min(units)


def _call(guard: Guard, targets: list[Array | None]) -> list[float]:
    """Return the time of a call in each part of the motion [us]."""
    t, times = 0.0, []
    for begin in range(0, len(targets), CHUNK):
        part = targets[begin : begin + CHUNK]
        before = time.perf_counter()
        for target in part:
            t += 1.01e-3
            guard.command(target, None, t)
        times.append((time.perf_counter() - before) / CHUNK * 1e6)
    return times


def _step(law: JointStream, compiled: bool, targets: list[Array | None]) -> list[float]:
    """Return the time of a step at the end of each part [us]."""
    reading, guard, times = law.sampled(PERIOD), Guard(law, PERIOD, compiled=compiled), []
    built = built_step(reading, PERIOD) if compiled else None
    plain = StepInPlace.by(without_checks(reading.step), reading, PERIOD)
    step = plain if built is None else built.in_place()
    for begin in range(0, len(targets), CHUNK):
        for target in targets[begin : begin + CHUNK]:
            guard.command(target)
        step.x[:], step.u["target"][:] = guard.state, np.nan
        before = time.perf_counter()
        for _ in range(5):
            step.make()
        times.append((time.perf_counter() - before) / 5 * 1e6)
    return times


# Numbers of balls of `measure_rates`; None for an arm that is kept clear of nothing.
SCENES = (None, 1, 6, 16, 23)
# Rates of commands in use [Hz].
RATES = (1000, 500, 250, 200, 100, 50, 20)


def measure_rates() -> None:
    """Print a table of what a call of a shield takes, and of the rate that it reaches by that."""
    columns = (
        "pairs",
        "steps by",
        "median [us]",
        "u",
        "99.9 % [ms]",
        "rate [Hz]",
        "more than a guard [u]",
    )
    head(*columns)
    unit = min(bare_unit(load_experiment("slc_nephroid_known")) for _ in range(TURNS))
    for balls in SCENES:
        for compiled in (False, True):
            pairs, shield, guard = _times_of_both(balls, compiled=compiled)
            median, slow = np.percentile(shield, (50.0, 99.9))
            rate = next((str(f) for f in RATES if slow * 1e-6 * f < 1.0), f"below {RATES[-1]}")
            more = np.median(shield - guard) / unit
            cells = f"{median:.0f}", f"{median / unit:.1f}", f"{1e-3 * slow:.2f}", rate
            row(pairs, "C" if compiled else "NumPy", *cells, f"{more:.1f}")


def _times_of_both(balls: int | None, *, compiled: bool) -> tuple[int, Array, Array]:
    """Return how many pairs there are, and times of calls of a shield and of its guard [us].

    They take turns at being first: what comes second finds the machine as the same step left it.
    """
    arm = load_arm("panda")
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
    settings, period = ShieldSettings(compiled=compiled), PERIOD if compiled else 5.0 * PERIOD
    world = {"obstacles": balls_round(balls or 0), "collisions": balls is not None}
    first, shield = (Shield(arm, period, settings, limits=limits, **world) for _ in range(2))
    law = shield_law(arm, limits, np.asarray(arm.home), shield.lookahead, shield.clearance)
    guard = Guard(law, period, compiled=compiled)
    times: dict[object, list[float]] = {shield: [], guard: []}
    for k in range(CALLS * (10 if compiled else 1)):
        t = period * k
        if k % 100 == 0:
            rows = _postures(arm, t + np.arange(16) / 20.0)
            for each in (first, shield):
                each.follow_positions(rows, rate=20.0, start=t, t=t)
        first.command(t)
        target = first.leading
        calls = [
            (shield, partial(shield.command, t)),
            (guard, partial(guard.command, target, None, t)),
        ]
        for owner, call in calls if k % 2 else reversed(calls):
            before = time.perf_counter()
            call()
            times[owner].append(time.perf_counter() - before)
    pairs = 0 if shield.clearance is None else shield.clearance.count
    return pairs, 1e6 * np.array(times[shield]), 1e6 * np.array(times[guard])


def balls_round(count: int) -> list[dict[str, object]]:
    """Return balls on a circle before the arm."""
    angles = 2.0 * np.pi * np.arange(count) / max(count, 1)
    around = [[0.55, 0.35 * float(np.cos(a)), 0.45 + 0.3 * float(np.sin(a))] for a in angles]
    return [{"kind": "ball", "center": center, "radius": 0.06} for center in around]


def note(file: Path, command: GuardCommand) -> None:
    """Write when a command was asked for and made, and how old its target is, into a file."""
    if not _OPEN:
        _OPEN.append(os.open(file, os.O_CREAT | os.O_WRONLY))
    os.write(_OPEN[0], _ROW.pack(command.time, time.monotonic(), command.target_age))


_OPEN: list[int] = []


def measure_process(seconds: float) -> None:
    """Print a table of the commands of a guard in its own process."""
    columns = [f"{percent:g} %" for percent in PERCENT]
    head("beside it", "time", *columns, "late stops")
    for name in ("-", BUSY):
        with busy(name == BUSY), TemporaryDirectory() as folder:
            _print_rows(seconds, Path(folder, "commands"), name)


BUSY = "a busy process"


@contextmanager
def busy(is_so: bool) -> Iterator[None]:
    """Have a process beside this busy all the time, or none."""
    beside = subprocess.Popen([sys.executable, "-c", "while True: pass"]) if is_so else None
    try:
        yield
    finally:
        if beside is not None:
            beside.kill()
            beside.wait()


def _print_rows(seconds: float, file: Path, beside: str) -> None:
    law, given = law_of(60.0), []
    rng = np.random.default_rng(0)
    process = partial(note, file)
    with Guard(law, PERIOD, tolerance=PERIOD, compiled=True, process=process) as guard:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            given.append(time.monotonic())
            guard.target(law.home + rng.uniform(-0.5, 0.5, 7))
            time.sleep(rng.uniform(0.005, 0.02))
        stops = guard.late_stops
    made, told, ages = _noted(file, given[-1])
    seen = made[ages == 0.0]
    after = seen[np.minimum(np.searchsorted(seen, given), len(seen) - 1)] - given
    rows = {
        "between two commands": np.diff(told),
        "from the call to the command": told - made,
        "from a target to the call that follows it": after[:-1],
    }
    for name, times in rows.items():
        row(beside, name, *_cells(times), stops)


def _noted(file: Path, until: float) -> Array:
    """Return what `note` has written, until a time: of each column a row."""
    made, told, ages = np.fromfile(file).reshape(-1, 3).T
    return np.stack([each[made <= until] for each in (made, told, ages)])


def _cells(times: Array) -> list[str]:
    return [f"{1e3 * value:.3f} ms" for value in np.percentile(times, PERCENT)]


def measure_shield(
    seconds: float, balls: Sequence[int], targets: Sequence[str], beside: Sequence[str]
) -> None:
    """Print a table of the commands of a shield in its own process.

    Args:
        seconds: How long each case takes [s].
        balls: Numbers of balls.
        targets: Kinds of targets.
        beside: What else there is.
    """
    columns = [f"{percent:g} %" for percent in PERCENT]
    counts = "late stops", "samples of stops", "withdrawn"
    head("beside it", "targets", "pairs", "time", *columns, "above 0.3 ms", *counts)
    for kind, count, name, late in product(targets, balls, beside, LATE):
        with busy(name == BUSY), TemporaryDirectory() as folder:
            _print_shield(seconds, (kind, count, late), Path(folder, "commands"), name)


def _print_shield(seconds: float, what: tuple[str, int, Late], file: Path, beside: str) -> None:
    kind, balls, late = what
    arm = load_arm("panda")
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
    settings = ShieldSettings(compiled=True, late=late)
    options = {"limits": limits, "obstacles": balls_round(balls), "process": partial(note, file)}
    with Shield(arm, PERIOD, settings, **options) as shield:
        begin = time.monotonic()
        while (now := time.monotonic()) < begin + seconds:
            times = now - begin + np.arange(16) / 20.0
            shield.follow(kind, ROWS_OF[kind](arm, times), rate=20.0, start=now)
            time.sleep(0.1)
        stops, pairs = (shield.late_stops, shield.late_samples), len(shield.clearance.names)
        stops += (shield.withdrawn,)
        refused = shield.counts.refused
    assert not refused
    made, told, _ = _noted(file, now)
    # Where the arm goes on along stops, a command is due a period before it begins to hold.
    answers = told - made + PERIOD * (late == "stop")
    share = f"{100.0 * np.mean(answers > 3e-4):.3f} %"
    begin = "when it is due" if late == "stop" else "the call"
    rows = {"between two commands": np.diff(told), f"from {begin} to the command": answers}
    for name, values in rows.items():
        row(beside, kind, pairs, name, *_cells(values), share, *stops)


def _postures(arm: Arm, times: Array) -> Array:
    ways = np.array([1.0, 0.6, 0.3, 0.4, 0.3, 0.4, 0.6])
    return np.asarray(arm.home + 0.6 * np.sin(1.2 * times)[:, None] * ways)


def _poses(arm: Arm, times: Array) -> Array:
    kinematics = arm.kinematics()
    p_WE, R_WE = kinematics.p_WE(arm.home), kinematics.R_WE(arm.home)
    wxyz = RotationMatrix(R_WE).ToQuaternion().wxyz()
    rows = np.tile(np.concatenate((p_WE, wxyz)), (len(times), 1))
    rows[:, 1] += 0.25 * np.sin(1.2 * times)
    rows[:, 2] += 0.1 * np.sin(2.4 * times)
    return rows


ROWS_OF = {"positions": _postures, "poses": _poses}


if __name__ == "__main__":
    main()
