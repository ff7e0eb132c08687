"""Measure the cost of runs compiled by JAX, in units of the arm's bare p_WE and J in pydrake.

One robot, whole run under scan; many robots; and one step called from a loop in Python, with the
waiting for threads that JAX has by default, or without (``--no-threads``). Robots have starts and
gains of their own; the position error is taken on the way. CPU time without compilation::

    python benchmarks/compiled.py [NAME ...] [--duration SECONDS] [--counts 1 1000] [--no-threads]

Steps in C, of one robot and of many that take turns, with the size of their source and the time to
build it, where nothing is kept::

    python benchmarks/compiled.py --steps-in-c [NAME ...]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time

import numpy as np

from drake_rnn import Array, CompiledRuns, CompiledStep, Experiment, load_experiment, require_jax
from many import SUBJECTS, bare_unit, cpu, variants
from markdown_table import head, row

# Laws of `--steps-in-c`.
_IN_C = [
    "slc_nephroid_known",
    "naljdf_clover",
    "adaptive_nephroid_known",
    "adaptive_nephroid",
    "adaptive_jerk",
]
_METRICS = ["position_error_rms_m", "position_error_max_m"]
# Robots that take turns in C, and the samples that each of them makes.
_MANY, _SAMPLES = 1000, 50


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=list(SUBJECTS))
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 1000])
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--no-threads", action="store_true")
    parser.add_argument("--steps-in-c", action="store_true")
    options = parser.parse_args()
    if options.steps_in_c:
        measure_in_c(_IN_C if options.names == list(SUBJECTS) else options.names, options.turns)
        return
    if options.no_threads:
        require_jax().config.update("jax_cpu_enable_async_dispatch", False)
    head("experiment", "what", "us a robot-step", "units")
    for name in options.names:
        for count in options.counts:
            experiments = variants(name, SUBJECTS[name], count, options.duration)
            measure_runs(name, experiments, options.turns)
        measure_step(name, options.duration, options.turns)


def measure_runs(name: str, experiments: list[Experiment], turns: int) -> None:
    """Print the row of an experiment and a number of robots."""
    runs, document = CompiledRuns(experiments, _METRICS), experiments[0].document
    runs.run()
    steps = document.duration / (document.period or 1.0) * len(experiments)
    bare = [bare_unit(experiments[0]) for _ in range(turns)]
    least = min(cpu(runs.run) for _ in range(turns)) / steps * 1e6
    row(f"`{name}`", f"{len(experiments)} robots", f"{least:.2f}", f"{least / min(bare):.2f}")


def measure_step(name: str, duration: float, turns: int) -> None:
    """Print the row of single steps, called from Python."""
    (experiment,) = variants(name, SUBJECTS[name], 1, duration)
    step = CompiledStep(experiment, backend="jax")

    def loop() -> None:
        robot, q = step.start(), experiment.start
        for _ in range(robot.samples):
            q = q + robot.period * robot.step(q)

    bare = [bare_unit(experiment) for _ in range(turns)]
    least = min(cpu(loop) for _ in range(turns)) / step.samples * 1e6
    row(f"`{name}`", "a step from Python", f"{least:.2f}", f"{least / min(bare):.2f}")


def measure_in_c(names: list[str], turns: int) -> None:
    """Print a row of each experiment: a step in C, called from Python, and what it took to build.

    Steps and unit take turns, and the least of each counts.
    """
    many = f"{_MANY} robots: us a robot-step"
    columns = ("us a step", "units", many, "units", "kB of C", "s to build, s of these to trace")
    head("experiment", *columns)
    for name in names:
        experiment = load_experiment(name)
        with tempfile.TemporaryDirectory() as folder:
            os.environ["XDG_CACHE_HOME"] = folder
            build_time = _seconds(experiment)
            trace_time = _seconds(experiment)
            step = CompiledStep(experiment, backend="c")

        least = [np.inf] * 3
        for _ in range(max(turns, 5)):
            costs = (
                bare_unit(experiment),
                in_turns(step, experiment.start, 1, step.samples),
                in_turns(step, experiment.start, _MANY, _SAMPLES),
            )
            least = [min(pair) for pair in zip(least, costs, strict=True)]
        unit, *micros = least
        cells = [cell for each in micros for cell in (f"{each:.2f}", f"{each / unit:.2f}")]
        size = len(step.native.source) / 1000
        row(f"`{name}`", *cells, f"{size:.0f}", f"{build_time:.1f}, {trace_time:.1f}")


def in_turns(step: CompiledStep, start: Array, count: int, samples: int) -> float:
    """Return the CPU time of a robot-step of robots that take turns [us]."""

    def loop() -> None:
        moving, q = [step.start() for _ in range(count)], [start] * count
        for _ in range(samples):
            for number, robot in enumerate(moving):
                q[number] = q[number] + step.period * robot.step(q[number])

    return cpu(loop) / count / samples * 1e6


def _seconds(experiment: Experiment) -> float:
    """Return how long it takes to make a step in C [s of wall time]."""
    begin = time.perf_counter()
    CompiledStep(experiment, backend="c")
    return time.perf_counter() - begin


if __name__ == "__main__":
    main()
