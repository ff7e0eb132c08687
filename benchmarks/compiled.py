"""Measure the cost of runs compiled by JAX, in units of the arm's bare p_WE and J in pydrake.

One robot, whole run under scan; many robots; and one step called from a loop in Python, with the
waiting for threads that JAX has by default, or without (``--no-threads``). Robots have starts and
gains of their own; the position error is taken on the way. CPU time without compilation::

    python benchmarks/compiled.py [NAME ...] [--duration SECONDS] [--counts 1 1000] [--no-threads]

Steps in C, of one robot and of many that take turns, with the size of their source and the time to
build it, where nothing is kept::

    python benchmarks/compiled.py --steps-in-c [NAME ...]

A tick of the whole diagram with the recorder, its law in C, and a step of many robots among five
balls each, by one build::

    python benchmarks/compiled.py --ticks
    python benchmarks/compiled.py --among-obstacles
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time

import numpy as np

from avoidance import scene
from drake_rnn import Array, CompiledRuns, CompiledStep, Experiment, load_experiment, require_jax
from drake_rnn.compiled.library import laws_step
from drake_rnn.laws.checks import sampled_reading, stack
from drake_rnn.runs.series import RunOptions
from drake_rnn.runs.simulation import recorded_simulator
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
# Ticks of `--ticks`; robots of `--among-obstacles`, and the samples that each of them makes.
_TICKS, _AMONG, _OF_EACH = 4000, 40, 200


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=list(SUBJECTS))
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 1000])
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--no-threads", action="store_true")
    parser.add_argument("--steps-in-c", action="store_true")
    parser.add_argument("--ticks", action="store_true")
    parser.add_argument("--among-obstacles", action="store_true")
    options = parser.parse_args()
    if options.ticks:
        measure_ticks(options.turns)
        return
    if options.among_obstacles:
        measure_among_obstacles()
        return
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


def measure_ticks(turns: int) -> None:
    """Print a row of each law: a tick of the whole diagram, its law in NumPy and in C."""
    head("experiment", "NumPy: us", "units", "C: us", "units")
    for name in ("slc_nephroid_known", "adaptive_nephroid_known"):
        period = load_experiment(name).document.period or 0.0
        experiment = load_experiment(name, {"duration": _TICKS * period, "window": None})
        least = [np.inf] * 3
        for _ in range(max(turns, 5)):
            costs = (bare_unit(experiment), *(tick(experiment, by) for by in (False, True)))
            least = [min(pair) for pair in zip(least, costs, strict=True)]
        unit, *micros = least
        row(f"`{name}`", *(f"{x:.1f}" for each in micros for x in (each, each / unit)))


def tick(experiment: Experiment, compiled: bool) -> float:
    """Return the CPU time of a sample of the whole diagram, recorder included [us]."""
    simulator, _, recorder = recorded_simulator(experiment, options=RunOptions(compiled=compiled))
    recorder.watch(simulator)
    simulator.Initialize()
    return cpu(lambda: simulator.AdvanceTo(experiment.document.duration)) / _TICKS * 1e6


def measure_among_obstacles(name: str = "adaptive_nephroid_known") -> None:
    """Print what a step costs of a robot among five balls, the mean of many side by side."""
    head("bounded", "robots", "pairs", "us a robot-step", "units")
    for jerk in (None, 20.0):
        limits = {"limits.jerk": jerk}
        made = [
            load_experiment(name, {**limits, "obstacles": scene(seed, limits, name)})
            for seed in range(_AMONG)
        ]
        mean, unit = step_among_obstacles(made), bare_unit(made[0])
        pairs = made[0].clearance.count if made[0].clearance else 0
        bound = "acceleration" if jerk is None else "jerk"
        row(bound, _AMONG, pairs, f"{mean:.1f}", f"{mean / unit:.2f}")


def step_among_obstacles(made: list[Experiment]) -> float:
    """Return the CPU time of a robot-step of their laws, along the motion that they make [us]."""
    period = made[0].document.period or 0.0
    readings = [sampled_reading(each.law, period) for each in made]
    step, rng, took = laws_step(readings, stack(readings), period), np.random.default_rng(0), 0.0
    kinematics, postures, x = made[0].arm.kinematics(), [each.start for each in made], np.zeros(0)
    for k in range(_OF_EACH):
        rows = []
        for each, q in zip(made, postures, strict=True):
            p, ahead = (each.desired.position(t)[0] for t in (k * period, (k + 1) * period))
            seen = {"position": q, "p_WE": kinematics.p_WE(q), "J": kinematics.J(q)}
            seen |= {"J_omega": kinematics.J_omega(q)}
            rows.append(seen | {"p_WE_desired": p, "p_preview": ahead})
        u = {part: np.stack([each[part] for each in rows]) for part in rows[0]}
        if not k:
            pairs = zip(readings, rows, strict=True)
            x = np.stack([reading.initial_state(rng, each) for reading, each in pairs])
        began = time.process_time()
        x = step(k * period, x, u, period)
        took += time.process_time() - began
        v = readings[0].state.part(x, "v")
        postures = [q + period * each for q, each in zip(postures, v, strict=True)]
    return took / _OF_EACH / len(made) * 1e6


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
