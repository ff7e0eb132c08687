"""What is told of work that takes its time."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# Time after which work is told of, and between two lines where there is no terminal [s].
_LONG, _BETWEEN = 1.0, 10.0


@contextmanager
def telling(text: str) -> Iterator[Callable[[str], None]]:
    """Tell on standard error of a block that takes longer than a second, and how long it took.

    Yields:
        What is called with how far the block has come, in words. A terminal shows it; elsewhere it
        is a line every ten seconds.

    Args:
        text: What is done.
    """
    begin, is_told = time.perf_counter(), threading.Event()
    last = begin

    def tell() -> None:
        is_told.set()
        _write(f"{text} ...\n")

    def tell_progress(words: str) -> None:
        nonlocal last
        if not is_told.is_set() or sys.stderr is None:
            return
        if sys.stderr.isatty():
            _write(f"\r\033[K{text}: {words}")
        elif (now := time.perf_counter()) - last > _BETWEEN:
            last = now
            _write(f"{text}: {words}\n")

    timer = threading.Timer(_LONG, tell)
    timer.daemon = True
    timer.start()
    try:
        yield tell_progress
    finally:
        timer.cancel()
    if is_told.is_set():
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        line = f"{text}: {time.perf_counter() - begin:.1f} s\n"
        _write(f"\r\033[K{line}" if is_terminal else line)


def _write(text: str) -> None:
    # A program without a terminal may have none.
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()
