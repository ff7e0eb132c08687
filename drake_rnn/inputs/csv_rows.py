"""CSV files that a user names: their rows, and errors that name file and row."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from io import StringIO
from typing import TypeVar

from .given_file import content_of

#: Number of a row in its file, and its cells without the spaces around them.
Row = tuple[int, list[str]]

T = TypeVar("T")


def read_rows(file: str, most_bytes: int, most_rows: int, parsed: Callable[[list[Row]], T]) -> T:
    """Return what a function makes of the rows of a CSV file that are not empty.

    Args:
        file: Name of the file.
        most_bytes: Size that it may have [bytes].
        most_rows: Number of rows that it may have below its header.
        parsed: Function of the rows, of which there is one or more; what it raises as a ValueError
            is told with the name of the file.

    Raises:
        ValueError: If the file cannot be read; the message names file, row and column.
    """
    try:
        text = content_of(file, most_bytes).decode("utf-8-sig")
        require_few(max(text.count("\n"), text.count("\r")) - 1, "rows", most_rows)
        reader = csv.reader(StringIO(text, newline=""))
        rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
        rows = [(row, cells) for row, cells in rows if any(cells)]
        if not rows:
            raise ValueError("is empty")
        return parsed(rows)
    except OSError as error:
        raise ValueError(f"file {file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"file {file}: is not a text file") from None
    except (ValueError, csv.Error) as error:
        raise ValueError(f"file {file}: {error}") from None


def require_few(count: int, what: str, most: int) -> None:
    """Raise a ValueError if there are more rows or points than anybody needs."""
    if count > most:
        share = math.ceil(count / most)
        raise ValueError(f"has {count} {what}, and may have {most}; keep one of {share} of them")


def is_header(cells: list[str]) -> bool:
    """Return whether no cell of a row is a number.

    NaN, infinity and what is no decimal are told of as numbers, not as names of columns.
    """
    return not any(map(_is_number, cells))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
