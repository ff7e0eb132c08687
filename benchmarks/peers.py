"""Compare our laws with other libraries of differential inverse kinematics.

Prints the tables of `docs/peers.md` as Markdown, and draws its picture::

    pip install -e '.[peers]'
    python benchmarks/peers.py [--task TASK ...] [--rounds ROUNDS] [--figure docs/peers.png]
        [--elsewhere PYTHON]

All peers get the same model, path, bounds, posture and braking feedback. A peer that is not
installed is left out, and its row says so, unless another environment has it.
"""

from __future__ import annotations

import argparse
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from math import nan
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import NamedTuple

import numpy as np

from bench import unit
from drake_rnn import InvalidInputError
from markdown_table import head, row
from peer_schemes.chosen_tasks import OURS, chosen_tasks
from peer_schemes.figures import figures_of
from peer_schemes.ours import CompiledLoop, Ours, PlainLoop, diagram_cost, motion_of
from peer_schemes.picture import draw
from peer_schemes.rows import IN_C, Row, columns
from peer_schemes.scheme import Motion, Scheme, pose_difference, run
from peer_schemes.tasks import Task

#: Modules of peers, each with its `SCHEMES`, by the package that they need.
PEERS = {
    "placo": "peer_schemes.placo_scheme",
    "pink": "peer_schemes.pink_scheme",
    "mink": "peer_schemes.mink_scheme",
    "OInK": "peer_schemes.roboplan_scheme",
    "EmbodiK": "peer_schemes.embodik_scheme",
    "Drake": "peer_schemes.drake_schemes",
    "klimits": "peer_schemes.klimits_scheme",
    "Ruckig": "peer_schemes.ruckig_scheme",
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


class Entry(NamedTuple):
    """Rows of a table, and how their costs are measured once more.

    Attributes:
        rows: The rows.
        again: Returns the cost of a step and that of a sample of the diagram, of each row.
    """

    rows: list[Row]
    again: Callable[[], list[tuple[float, float]]]

    def with_costs(self, costs: Sequence[tuple[float, float]]) -> Entry:
        """Return the same with the smaller costs."""
        return self._replace(
            rows=[
                replace(row, cost=min(row.cost, cost), diagram=min(row.diagram, diagram))
                for row, (cost, diagram) in zip(self.rows, costs, strict=True)
            ]
        )


def peer_entry(scheme: type[Scheme], task: Task) -> Entry:
    """Return the row of a scheme of another library."""

    def motion() -> Motion:
        with quiet():
            return run(scheme(task))

    first = motion()
    made = Row(
        scheme.name, scheme.setting, figures_of(first, task), median(first.costs),
        failures=first.failures,
    )  # fmt: skip
    return Entry([made], lambda: [(median(motion().costs), nan)])


def entry_elsewhere(python: str, name: str, task: Task) -> Entry:
    """Return the rows of a library that only another environment has, from its interpreter."""

    def asked() -> list[Row]:
        command = [python, __file__, "--task", task.name, "--rows-of", name]
        return pickle.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)

    return Entry(asked(), lambda: [(row.cost, row.diagram) for row in asked()])


def peer_entries(task: Task, elsewhere: str | None = None) -> Iterator[Entry]:
    """Yield a row for each scheme of each peer."""
    for name, place in PEERS.items():
        module = imported(place)
        if not isinstance(module, str):
            yield from (peer_entry(scheme, task) for scheme in module.SCHEMES)
        elif elsewhere is not None:
            yield entry_elsewhere(elsewhere, name, task)
        else:
            yield Entry([Row(name, module)], lambda: [(nan, nan)])


def our_entry(ours: Ours, task: Task) -> tuple[Entry, float]:
    """Return a row of ours, and how far its plain loop is from its diagram [rad].

    A law with a filter, a sensor or another signal in its loop has no plain one, and no cost there.
    """
    experiment = ours.on(task)
    motion = motion_of(experiment)
    try:
        plain = run(PlainLoop(task, experiment))
        apart = float(np.abs(motion.position - plain.position).max())
    except InvalidInputError:
        apart = nan
    alike = apart < SAME

    def again() -> list[tuple[float, float]]:
        cost = median(run(PlainLoop(task, experiment)).costs) if alike else nan
        return [(cost, diagram_cost(experiment))]

    made = Row(
        ours.name, ours.setting, figures_of(motion, task),
        median(plain.costs) if alike else nan, diagram_cost(experiment),
    )  # fmt: skip
    return Entry([made], again), apart


def compiled_entry(ours: Ours, task: Task) -> Entry:
    """Return the row of a law of ours in C, or why it is not compiled."""
    experiment, name = ours.on(task), f"{ours.name}{IN_C}"
    try:
        scheme = CompiledLoop(task, experiment)
    except InvalidInputError as error:
        return Entry([Row(name, str(error))], lambda: [(nan, nan)])
    motion = run(scheme)
    made = Row(
        name, "the same with its kinematics in C", figures_of(motion, task),
        median(motion.costs), diagram_cost(experiment, compiled=True),
    )  # fmt: skip

    def again() -> list[tuple[float, float]]:
        cost = median(run(CompiledLoop(task, experiment)).costs)
        return [(cost, diagram_cost(experiment, compiled=True))]

    return Entry([made], again)


def table(task: Task, rounds: int, elsewhere: str | None = None) -> list[Row]:
    """Print the table of a task, and return its rows.

    A round measures all rows in turn, so that costs are of the same time; the smallest counts.
    """
    entries, apart = list(peer_entries(task, elsewhere)), {}
    for ours in OURS:
        if task.name in ours.tasks:
            found, apart[ours.name] = our_entry(ours, task)
            entries += [found, compiled_entry(ours, task)]
    for _ in range(rounds - 1):
        entries = [entry.with_costs(entry.again()) for entry in entries]
    rows = [found for entry in entries for found in entry.rows]
    print(f"\n### {task.name}")
    head(*columns(task.oriented))
    for found in rows:
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
    parser.add_argument(
        "--elsewhere",
        metavar="PYTHON",
        help="interpreter of another environment, for the libraries that this one has not",
    )
    parser.add_argument("--rows-of", choices=PEERS, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.rows_of is not None:
        # What `entry_elsewhere` asks for.
        task, module = tasks[arguments.task[0]](), import_module(PEERS[arguments.rows_of])
        found = [peer_entry(scheme, task).rows[0] for scheme in module.SCHEMES]
        apart = pose_difference(module.SCHEMES[0](task))
        print(f"Poses of {arguments.rows_of} differ from Drake's by {apart:.0e}.", file=sys.stderr)
        sys.stdout.buffer.write(pickle.dumps(found))
        return
    tables = {}
    for number, name in enumerate(arguments.task):
        task = tasks[name]()
        if number == 0:
            agreement(task)
        tables[name] = table(task, arguments.rounds, arguments.elsewhere)
    if arguments.figure is not None:
        draw(tables, arguments.figure)


if __name__ == "__main__":
    main()
