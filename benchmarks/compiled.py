"""Measure the cost of runs compiled by JAX, in units of the arm's bare p_WE and J in pydrake.

One robot, whole run under scan; many robots; and one step called from a loop in Python, with the
waiting for threads that JAX has by default, or without (``--no-threads``). Robots have starts and
gains of their own; the position error is taken on the way. CPU time without compilation::

    python benchmarks/compiled.py [NAME ...] [--duration SECONDS] [--counts 1 1000] [--no-threads]
"""

from __future__ import annotations

import argparse

from drake_rnn import CompiledRuns, CompiledStep, Experiment, require_jax
from many import SUBJECTS, bare_unit, cpu, variants
from markdown_table import head, row

_METRICS = ["position_error_rms_m", "position_error_max_m"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=list(SUBJECTS))
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 1000])
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--no-threads", action="store_true")
    options = parser.parse_args()
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
    step = CompiledStep(experiment)

    def loop() -> None:
        robot, q = step.start(), experiment.start
        for _ in range(robot.samples):
            q = q + robot.period * robot.step(q)

    bare = [bare_unit(experiment) for _ in range(turns)]
    least = min(cpu(loop) for _ in range(turns)) / step.samples * 1e6
    row(f"`{name}`", "a step from Python", f"{least:.2f}", f"{least / min(bare):.2f}")


if __name__ == "__main__":
    main()
