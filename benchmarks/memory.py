"""Measure how much memory a run takes at its peak, and what is never given back.

Each run has a process of its own, one at a time::

    python benchmarks/memory.py slc_nephroid_known --durations 60 300
    python benchmarks/memory.py --calls 100          # what each call leaves behind
    python benchmarks/memory.py --calls 1000 --tasks simulate "law switch" reset
"""

from __future__ import annotations

import argparse
import gc
import os
import resource
import time
from collections.abc import Callable
from ctypes import CDLL
from dataclasses import dataclass
from functools import partial
from itertools import count, cycle
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from drake_rnn import (
    InvalidInputError,
    SimulationError,
    build_diagram,
    check_experiment,
    export,
    load_arm,
    load_experiment,
    run_many,
    simulate,
    sweep,
    tune,
    write_figures,
    write_playback,
)
from drake_rnn.experiment.components import Arms
from drake_rnn.live.session import Session
from drake_rnn.playback.arm_drawing import write_arm_picture
from drake_rnn.runs.result import Result
from markdown_table import head, row

# A run for what is done many times: so short that it costs hardly more than its diagram.
_SHORT = {"duration": 0.01, "window": None, "accept": None, "over": None}
# Calls before the first measurement: libraries are loaded and caches filled by then.
_WARM = 20

#: What is done again and again.
Call = Callable[[], object]


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


def resident() -> float:
    """Return the memory that this process needs now [MB].

    What it has freed is given back before: the allocator keeps tens of megabytes where calls need
    much for a short time, as figures do, more or less by chance.
    """
    if (trim := getattr(CDLL(None), "malloc_trim", None)) is not None:
        trim(0)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@dataclass(frozen=True)
class Left:
    """What calls leave behind.

    Attributes:
        memory: Memory [MB].
        objects: Objects of Python.
        files: Open files.
        time: Time of a call [s].
    """

    memory: float
    objects: int
    files: int
    time: float


def growth(call: Call, calls: int, warm: int = _WARM) -> Left:
    """Return what calls leave behind.

    Args:
        call: What is called.
        calls: How often.
        warm: Calls before the first measurement.
    """
    for _ in range(warm):
        call()
    gc.collect()
    memory, objects, files = resident(), len(gc.get_objects()), _open_files()
    began = time.perf_counter()
    for _ in range(calls):
        call()
    taken = time.perf_counter() - began
    gc.collect()
    more = len(gc.get_objects()) - objects
    return Left(resident() - memory, more, _open_files() - files, taken / calls)


def _open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def _simulated(name: str) -> Call:
    experiment = load_experiment(name, _SHORT)
    return lambda: simulate(experiment, series="none")


def _loaded(name: str) -> Call:
    return lambda: simulate(load_experiment(name, _SHORT), series="none")


def _of_arms() -> Call:
    """Runs of a campaign, each with links of its own, as one of its workers makes them."""
    arms, seeds = Arms(), count()

    def call() -> None:
        errors = {"link_errors": {"translation": 1e-3, "seed": next(seeds)}}
        changes = _SHORT | {"arm": {"model": "panda", **errors}}
        simulate(load_experiment("slc_nephroid_known", changes, arms=arms), series="none")

    return call


def _interrupted() -> Call:
    """A run that ends early, with an error that holds its result."""
    experiment = load_experiment("slc_nephroid_known", _SHORT | {"duration": 0.3})

    def interrupt(time: float) -> None:
        raise KeyboardInterrupt

    def call() -> None:
        try:
            simulate(experiment, interrupt, series="none")
        except SimulationError:
            return

    return call


def _refused() -> Call:
    """An experiment whose path is out of reach."""
    experiment = load_experiment("slc_nephroid_known", _SHORT | {"path.offset": [9.0, 0.0, 0.0]})

    def call() -> None:
        try:
            check_experiment(experiment)
        except InvalidInputError:
            return

    return call


def _drawn(write: Callable[[Result, Path], object], name: str = "slc_nephroid_known") -> Call:
    """Write what is drawn of a result into one folder again and again."""
    result = simulate(load_experiment(name, _SHORT | {"duration": 0.1}))
    folder = TemporaryDirectory()

    def call(folder: TemporaryDirectory[str] = folder) -> None:
        write(result, Path(folder.name))

    return call


