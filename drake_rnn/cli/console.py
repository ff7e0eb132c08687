"""What every command prints to, and how it ends."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from ..errors import DrakeRnnError, InterruptedRunError, RobotError, SimulationError
from ..inputs.messages import printable
from .starting import (
    BAD_INPUT,
    FAILED,
    INTERRUPTED,
    NOT_MET,
)


class SafeConsole(Console):
    """A console to which no name or text of a file sends commands, such as to clear the screen."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """See `Console.render`; styles are added to segments later."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)


# Width of tables in a pipe or a file [characters].
_WIDTH = None if sys.stdout.isatty() else 140
# Without emoji: of a user's text such as a:b:c, a part is none.
out = SafeConsole(width=_WIDTH, soft_wrap=False, highlight=False, emoji=False)
# A terminal gets lines that are broken between words, a pipe whole ones.
err = SafeConsole(stderr=True, soft_wrap=not sys.stderr.isatty(), highlight=False, emoji=False)

#: Width of a console on which no table is squeezed [characters].
WIDE = 10_000


# What Drake says of a half-space among rigid bodies, where nothing is deformable.
_IDLE = "half spaces are not currently supported for deformable contact"


class _DrakeLines(logging.Handler):
    """Prints Drake's warnings as lines of ours, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._printed: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = " ".join(record.getMessage().split())
        if _IDLE not in text and text not in self._printed:
            self._printed.add(text)
            err.print(f"[yellow]warning[/] Drake: {escape(text)}")


@contextmanager
def _drake_lines() -> Iterator[None]:
    """Print what Drake logs within a with-block, where Python would print names of its log."""
    log = logging.getLogger("drake")
    if any(isinstance(handler, _DrakeLines) for handler in log.handlers):
        yield
        return
    handlers, propagates = log.handlers, log.propagate
    log.handlers, log.propagate = [_DrakeLines()], False
    try:
        yield
    finally:
        log.handlers, log.propagate = handlers, propagates


@contextmanager
def errors() -> Iterator[None]:
    """Turn this package's errors into a message and an exit status, without a traceback.

    Drake's warnings become lines of ours.
    """
    try:
        with _drake_lines():
            yield
    except InterruptedRunError as error:
        err.print(escape(str(error)))
        raise typer.Exit(INTERRUPTED) from error
    except (SimulationError, RobotError) as error:
        err.print(f"[red]failed[/] {escape(str(error))}")
        raise typer.Exit(FAILED) from error
    except (DrakeRnnError, OSError) as error:
        err.print(f"[red]error[/] {escape(sentence_of(error))}")
        raise typer.Exit(BAD_INPUT) from error


def sentence_of(error: Exception) -> str:
    """Return the sentence of an error: of one of the system, the file and what is wrong with it."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


@contextmanager
def silence(quiet: bool) -> Iterator[None]:
    """Print only warnings and errors, if that is asked for."""
    before, out.quiet = out.quiet, quiet
    try:
        yield
    finally:
        out.quiet = before


@contextmanager
def status(text: str) -> Iterator[None]:
    """Show on a terminal what takes its time; nothing elsewhere."""
    if not err.is_terminal or out.quiet:
        yield
        return
    with err.status(escape(text)):
        yield


def print_table(table: Table) -> None:
    """Print a table; in a pipe or a file without blanks at the ends of lines."""
    _print_trimmed(table, out.width)


def print_whole(table: Table) -> None:
    """Print a table; in a pipe or a file, where there is room for all columns, unsqueezed."""
    _print_trimmed(table, WIDE)


def _print_trimmed(table: Table, width: int) -> None:
    if out.is_terminal:
        out.print(table)
        return
    # Drawn beside `out`, which may be captured: Rich's captures cannot be nested.
    buffer = StringIO()
    Console(width=width, highlight=False, emoji=False, file=buffer).print(table)
    lines = (line.rstrip() for line in buffer.getvalue().splitlines())
    out.print(Text("\n".join(lines)), soft_wrap=True)


def finish(complete: bool, success: bool) -> None:
    """Leave the command with the status that fits, unless all is well.

    Args:
        complete: Whether everything came to its end.
        success: Whether all bounds that were to be checked are kept.
    """
    if not complete:
        raise typer.Exit(FAILED)
    if not success:
        raise typer.Exit(NOT_MET)
