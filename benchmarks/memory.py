"""Measure how much memory a run takes at its peak, beyond what the process has before it.

Each run has a process of its own, one at a time.
"""

from __future__ import annotations

import argparse
import resource
import time
from multiprocessing import get_context

from rich.console import Console
from rich.table import Table

from drake_rnn import load_experiment, simulate


def peak() -> float:
    """Return the largest memory that this process has had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(name: str, duration: float, series: str) -> tuple[str, ...]:
    """Return the row of a run."""
    free = {"window": None, "accept": None}
    # Libraries are loaded, and models read, by the first run.
    simulate(load_experiment(name, {**free, "duration": 0.3}))
    before, began = peak(), time.perf_counter()
    result = simulate(load_experiment(name, {**free, "duration": duration}), series=series)
    taken = time.perf_counter() - began
    stored = sum(values.nbytes for values in result.series.values()) / 2**20
    return (
        f"{duration:g}",
        series,
        f"{before:.0f}",
        f"{peak() - before:.0f}",
        f"{stored:.0f}",
        f"{taken:.0f}",
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiment", nargs="?", default="slc_nephroid_known")
    parser.add_argument("--durations", type=float, nargs="+", default=[60.0, 300.0])
    parser.add_argument("--series", nargs="+", default=["full", "none"])
    given = parser.parse_args()
    table = Table(title=f"memory of {given.experiment} [MB]")
    for column in ("duration [s]", "--series", "before", "more", "of it series", "time [s]"):
        table.add_column(column, justify="right")
    jobs = [(given.experiment, t, kind) for kind in given.series for t in given.durations]
    with get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for job in jobs:
            table.add_row(*pool.apply(measure, job))
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
