"""Processes that work for another one, and end with it.

This imports little, so that a process is told what to do about Ctrl-C before it imports its task.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from threading import Thread


@contextmanager
def deaf_children() -> Iterator[None]:
    """Let processes that are started within not hear Ctrl-C before `begin`.

    In a terminal it reaches all processes, also those that have hardly been started. This process
    hears it when the block has ended.
    """
    # The first process starts the tracker, which would end the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin(lifeline: Connection, began: Event, deaf: bool) -> None:
    """Prepare a process that was started within `deaf_children` for its tasks.

    Args:
        lifeline: End of a pipe; the process ends when the other end is closed, also by the end of
            the process that holds it.
        began: Set here, so that the other process knows of one that has come so far.
        deaf: Whether Ctrl-C does nothing; otherwise it ends the process, unless a task says better.
    """
    began.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN if deaf else signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    try:
        lifeline.recv()
    except (EOFError, OSError):
        os._exit(1)
