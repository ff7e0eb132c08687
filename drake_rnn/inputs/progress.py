"""What is told of work that takes its time."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

# Time after which work is told of [s].
_LONG = 1.0


@contextmanager
def telling(text: str) -> Iterator[None]:
    """Write a line to standard error if the block takes longer than a second, and one at its end.

    Args:
        text: What is done.
    """
    begin, is_told = time.perf_counter(), threading.Event()

    def tell() -> None:
        is_told.set()
        _write(f"{text} ...")

    timer = threading.Timer(_LONG, tell)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
    if is_told.is_set():
        _write(f"{text}: {time.perf_counter() - begin:.1f} s")


def _write(line: str) -> None:
    # A program without a terminal may have none.
    if sys.stderr is not None:
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()
