"""Measure how long commands take that start no run, in units of a bare ``import typer, rich``.

Each is a process of its own, as from a prompt. A round measures the unit and then each start, so
that all meet the same machine; of several rounds the smallest counts, as the least disturbed. Times
are those of the processor. Bytecode is cached, as it is where the package is installed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

UNIT = ("-c", "import typer, rich")
COMMAND = ("-m", "drake_rnn")
STARTS = {
    "drake-rnn --version": (*COMMAND, "--version"),
    "drake-rnn --help": (*COMMAND, "--help"),
    "drake-rnn run --help": (*COMMAND, "run", "--help"),
    "drake-rnn walk (refused)": (*COMMAND, "walk"),
    "drake-rnn list": (*COMMAND, "list"),
    "drake-rnn show pinv_line": (*COMMAND, "show", "pinv_line"),
    "import drake_rnn": ("-c", "import drake_rnn"),
    "from drake_rnn import Adaptive": ("-c", "from drake_rnn import Adaptive"),
    "from drake_rnn import simulate": ("-c", "from drake_rnn import simulate"),
    "import the same of pydrake": (
        "-c",
        "import pydrake.geometry, pydrake.multibody.plant, pydrake.multibody.parsing, "
        "pydrake.systems.analysis, pydrake.systems.framework, pydrake.systems.primitives, "
        "pydrake.trajectories",
    ),
}


def cost(bytecode: str, *arguments: str) -> float:
    """Return the processor time of Python with these arguments [s]."""
    cached = {"PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
    before = os.times()
    subprocess.run(
        [sys.executable, *arguments], env=os.environ | cached, capture_output=True, check=False
    )
    after = os.times()
    user = after.children_user - before.children_user
    return user + after.children_system - before.children_system


def measured(bytecode: str) -> dict[str, tuple[float, float]]:
    """Return for each start its processor time [s], and how many times the unit that is."""
    unit = cost(bytecode, *UNIT)
    times = {name: cost(bytecode, *arguments) for name, arguments in STARTS.items()}
    return {name: (time, time / unit) for name, time in times.items()}


def main() -> None:
    """Print a table with a row for each start."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    with TemporaryDirectory() as bytecode:
        # A first round writes the bytecode.
        _, *rounds = [measured(bytecode) for _ in range(arguments.rounds + 1)]
    table = Table(title="processor time of a start")
    for column in ("start", "time [s]", "of import typer, rich"):
        table.add_column(column, justify="left" if column == "start" else "right")
    for name in STARTS:
        time, ratio = (min(column) for column in zip(*(each[name] for each in rounds), strict=True))
        table.add_row(name, f"{time:.2f}", f"{ratio:.1f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
