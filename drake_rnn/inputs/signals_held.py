"""Work that Ctrl-C does not interrupt."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

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


def uninterrupted(work: Callable[[], _T]) -> tuple[_T, bool]:
    """Do work that Ctrl-C does not interrupt.

    Returns:
        What the work returns, and whether a signal came meanwhile that would have interrupted it.
    """
    done: list[_T] = []
    try:
        with signals_held():
            done.append(work())
    except KeyboardInterrupt:
        if not done:
            raise
        return done[0], True
    return done[0], False
