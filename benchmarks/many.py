r"""Measure the cost of many runs at once, in units of the arm's bare p_WE and J in pydrake.

Robots have starts and gains of their own; every metric is taken on the way. Times are CPU time.
What as many `simulate` would take is computed from a few of them, run in turn::

    python benchmarks/many.py [--duration SECONDS] [--counts 1 100 1000] [--turns 3]
    python benchmarks/many.py slc_nephroid_known --duration 20 --counts 1000 --turns 1 \
        --simulated 20
    python benchmarks/many.py slc_nephroid_known --duration 0.01 --memory 100000

The last one prints the peak of memory when that many robots are made and run.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np

from bench import unit
from drake_rnn import Experiment, make_experiment, run_many, simulate
from drake_rnn.experiment import Arms, read_document
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
    document = read_document(name, {"duration": duration, "window": None})
    shared = Arms()
    base = make_experiment(document, arms=shared)
    rng = np.random.default_rng(0)
    made = []
    for _ in range(count):
        own = {**document["law"], gain: base.law.__dict__[gain] * rng.uniform(0.8, 1.2)}
        start = base.start + rng.normal(0.0, 0.02, base.start.size)
        changed = {**document, "law": own, "start": start.tolist()}
        made.append(make_experiment(changed, arms=shared))
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
    parser.add_argument("--simulated", type=int, default=1, help="`simulate` of each turn")
    parser.add_argument("--memory", type=int, default=0, metavar="ROBOTS")
    options = parser.parse_args()
    if options.memory:
        for name in options.names:
            measure_memory(name, options.memory, options.duration)
        return
    columns = ("us a robot-step", "units", "made in ms", "simulate: us a step", "times dearer")
    head("experiment", "robots", *columns)
    for name in options.names:
        for count in options.counts:
            measure(name, count, options.duration, (options.turns, options.simulated))


def measure_memory(name: str, count: int, duration: float) -> None:
    """Print the peak of this process's memory while robots are made and run."""
    before = peak()
    took = cpu(lambda: run_many(variants(name, SUBJECTS[name], count, duration)))
    print(
        f"`{name}`, {count} robots, {duration:g} s: peak {peak():.0f} MB, {before:.0f} MB of which "
        f"without any; {took:.0f} s"
    )


def peak() -> float:
    """Return the largest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def measure(name: str, count: int, duration: float, turns: tuple[int, int]) -> None:
    """Print the row of an experiment and a number of robots.

    Args:
        name: Shipped experiment.
        count: Number of robots.
        duration: Duration [s].
        turns: How often each is measured, and how many single runs that is each time.
    """
    began = time.process_time()
    experiments = variants(name, SUBJECTS[name], count, duration)
    made = (time.process_time() - began) / count * 1e3
    document = experiments[0].document
    steps = duration / (document.period or 1.0)
    bare, many, drake = [], [], []
    times, single = turns
    for turn in range(times):
        bare.append(bare_unit(experiments[0]))
        many.append(cpu(lambda: run_many(experiments)) / steps / count)
        for k in range(turn * single, (turn + 1) * single):
            one = experiments[k % count]
            drake.append(cpu(lambda one=one: simulate(one, series="none")) / steps)
    least, of_drake = min(many) * 1e6, min(drake) * 1e6
    ratio = min(drake) / min(many)
    costs = f"{least:.2f}", f"{least / min(bare):.2f}", f"{made:.2f}"
    row(f"`{name}`", count, *costs, f"{of_drake:.1f}", f"{ratio:.3g}")


if __name__ == "__main__":
    main()
