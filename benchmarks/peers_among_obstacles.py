"""Compare our adaptive law with avoidance of collisions by other libraries.

Prints the tables of `docs/peers.md` of arms among obstacles, as Markdown::

    pip install -e '.[peers]'
    python benchmarks/peers_among_obstacles.py --scenes 10 [--elsewhere PYTHON] [--kept FOLDER]
    python benchmarks/peers_among_obstacles.py --choose pink    # tries its grid, on other scenes

All get the same capsules, obstacles, path, feedback and bounds; distances are judged by ours,
between samples too. A library that is not installed is left out, and its row says so, unless
another environment has it.
"""

from __future__ import annotations

import argparse
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from math import nan
from pathlib import Path
from statistics import median
from typing import NamedTuple

from markdown_table import head, row
from peer_schemes.obstacle_figures import Judged, judged, together
from peer_schemes.obstacle_scheme import ObstacleScheme, gap_difference, settings_of
from peer_schemes.obstacle_tasks import (
    BALLS,
    FAR,
    ITSELF,
    WALLS,
    ObstacleTask,
    far_balls,
    into_itself,
    into_walls,
    ten_balls,
)
from peer_schemes.ours import CompiledLoop, PlainLoop
from peer_schemes.rows import ROUNDING, digits, ratio
from peer_schemes.scheme import Scheme, run
from peer_schemes.shapes import Shapes
from peers import imported, quiet

#: Modules of peers, each with its `SCHEMES`, by the package that they need.
PEERS = {
    "placo": "peer_schemes.placo_obstacles",
    "pink": "peer_schemes.pink_obstacles",
    "mink": "peer_schemes.mink_obstacles",
    "OInK": "peer_schemes.roboplan_obstacles",
    "cbfpy": "peer_schemes.cbfpy_obstacles",
}
OURS = "ours"
#: Settings that cbfpy recommends on a processor; they count if set before it is imported.
ENVIRONMENT = {
    "JAX_ENABLE_X64": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OPENBLAS_NUM_THREADS": "1",
}
#: Scenes on which gains are chosen, and for how many samples of each.
CHOOSING, CHOOSING_STEPS = (1000, 1001), 3000
COLUMNS = (
    "scheme", "setting", "collided", "samples without a solution", "least distance [mm]",
    "a / bound", "reversals [1/s]", "on the path at the end", "u a step",
)  # fmt: skip


class Entry(NamedTuple):
    """A scheme on all scenes of a table.

    Attributes:
        name: Its name.
        setting: What is set, or why it did not run.
        judged: What was measured; None if it did not run.
        cost: Median cost of a step, in units of pydrake's p_WE and J.
    """

    name: str
    setting: str
    judged: Judged | None = None
    cost: float = nan


def measured(
    name: str, setting: str, made: Callable[[ObstacleTask], Scheme], tasks: list[ObstacleTask]
) -> Entry:
    """Return a scheme's entry."""
    parts, costs = [], []
    for task in tasks:
        with quiet():
            motion = run(made(task))
        parts.append(judged(motion, task))
        costs += motion.costs
    return Entry(name, setting, together(parts), median(costs))


def our_entries(tasks: list[ObstacleTask]) -> list[Entry]:
    """Return the adaptive law with nothing but its bounds, and with avoidance, also in C."""
    name = "ours: adaptive"
    blind = measured(
        f"{name}, bounds only", "avoids nothing", lambda task: PlainLoop(task, task.blind), tasks
    )
    avoiding = measured(name, "as shipped", lambda task: PlainLoop(task, task.experiment), tasks)
    in_c = measured(
        f"{name}, in C", "as shipped", lambda task: CompiledLoop(task, task.experiment), tasks
    )
    return [blind, avoiding, in_c]


def entries_of(library: str, tasks: list[ObstacleTask]) -> list[Entry]:
    """Return the rows of a library, which is installed."""
    if library == OURS:
        return our_entries(tasks)
    schemes = import_module(PEERS[library]).SCHEMES
    return [measured(scheme.name, scheme.told(), scheme, tasks) for scheme in schemes]


def entries(
    table: str, scenes: int, tasks: list[ObstacleTask], elsewhere: str | None, kept: Path | None
) -> Iterator[Entry]:
    """Yield the rows of all libraries, peers first."""
    for library in (*PEERS, OURS):
        file = None if kept is None else kept / f"{table}-{scenes}-{library}.pickle"
        if file is not None and file.exists():
            yield from pickle.loads(file.read_bytes())
            continue
        missing = imported(PEERS[library]) if library != OURS else ""
        if not isinstance(missing, str) or library == OURS:
            found = entries_of(library, tasks)
        elif elsewhere is not None:
            found = entries_elsewhere(elsewhere, library, table, scenes)
        else:
            yield Entry(library, missing)
            continue
        if file is not None:
            file.write_bytes(pickle.dumps(found))
        yield from found


