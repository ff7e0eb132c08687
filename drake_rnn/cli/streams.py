"""The standard streams of a command, which may be full, closed or gone: its work goes on."""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO, cast

from .statuses import BAD_INPUT

_STDOUT, _STDERR = 1, 2


class _Output(io.FileIO):
    """A stream that drops what it cannot write.

    Args:
        number: Number of the stream.
        trouble: Why nothing can be written to it; empty if something can.

    Attributes:
        trouble: Why something could not be written; empty if all could.
    """

    def __init__(self, number: int, trouble: str) -> None:
        super().__init__(number, "w", closefd=False)
        self.trouble, self._closed_before = "", trouble

    def write(self, data: Any, /) -> int:
        """Write, or note why that cannot be."""
        self.trouble = self.trouble or self._closed_before
        if not self.trouble:
            try:
                return super().write(data) or 0
            except OSError as error:
                self.trouble = error.strerror or str(error)
        return memoryview(data).nbytes


class Streams:
    """The standard streams of this process, made safe to print to.

    Files that are opened later never take the number of a stream that was closed, to which
    libraries in other languages print.
    """

    def __init__(self) -> None:
        closed = {number for number in range(3) if not _is_open(number)}
        for _ in closed:
            # The system gives the lowest number that is free.
            os.open(os.devnull, os.O_RDWR)
        troubles = [os.strerror(9) if number in closed else "" for number in range(3)]
        self._out = _Output(_STDOUT, troubles[_STDOUT])
        sys.stdout = _text(self._out, sys.stdout)
        sys.stderr = _text(_Output(_STDERR, troubles[_STDERR]), sys.stderr)

    def status(self, status: int) -> int:
        """Say what could not be printed, and return the exit status of the command.

        Args:
            status: The status without that.
        """
        sys.stdout.flush()
        if not self._out.trouble:
            return status
        sys.stderr.write(f"error stdout: {self._out.trouble}; what was to be printed is lost\n")
        sys.stderr.flush()
        return status or BAD_INPUT


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _text(raw: _Output, before: TextIO | None) -> TextIO:
    """Return a stream of text like the one before, which is None if it was closed."""
    told = cast("io.TextIOWrapper | None", before)
    if told is not None:
        told.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if told is None else told.encoding,
        errors="replace" if told is None else told.errors,
        line_buffering=raw.fileno() == _STDERR or raw.isatty(),
    )
