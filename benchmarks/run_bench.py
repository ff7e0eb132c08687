"""Measure what ``drake-rnn run`` of one simulated second takes, from the prompt to the prompt.

Each command is a process of its own. Processor time counts all of its threads and children, and
hardly depends on what else the machine does; wall time does. The smallest of several rounds counts,
as the least disturbed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

#: Largest wall time of a whole run on a machine that does nothing else [s].
TARGET = 3.0
#: Runs of each kind: known and learned Jacobian, joint-drift-free, towards a posture, with
#: dynamics, in contact, and in contact with a learned Jacobian.
EXPERIMENTS = (
    "slc_nephroid_known",
    "slc_nephroid_warm_up",
    "naljdf_clover",
    "state_adjustment",
    "slc_nephroid_dynamic",
    "contact_circle",
    "contact_cat_learned",
)
#: Commands of a row.
STAGES = (
    ("checked alone", ("--dry-run",)),
    ("without pictures", ("--no-figures", "--no-playback")),
    ("with playback", ("--no-figures",)),
    ("with figures, too", ()),
)


def cost(*arguments: str) -> tuple[float, float]:
    """Return processor and wall time of ``drake-rnn`` with these arguments [s]."""
    before, began = os.times(), time.perf_counter()
    command = [sys.executable, "-m", "drake_rnn", *arguments]
    subprocess.run(command, check=True, capture_output=True)
    wall, after = time.perf_counter() - began, os.times()
    user = after.children_user - before.children_user
    return user + after.children_system - before.children_system, wall


def least(rounds: int, *arguments: str) -> tuple[float, float]:
    """Return the smallest processor and wall time of several rounds [s]."""
    costs = [cost(*arguments) for _ in range(rounds)]
    processor, wall = (min(column) for column in zip(*costs, strict=True))
    return processor, wall


def run_table(names: list[str], rounds: int) -> Table:
    """Return a table with one row per experiment."""
    table = Table(title="processor time of drake-rnn run ... --duration 1 [s]")
    columns = (*(title for title, _ in STAGES), "wall time", "at most")
    for column in ("experiment", *columns):
        table.add_column(column, justify="right")
    for name in names:
        with TemporaryDirectory() as folder:
            run = ("run", name, "--duration", "1", "--set", "window=null", "--out", folder)
            costs = [least(rounds, *run, *options) for _, options in STAGES]
        _, wall = costs[-1]
        figures = (*(processor for processor, _ in costs), wall, TARGET)
        table.add_row(name, *(f"{figure:.2f}" for figure in figures))
    return table


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiments", nargs="*", default=EXPERIMENTS, metavar="EXPERIMENT")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    Console(width=160).print(run_table(list(arguments.experiments), arguments.rounds))


if __name__ == "__main__":
    main()
