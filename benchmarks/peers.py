"""Compare our laws with placo, pink, mink and Drake's differential inverse kinematics.

Prints the tables of `docs/peers.md` as Markdown, and draws its picture::

    pip install 'drake-rnn[peers]'
    python benchmarks/peers.py [--task TASK ...] [--rounds ROUNDS] [--figure docs/peers.png]

All peers get the same model, path, bounds, posture and braking feedback. A peer that is not
installed is left out, and its row says so.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from math import nan
from pathlib import Path
from statistics import median
from types import ModuleType

import numpy as np

from bench import unit
from drake_rnn import InvalidInputError
from markdown_table import head, row
from peer_schemes.chosen_tasks import OURS, chosen_tasks
from peer_schemes.figures import figures_of
from peer_schemes.ours import Ours, PlainLoop, diagram_cost, motion_of
from peer_schemes.picture import draw
from peer_schemes.rows import Row, columns
from peer_schemes.scheme import Motion, Scheme, pose_difference, run
from peer_schemes.tasks import Task

#: Modules of peers, each with its `SCHEMES`, by the package that they need.
PEERS = {
    "placo": "peer_schemes.placo_scheme",
    "pink": "peer_schemes.pink_scheme",
    "mink": "peer_schemes.mink_scheme",
    "Drake": "peer_schemes.drake_schemes",
}

#: Largest difference of two runs of a law that only rounding sets apart [rad]. Where joints are
#: left free a learned Jacobian amplifies it, without a trace in the end effector's motion.
SAME = 0.2


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what solvers in C print off the tables."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def imported(module: str) -> ModuleType | str:
    """Return a module, or which of its packages is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        return f"not installed: {error.name}"


def least_cost(scheme: Callable[[], Scheme], rounds: int) -> tuple[Motion, float]:
    """Return a scheme's motion and the cost of its step: the least median of several runs."""
    motions = [run(scheme()) for _ in range(rounds)]
    return motions[-1], min(median(motion.costs) for motion in motions)


def peer_rows(task: Task, rounds: int) -> Iterator[Row]:
    """Yield a row for each scheme of each peer."""
    for name, place in PEERS.items():
        module = imported(place)
        if isinstance(module, str):
            yield Row(name, module)
            continue
        for scheme in module.SCHEMES:
            with quiet():
                motion, cost = least_cost(lambda s=scheme: s(task), rounds)
            figures = figures_of(motion, task)
            yield Row(scheme.name, scheme.setting, figures, cost, failures=motion.failures)


def our_row(ours: Ours, task: Task, rounds: int) -> tuple[Row, float]:
    """Return a row of ours, and how far its plain loop is from its diagram [rad].

    A law with a filter, a sensor or another signal in its loop has no plain one, and no cost there.
    """
    experiment = ours.on(task)
    motion = motion_of(experiment)
    try:
        plain, cost = least_cost(lambda: PlainLoop(task, experiment), rounds)
        apart = float(np.abs(motion.position - plain.position).max())
    except InvalidInputError:
        cost, apart = nan, nan
    if not apart < SAME:
        cost = nan
    diagram = min(diagram_cost(experiment) for _ in range(rounds))
    return Row(ours.name, ours.setting, figures_of(motion, task), cost, diagram), apart


def table(task: Task, rounds: int) -> list[Row]:
    """Print the table of a task, and return its rows."""
    print(f"\n### {task.name}")
    head(*columns(task.oriented))
    rows, apart = [], {}
    for found in peer_rows(task, rounds):
        rows.append(found)
        row(*found.cells(task.oriented))
    for ours in OURS:
        if task.name in ours.tasks:
            found, apart[ours.name] = our_row(ours, task, rounds)
            rows.append(found)
            row(*found.cells(task.oriented))
    print("\nDiagram and plain loop of ours are apart by at most [rad]:", end=" ")
    print(", ".join(f"{name} {difference:.0e}" for name, difference in apart.items()))
    return rows


def agreement(task: Task) -> None:
    """Print what the unit is, and how far each peer's poses are from Drake's."""
    print(f"u is {median(unit(task.experiment) for _ in range(9)):.1f} us here.")
    print("Poses of 100 postures differ from Drake's by at most (m, entries of R):", end=" ")
    found = {}
    for name, place in PEERS.items():
        if not isinstance(module := imported(place), str):
            found[name] = pose_difference(module.SCHEMES[0](task))
    print(", ".join(f"{name} {difference:.0e}" for name, difference in found.items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tasks = chosen_tasks()
    parser.add_argument("--task", nargs="+", choices=tasks, default=list(tasks))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--figure", type=Path, help="picture to write")
    arguments = parser.parse_args()
    tables = {}
    for number, name in enumerate(arguments.task):
        task = tasks[name]()
        if number == 0:
            agreement(task)
        tables[name] = table(task, arguments.rounds)
    if arguments.figure is not None:
        draw(tables, arguments.figure)


if __name__ == "__main__":
    main()