def _pictured() -> Call:
    arm = load_arm("panda")
    return _drawn(lambda _, folder: write_arm_picture(arm, arm.home, folder / "arm.png"))


def _swept() -> Call:
    experiment = load_experiment("slc_nephroid_known", _SHORT)
    return lambda: sweep(experiment, {"law.kappa": [3.0, 4.0]})


def _batched() -> Call:
    experiments = [load_experiment("slc_nephroid_known", _SHORT | {"seed": k}) for k in range(4)]
    return lambda: run_many(experiments)


def _tuned() -> Call:
    experiment = load_experiment("slc_nephroid_known", _SHORT | {"duration": 0.02})
    return lambda: tune(experiment, ["law.kappa"], "position_error_rms_m", steps=1)


def _session(name: str, act: Callable[[Session], object]) -> Call:
    session = Session(load_experiment(name))

    def call() -> None:
        act(session)
        session.advance()

    return call


def _switched(name: str) -> Call:
    session = Session(load_experiment(name))
    laws = cycle(session.controls()["law"].options)

    def call() -> None:
        session.set("law", next(laws))
        session.advance()

    return call


def _recorded(session: Session) -> None:
    """Record a slice and make a result of it."""
    session.set("record", True)
    session.advance()
    session.end_recording()


#: What is done again and again, by name; each is made in the process in which it is done.
TASKS: dict[str, Callable[[], Call]] = {
    "simulate": partial(_simulated, "slc_nephroid_known"),
    "simulate among obstacles": partial(_simulated, "adaptive_obstacles"),
    "simulate with motors and a contact": partial(_simulated, "contact_cat"),
    "simulate two arms": partial(_simulated, "adaptive_two_arms"),
    "simulate with an integrator": partial(_simulated, "slc_nephroid_continuous"),
    "simulate by name": partial(_loaded, "slc_nephroid_known"),
    "simulate arms with errors of their own": _of_arms,
    "simulate what is interrupted": _interrupted,
    "check what is out of reach": _refused,
    "build_diagram": lambda: partial(build_diagram, load_experiment("adaptive_obstacles", _SHORT)),
    "load_arm": lambda: partial(load_arm, "panda"),
    "sweep of two": _swept,
    "batch of four": _batched,
    "tune by one step": _tuned,
    "figures": partial(_drawn, write_figures),
    "playback": partial(_drawn, lambda result, folder: write_playback(result, folder / "p.html")),
    "export": partial(_drawn, export),
    "arm picture": _pictured,
    "law switch": partial(_switched, "slc_nephroid_known"),
    "law switch among obstacles": partial(_switched, "adaptive_moving_obstacle"),
    "reset": partial(_session, "slc_nephroid_known", lambda session: session.set("reset", None)),
    "recording": partial(_session, "slc_nephroid_known", _recorded),
}


def measure_growth(name: str, calls: int) -> tuple[str, ...]:
    """Return the row of a task."""
    left = growth(TASKS[name](), calls)
    kilobytes, objects = 1e3 * left.memory / calls, left.objects / calls
    told = f"{kilobytes:.0f}", f"{left.memory:.1f}", f"{objects:.1f}"
    return name, f"{calls}", *told, f"{left.files}", f"{left.time:.2g}"


def print_growth(names: list[str], calls: int) -> None:
    """Print what each call of some tasks leaves behind."""
    head("task", "calls", "kB a call", "MB in all", "objects a call", "files in all", "s a call")
    with get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for name in names:
            row(*pool.apply(measure_growth, (name, calls)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiment", nargs="?", default="slc_nephroid_known")
    parser.add_argument("--durations", type=float, nargs="+", default=[60.0, 300.0])
    parser.add_argument("--series", nargs="+", default=["full", "none"])
    parser.add_argument("--calls", type=int, help="measure what so many calls leave behind")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=list(TASKS))
    given = parser.parse_args()
    if given.calls is not None:
        print_growth(given.tasks, given.calls)
        return
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
