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
    """Collect Drake's warnings within a with-block instead of logging them.

    They are collected even where the program has silenced Drake's log.
    """
    log = logging.getLogger("drake")
    level, disabled = log.level, log.disabled
    told: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            told.append(record.getMessage())
        return record.levelno != logging.WARNING

    log.setLevel(min(log.getEffectiveLevel(), logging.WARNING))
    log.disabled = False
    log.addFilter(collect)
    try:
        yield told
    finally:
        log.removeFilter(collect)
        log.setLevel(level)
        log.disabled = disabled
