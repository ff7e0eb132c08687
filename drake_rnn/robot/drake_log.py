"""Control of Drake's log."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_drake(least: int) -> Iterator[None]:
    """Suppress Drake's messages below the `logging` level ``least`` within a with-block."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(level, least))
    try:
        yield
    finally:
        log.setLevel(level)
