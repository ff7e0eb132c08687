"""Measure the cost of many runs at once, in units of the arm's bare p_WE and J in pydrake.

Robots have starts and gains of their own; every metric is taken on the way. Times are CPU time.
What a thousand `simulate` of these would take is computed from a few of them, run in turn::

    python benchmarks/many.py [--duration SECONDS] [--counts 1 100 1000] [--turns 3]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from bench import unit
from drake_rnn import Experiment, load_experiment, run_many, simulate
from markdown_table import head, row

#: Shipped experiments, and the gain of which each robot has its own.
SUBJECTS = {
    "slc_nephroid_known": "kappa",
    "slc_nephroid_warm_up": "rho",
    "naljdf_table1": "position_gain",
    "pinv_circle": "feedback",
}


def variants(name: str, gain: str, count: int, duration: float) -> list[Experiment]:
    """Return experiments that differ in start and gain.

    Args:
        name: Shipped experiment.
        gain: Field of its law.
        count: How many.
        duration: Duration of each [s].
    """
    base = load_experiment(name, {"duration": duration, "window": None})
    rng = np.random.default_rng(0)
    made = []
    for _ in range(count):
        law: Any = replace(base.law, **{gain: base.law.__dict__[gain] * rng.uniform(0.8, 1.2)})
        start = base.start + rng.normal(0.0, 0.02, base.start.size)
        desired = base.path.placed_on(base.arm, start)
        made.append(replace(base, law=law, start=start, desired=desired))
    return made


def cpu(action: Callable[[], object]) -> float:
    """Return the CPU time of an action [s]."""
    began = time.process_time()
    action()
    return time.process_time() - began


def bare_unit(experiment: Experiment) -> float:
    """Return the CPU time of p_WE and J in pydrake [us]."""
    # Without what it takes to make the plant.
    whole = cpu(lambda: unit(experiment, 10001)) - cpu(lambda: unit(experiment, 1))
    return whole / 10000 * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=list(SUBJECTS))
    parser.add_argument("--duration", type=float, default=0.5)
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 100, 1000])
    parser.add_argument("--turns", type=int, default=3)
    options = parser.parse_args()
    head("experiment", "robots", "us a robot-step", "units", "simulate: us a step", "times dearer")
    for name in options.names:
        for count in options.counts:
            measure(name, count, options.duration, options.turns)


def measure(name: str, count: int, duration: float, turns: int) -> None:
    """Print the row of an experiment and a number of robots."""
    experiments = variants(name, SUBJECTS[name], count, duration)
    document = experiments[0].document
    steps = duration / (document.period or 1.0)
    bare, many, drake = [], [], []
    for turn in range(turns):
        bare.append(bare_unit(experiments[0]))
        many.append(cpu(lambda: run_many(experiments)) / steps / count)
        one = experiments[turn % count]
        drake.append(cpu(lambda one=one: simulate(one, series="none")) / steps)
    least, of_drake = min(many) * 1e6, min(drake) * 1e6
    ratio = min(drake) / min(many)
    units = least / min(bare)
    row(f"`{name}`", count, f"{least:.2f}", f"{units:.2f}", f"{of_drake:.1f}", f"{ratio:.3g}")


if __name__ == "__main__":
    main()
