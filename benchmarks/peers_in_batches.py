"""Measure robot-steps a second of many robots: our adaptive law beside mink-warp.

Robots start in postures of their own, the first 0.1 m beside the path of all, the nephroid of the
comparison of single robots. Prints a table of `docs/peers.md`::

    pip install -e '.[jax]' mink-warp 'mujoco<3.10' 'mujoco-warp<3.10'
    python benchmarks/peers_in_batches.py [--counts 1 100 1000] [--samples 300] [--turns 3]

and on a graphics card of NVIDIA, with ``jax[cuda13]`` in place of the extra::

    python benchmarks/peers_in_batches.py --device cuda --counts 1000 4000 16000
    python benchmarks/peers_in_batches.py --device cuda --counts 1000 16000 --obstacles

In a model of a later MuJoCo, mink-warp 0.1 finds no joint that has limits.

Each figure is the least time of several turns, in which all rows are measured one after the other,
without what is compiled or made before the first sample: CPU time, and with a graphics card the
time on the clock.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from math import nan
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from drake_rnn import (
    Array,
    CompiledRuns,
    CompiledStep,
    Experiment,
    InvalidInputError,
    load_experiment,
    run_many,
)
from many import bare_unit, cpu
from markdown_table import head, row
from peer_schemes.tasks import POSITION

EXPERIMENT, AMONG_OBSTACLES = "adaptive_nephroid_known", "adaptive_obstacles"
#: Spread of the starts [rad].
SPREAD = 0.02
#: Duration over which errors are measured, their window [s], and the number of robots.
DURATION, WINDOW, JUDGED = 4.0, 3.0, 3
_ERROR = "position_error_max_m"


def robots(name: str, count: int, duration: float, window: float | None = None) -> list[Experiment]:
    """Return experiments that differ in their starts; the first has that of the shipped one."""
    about = {"accept": None, "duration": duration}
    about["window"] = None if window is None else [window, duration]
    base, rng = load_experiment(name, about), np.random.default_rng(0)
    starts = base.start + rng.normal(0.0, SPREAD, (count - 1, base.start.size))
    return [base, *(replace(base, start=q) for q in starts)]


def desired(experiments: Sequence[Experiment]) -> Array:
    """Return desired positions, shape (samples + 2, robots, 3) [m]."""
    first = experiments[0]
    samples, period = _samples(first), first.document.period
    way = np.array([first.desired.position(k * period)[0] for k in range(samples + 2)])
    return np.repeat(way[:, None], len(experiments), axis=1)


def _samples(experiment: Experiment) -> int:
    return round(experiment.document.duration / experiment.document.period)


class Side(NamedTuple):
    """A way to move many robots.

    Attributes:
        name, setting: What is measured.
        prepare: Returns, of experiments, what runs them, from their starts.
        errors: Returns the largest position error of experiments in their window [m].
    """

    name: str
    setting: str
    prepare: Callable[[list[Experiment]], Callable[[], object]]
    errors: Callable[[list[Experiment]], float]


def in_numpy() -> Side:
    """Our law, by `run_many`."""

    def errors(experiments: list[Experiment]) -> float:
        return float(run_many(experiments).metrics[_ERROR].max())

    return Side(
        "ours: adaptive, J known", "`run_many`, all metrics taken",
        lambda experiments: lambda: run_many(experiments), errors,
    )  # fmt: skip


def in_jax() -> Side:
    """Our law, by `CompiledRuns`."""

    def prepare(experiments: list[Experiment]) -> Callable[[], object]:
        runs = CompiledRuns(experiments, [_ERROR])
        runs.run()
        return runs.run

    def errors(experiments: list[Experiment]) -> float:
        return float(CompiledRuns(experiments, [_ERROR]).run()[_ERROR].max())

    return Side(
        "ours: adaptive, J known, JAX", "`CompiledRuns`, position error taken", prepare, errors
    )


def in_c() -> Side:
    """Our law, by a `CompiledStep` for all robots, called for each from Python."""

    def run(step: CompiledStep, starts: Array, visit: Callable[[int, Any], None]) -> None:
        moving, q = [step.start() for _ in starts], list(starts)
        period = step.period
        for k in range(step.samples):
            for number, robot in enumerate(moving):
                q[number] = q[number] + period * robot.step(q[number])
            visit(k + 1, q)

    def prepare(experiments: list[Experiment]) -> Callable[[], object]:
        step = CompiledStep(experiments[0], backend="c")
        starts = np.array([each.start for each in experiments])
        return lambda: run(step, starts, lambda k, q: None)

    def errors(experiments: list[Experiment]) -> float:
        step = CompiledStep(experiments[0], backend="c")
        judge = Judge(experiments, [0] * len(experiments))
        run(step, np.array([each.start for each in experiments]), judge.visit)
        return judge.most

    return Side(
        "ours: adaptive, J known, in C", "`CompiledStep`, a loop in Python", prepare, errors
    )


def of_mink_warp(module: Any, name: str, setting: str, **settings: Any) -> Side:
    """A solver of mink-warp."""

    def made(experiments: list[Experiment]) -> Any:
        return module.MinkWarp(experiments, desired(experiments), POSITION, **settings)

    def prepare(experiments: list[Experiment]) -> Callable[[], object]:
        batch = made(experiments)
        starts = batch.q.copy()

        def run() -> None:
            batch.restart(starts)
            for _ in range(_samples(experiments[0])):
                batch.step()
            batch.finish()

        return run

    def errors(experiments: list[Experiment]) -> float:
        batch, judge = made(experiments), Judge(experiments, range(len(experiments)))
        for k in range(_samples(experiments[0])):
            batch.step()
            judge.visit(k + 1, batch.q)
        return judge.most

    return Side(name, setting, prepare, errors)


class Judge:
    """The largest position error in the window, by Drake's kinematics.

    Args:
        experiments: What robots do.
        paths: Numbers of the experiments whose paths they follow.

    Attributes:
        most: The largest error so far [m].
    """

    def __init__(self, experiments: Sequence[Experiment], paths: Sequence[int]) -> None:
        self._kinematics = experiments[0].arm.kinematics()
        self._p_WE = desired(experiments)[:, list(paths)]
        self._first = round(WINDOW / experiments[0].document.period)
        self.most = 0.0

    def visit(self, k: int, q: Sequence[Array]) -> None:
        """Look at the postures at sample ``k``."""
        if k < self._first:
            return
        for posture, p_WE in zip(q, self._p_WE[k], strict=True):
            error = self._kinematics.p_WE(np.asarray(posture, float)) - p_WE
            self.most = max(self.most, float(np.linalg.norm(error)))


def sides(device: str, *, obstacles: bool) -> list[Side]:
    """Return what is compared here; without mink-warp only ours."""
    ours = [in_jax(), in_c()] if device == "cuda" else [in_numpy(), in_jax(), in_c()]
    if obstacles:
        return ours
    try:
        module = import_module("peer_schemes.mink_warp_batch")
    except ModuleNotFoundError as error:
        print(f"mink-warp is left out, not installed: {error.name}\n")
        return ours
    about = "single precision" + ", a CUDA graph" * (device == "cuda")
    return [
        of_mink_warp(
            module,
            "mink-warp",
            f"IKSolver, no bounds, {about}",
            bounded=False,
            device=device,
        ),
        of_mink_warp(
            module,
            "mink-warp, own limit",
            f"ConstrainedSolver, bounds of position and velocity, and one of the user's own for the"
            f" acceleration, {about}",
            device=device,
        ),
        *ours,
    ]


def on_clock(run: Callable[[], object]) -> float:
    """Return the time on the clock that a call takes [s]."""
    begin = perf_counter()
    run()
    return perf_counter() - begin


def measure(
    side: Side,
    experiments: list[Experiment],
    turns: int,
    timed: Callable[[Callable[[], object]], float],
) -> float:
    """Return the least time of a robot-step [us]."""
    run = side.prepare(experiments)
    run()
    samples = _samples(experiments[0]) * len(experiments)
    return min(timed(run) for _ in range(turns)) / samples * 1e6


def error_of(side: Side, name: str) -> float:
    """Return the largest position error of a side; NaN if it does not run."""
    try:
        return side.errors(robots(name, JUDGED, DURATION, WINDOW))
    except InvalidInputError:
        return nan


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 100, 1000])
    parser.add_argument("--samples", type=int, default=300)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--obstacles", action="store_true", help="ours among five obstacles")
    options = parser.parse_args()
    name = AMONG_OBSTACLES if options.obstacles else EXPERIMENT
    compared = sides(options.device, obstacles=options.obstacles)
    timed = on_clock if options.device == "cuda" else cpu
    named = (f"{n} robot{'s' * (n > 1)}: steps a second" for n in options.counts)
    head("scheme", "setting", *named, "error max [um]")
    for side in compared:
        times = [
            measure(side, robots(name, n, options.samples * 1e-3), options.turns, timed)
            for n in options.counts
        ]
        rates = (f"{round(1e6 / each, -2):.0f}" for each in times)
        row(side.name, side.setting, *rates, f"{1e6 * error_of(side, name):.2g}")
    print(f"\nu is {min(bare_unit(robots(EXPERIMENT, 1, 0.1)[0]) for _ in range(5)):.1f} us here.")


if __name__ == "__main__":
    main()
