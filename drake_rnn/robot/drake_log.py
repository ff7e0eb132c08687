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


@contextmanager
def drake_warnings() -> Iterator[list[str]]:
    """Collect Drake's warnings within a with-block instead of logging them."""
    log = logging.getLogger("drake")
    told: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            told.append(record.getMessage())
        return record.levelno != logging.WARNING

    log.addFilter(collect)
    try:
        yield told
    finally:
        log.removeFilter(collect)
