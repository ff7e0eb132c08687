"""Drake's log."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_drake(least: int) -> Iterator[None]:
    """Drake says nothing below the level ``least`` of `logging` while this lasts."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(level, least))
    try:
        yield
    finally:
        log.setLevel(level)
