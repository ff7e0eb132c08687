"""Coming before other programs, where the system lets one, and before what Python does besides."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

#: Real-time priorities of the pacer, of whoever commands, and of a simulated robot; below the
#: kernel's own threads.
PACER, LAW_BESIDE, SIMULATED = 80, 40, 30

#: What a process was scheduled by: its policy and priority.
Scheduled = tuple[int, int]


def prioritize(priority: int) -> Scheduled | None:
    """Have this thread come before all ordinary ones; return what it was scheduled by.

    Args:
        priority: Real-time priority, 1 to 99.

    Returns:
        None if the system does not let it, see ``ulimit -r``.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return None
    return before


def restore(before: Scheduled | None) -> None:
    """Schedule this thread as before."""
    if before is not None:
        policy, priority = before
        os.sched_setscheduler(0, policy, os.sched_param(priority))


@contextmanager
def prioritized(priority: int) -> Iterator[None]:
    """Have this thread, and those that it starts, come before all ordinary ones; see `prioritize`.

    Threads that were started meanwhile keep the priority.
    """
    before = prioritize(priority)
    try:
        yield
    finally:
        restore(before)


@contextmanager
def without_collection() -> Iterator[None]:
    """Keep Python from collecting garbage, which may take longer than a cycle."""
    was_on = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_on:
            gc.enable()
