"""Measure the cost of kinematics for many robots, in units of the arm's bare p_WE and J in pydrake.

Times are CPU time for each robot. All figures of a row are measured in turn with the unit; the
smallest of each counts, as the least disturbed. JAX, where it is installed, runs a loop of its own
that carries all results, compiled once.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table

from bench import unit
from drake_rnn import (
    InvalidInputError,
    Screws,
    load_experiment,
    random_link_errors,
    require_jax,
    screws_of,
    with_link_errors,
)

#: What a column of the table asks for.
ASKED = {
    "p": ("p_WE",),
    "p, J": ("p_WE", "J"),
    "p, R, J, J_omega": ("p_WE", "R_WE", "J", "J_omega"),
    "and Jdot_v": ("p_WE", "R_WE", "J", "J_omega", "Jdot_v"),
}
#: Steps of a loop in JAX, as many as take a while.
STEPS = 200


def results(screws: Screws, q, v, asked):
    """What is asked for of some robots, in a list."""
    moved = screws.at(q)
    by_name = {
        "p_WE": lambda: moved.p_WE,
        "R_WE": lambda: moved.R_WE,
        "J": lambda: moved.J,
        "J_omega": lambda: moved.J_omega,
        "Jdot_v": lambda: moved.Jdot_v(v),
    }
    return [by_name[name]() for name in asked]


def in_numpy(screws: Screws, q, v, asked) -> Callable[[], object]:
    """A call that computes what is asked for once."""
    beside = [np.ascontiguousarray(values.T).T for values in (q, v)]
    return lambda: results(screws, *beside, asked)


def in_jax(jax, screws: Screws, q, v, asked) -> Callable[[], object]:
    """A call that computes what is asked for STEPS times, in a compiled loop."""

    def step(carried, _):
        q, _ = carried
        return (q + 1e-6 * v, results(screws, q, v, asked)), None

    loop = jax.jit(lambda carried: jax.lax.scan(step, carried, length=STEPS)[0])
    start = jax.numpy.asarray(q)
    carried = (start, results(screws, start, v, asked))
    return lambda: jax.block_until_ready(loop(carried))


def cost(call: Callable[[], object], least: float = 0.02) -> float:
    """The CPU time of a call, of as many as take some time [us]."""
    began, calls = time.process_time(), 0
    while (taken := time.process_time() - began) < least:
        call()
        calls += 1
    return taken / calls * 1e6


def measured(calls: list[Callable[[], object]], experiment, rounds: int) -> tuple[float, list]:
    """The unit and the cost of each call, in turn, the smallest of each [us]."""
    for call in calls:
        call()
    found = [(unit(experiment, 500), *map(cost, calls)) for _ in range(rounds)]
    one, *costs = (min(column) for column in zip(*found, strict=True))
    return one, costs


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 100, 1000])
    arguments = parser.parse_args()
    experiment = load_experiment("slc_nephroid_known")
    shared, rng = screws_of(experiment.arm), np.random.default_rng(0)
    table = Table(title="kinematics of one robot of many, in units of p_WE and J (us in brackets)")
    for column in ("arrays", "arms", "robots", *ASKED):
        table.add_column(column, justify="right")
    try:
        jax = require_jax()
    except InvalidInputError as error:
        jax = None
        print(error)
    for robots in arguments.robots:
        own = with_link_errors(shared, random_link_errors(shared, rng, robots))
        q, v = rng.uniform(-2, 2, (2, robots, shared.n))
        for arrays in ("NumPy",) if jax is None else ("NumPy", "JAX"):
            for arms, screws in (("shared", shared), ("own", own)):
                asked = ASKED.values()
                if arrays == "NumPy":
                    calls, times = [in_numpy(screws, q, v, names) for names in asked], 1
                else:
                    calls, times = [in_jax(jax, screws, q, v, names) for names in asked], STEPS
                one, costs = measured(calls, experiment, arguments.rounds)
                each = [value / robots / times for value in costs]
                cells = (f"{value / one:.2f} ({value:.2f})" for value in each)
                table.add_row(arrays, arms, str(robots), *cells)
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
