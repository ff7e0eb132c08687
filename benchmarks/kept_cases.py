"""The cases of a benchmark, side by side; what was found of each is kept, so that it can go on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

Found = dict[str, Any]


def cases(
    task: Callable[[Any], Any],
    seeds: Iterable[int],
    jobs: int,
    kept: Path | None = None,
    name: str = "",
    at_once: int = 0,
) -> list[Found]:
    """Return what a task finds of each seed, in order of the seeds.

    Args:
        task: The task, one that can be sent to another process.
        seeds: The seeds.
        jobs: Number of processes.
        kept: A file with a line for each case that was run; those are not run again.
        name: What tells the task from others of that file.
        at_once: How many seeds the task is given at a time, in a list, and finds a list of; 0 if
            it is given them one by one.
    """
    seeds = list(seeds)
    known = {} if kept is None or not kept.exists() else _known(kept, name)
    left, size = [seed for seed in seeds if seed not in known], max(at_once, 1)
    groups = [left[begin : begin + size] for begin in range(0, len(left), size)]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(task, each if at_once else each[0]): each for each in groups}
        for future in as_completed(running):
            group, found = running[future], future.result()
            new = dict(zip(group, found if at_once else [found], strict=True))
            known |= new
            if kept is not None:
                with kept.open("a") as file:
                    for seed, each in new.items():
                        line = {"name": name, "seed": seed, "found": each}
                        file.write(json.dumps(line) + "\n")
    return [known[seed] for seed in seeds]


def _known(kept: Path, name: str) -> dict[int, Found]:
    lines = map(json.loads, kept.read_text().splitlines())
    return {line["seed"]: line["found"] for line in lines if line["name"] == name}
