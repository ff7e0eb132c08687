"""Processes that end with the one that they work for, and work that Ctrl-C does not interrupt.

This imports little, so that a process is told what to do about Ctrl-C before it imports its task.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from threading import Thread
from typing import TypeVar


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


_T = TypeVar("_T")


@contextmanager
def signals_held() -> Iterator[None]:
    """Delay SIGINT and SIGTERM until the block has ended.

    Outside the main thread this has no effect, because Python handles signals in the main thread
    only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {
        number: handler
        for number in (signal.SIGINT, signal.SIGTERM)
        # A handler that was not installed from Python could not be restored.
        if (handler := signal.getsignal(number)) is not None
    }
    for number in handlers:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def run_uninterrupted(work: Callable[[], _T]) -> tuple[_T, bool]:
    """Do work that Ctrl-C does not interrupt.

    Returns:
        What the work returns, and whether a signal came meanwhile that would have interrupted it.
    """
    results: list[_T] = []
    try:
        with signals_held():
            results.append(work())
    except KeyboardInterrupt:
        if not results:
            raise
        return results[0], True
    return results[0], False
