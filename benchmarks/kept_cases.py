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
    task: Callable[[int], Found],
    seeds: Iterable[int],
    jobs: int,
    kept: Path | None = None,
    name: str = "",
) -> list[Found]:
    """Return what a task finds of each seed, in order of the seeds.

    Args:
        task: The task, one that can be sent to another process.
        seeds: The seeds.
        jobs: Number of processes.
        kept: A file with a line for each case that was run; those are not run again.
        name: What tells the task from others of that file.
    """
    seeds = list(seeds)
    known = {} if kept is None or not kept.exists() else _known(kept, name)
    left = [seed for seed in seeds if seed not in known]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(task, seed): seed for seed in left}
        for each in as_completed(running):
            seed = running[each]
            known[seed] = each.result()
            if kept is not None:
                with kept.open("a") as file:
                    file.write(
                        json.dumps({"name": name, "seed": seed, "found": known[seed]}) + "\n"
                    )
    return [known[seed] for seed in seeds]


def _known(kept: Path, name: str) -> dict[int, Found]:
    lines = map(json.loads, kept.read_text().splitlines())
    return {line["seed"]: line["found"] for line in lines if line["name"] == name}
