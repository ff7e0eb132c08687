"""Tables of commands: shown on a terminal, and written to the files that are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..measures import METRIC_NAMES
from ..runs.folder import require_output
from ..tables import Cell, Heading, Sheet, require_format, write_sheet
from .console import out


def require_tables(files: Sequence[Path] | None) -> None:
    """Raise an InvalidInputError unless all files of ``--table`` can be of a known format."""
    for file in files or []:
        require_format(file, "--table")
        require_output(file, "--table")


def write_tables(sheet: Sheet, files: Sequence[Path] | None) -> None:
    """Write a table to the files of ``--table``, and name them.

    Raises:
        InvalidInputError: If one cannot be written.
    """
    for file in files or []:
        write_sheet(sheet, file)
        out.print(escape(f"table    {file}"), soft_wrap=True)


def chosen_metrics(asked: str | None) -> list[str]:
    """Return the metrics of ``--metrics``; none if it is not given.

    Raises:
        InvalidInputError: If one of them is unknown or given twice.
    """
    if asked is None:
        return []
    names = listed(asked)
    for name in names:
        if name not in METRIC_NAMES:
            raise InvalidInputError(f"--metrics: no {name!r}; {nearest(name, list(METRIC_NAMES))}")
        if names.count(name) > 1:
            raise InvalidInputError(f"--metrics: {name} is given twice")
    return names


def listed(text: str) -> list[str]:
    """Return the words between commas."""
    return [word.strip() for word in text.split(",")]


def shown(sheet: Sheet) -> Table:
    """Return a table for the terminal: names, SI units, and bounds beside the numbers."""
    table = Table(
        box=SIMPLE_HEAD, title=escape(sheet.title) or None, caption=escape(sheet.note) or None
    )
    for column in sheet.columns:
        side: Literal["left", "right"] = "right" if column.right else "left"
        table.add_column(escape(str(column.heading)), overflow="fold", justify=side)
    for row in sheet.rows:
        table.add_row(*map(shown_cell, row))
    return table


def shown_cell(entry: Heading | Cell | str) -> str:
    """Return an entry as rich markup: in red what is outside its bound."""
    if not isinstance(entry, Cell):
        return escape(str(entry))
    if not entry.kept:
        told = f"(not {entry.bound})" if entry.bound else str(entry)
        before = f"{escape(str(entry))} " if entry.bound else ""
        return f"{before}[red]{escape(told)}[/]"
    return escape(f"{entry} ({entry.bound})" if entry.bound else str(entry))