def entries_elsewhere(python: str, library: str, table: str, scenes: int) -> list[Entry]:
    """Return the rows of a library that only another environment has, from its interpreter."""
    chosen = ["--table", table, "--scenes", str(scenes), "--rows-of", library]
    command = [python, __file__, *chosen]
    return pickle.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def tasks_of(table: str, scenes: int) -> list[ObstacleTask]:
    """Return the scenes of a table."""
    if table == BALLS:
        return [ten_balls(seed) for seed in range(scenes)]
    return [{ITSELF: into_itself, WALLS: into_walls, FAR: far_balls}[table]()]


def print_table(table: str, found: list[Entry]) -> None:
    """Print a table; that of balls that are far tells the error in place of the distance."""
    print(f"\n### {table}")
    columns = ["error max [um]" if table == FAR and c.startswith("least") else c for c in COLUMNS]
    head(*columns)
    for name, setting, figures, cost in found:
        if figures is None:
            row(name, setting, *[""] * (len(columns) - 2))
            continue
        acceleration = ratio(figures.acceleration)
        if max(figures.velocity - 1.0, figures.beyond) > ROUNDING:
            acceleration += f" (v: {ratio(figures.velocity)})"
        row(
            name,
            setting,
            f"{figures.collided} of {figures.scenes}",
            figures.failures,
            digits(1e6 * figures.error) if table == FAR else f"{1e3 * figures.least:.2f}",
            acceleration,
            digits(figures.reversals),
            f"{figures.back} of {figures.scenes}",
            f"{cost:.0f}",
        )


def agreement() -> None:
    """Print how far the distances that each library sees are from ours."""
    task = ten_balls(0)
    shapes, found = Shapes(task), {}
    for library, place in PEERS.items():
        if not isinstance(module := imported(place), str):
            found[library] = gap_difference(module.SCHEMES[0](task), shapes)
    print("Distances of 50 postures differ from ours by at most [m]:", end=" ")
    print(", ".join(f"{name} {difference:.0e}" for name, difference in found.items()))


def choose(scheme: type[ObstacleScheme]) -> None:
    """Print what each setting of a scheme's grid does on scenes of no table, the best one last.

    The best has the fewest collisions, keeps the bound of the acceleration, has the fewest samples
    without a solution, in twentieths of all, keeps 10 mm, and has the fewest reversals.
    """
    tasks = [ten_balls(seed) for seed in CHOOSING]
    for task in tasks:
        task.steps, task.window = CHOOSING_STEPS, slice(0, CHOOSING_STEPS + 1)
    found = []
    for tried in settings_of(scheme):
        entry = measured(tried.name, tried.told(), tried, tasks)
        figures = entry.judged
        assert figures is not None
        key = (
            figures.collided,
            figures.acceleration > 1.0 + 1e-3,
            20 * figures.failures // (len(tasks) * CHOOSING_STEPS),
            figures.least < 0.01,
            figures.reversals,
        )
        found.append((key, figures.least, entry.setting))
        print(*found[-1], file=sys.stderr, flush=True)
    for each in sorted(found, reverse=True):
        print(*each)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tables = (BALLS, ITSELF, WALLS, FAR)
    parser.add_argument("--table", nargs="+", choices=tables, default=tables)
    parser.add_argument("--scenes", type=int, default=10, help="number of scenes of balls")
    parser.add_argument(
        "--elsewhere",
        metavar="PYTHON",
        help="interpreter of another environment, for the libraries that this one has not",
    )
    parser.add_argument("--kept", type=Path, help="folder of rows that are not measured again")
    parser.add_argument("--choose", choices=PEERS, help="library whose gains are to be chosen")
    parser.add_argument("--rows-of", choices=(*PEERS, OURS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    if options.choose is not None:
        for scheme in import_module(PEERS[options.choose]).SCHEMES:
            choose(scheme)
        return
    if options.rows_of is not None:
        # What `entries_elsewhere` asks for.
        (table,) = options.table
        found = entries_of(options.rows_of, tasks_of(table, options.scenes))
        sys.stdout.buffer.write(pickle.dumps(found))
        return
    agreement()
    for table in options.table:
        tasks = tasks_of(table, options.scenes)
        print_table(
            table, list(entries(table, options.scenes, tasks, options.elsewhere, options.kept))
        )


if __name__ == "__main__":
    main()
