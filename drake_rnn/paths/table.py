"""Tables of points, times and orientations: given as lists, or read from a CSV file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..inputs.complaints import short
from ..inputs.csv_rows import Row, is_header, read_rows, require_few
from ..inputs.fields import Array
from ..inputs.numbers import decimal, is_number

#: Columns that a file of points may have: of positions [m], of times [s], of unit quaternions, and
#: of roll, pitch and yaw [rad].
POSITION, TIME = ("x", "y", "z"), ("t",)
QUATERNION, RPY = ("qw", "qx", "qy", "qz"), ("roll", "pitch", "yaw")
_GROUPS = (POSITION, TIME, QUATERNION, RPY)
_KNOWN = [name for group in _GROUPS for name in group]
_OTHER_NAMES = {"time": "t"}
#: Points of a path: a tenth of a millimetre apart, they make ten metres.
MOST_POINTS = 100_000
# Size of a file of so many rows with eight columns [bytes].
_MOST_BYTES = 25_000_000


@dataclass(frozen=True)
class Table:
    """Rows of numbers with named columns.

    Attributes:
        rows: Number of each row in its source, for messages.
        columns: Columns by name, each of shape (k,).
    """

    rows: Sequence[int]
    columns: Mapping[str, Array]

    def group(self, names: Sequence[str]) -> Array | None:
        """Return some columns, shape (k, len(names)); None if the table has none of them."""
        if names[0] not in self.columns:
            return None
        return np.column_stack([self.columns[name] for name in names])

    @classmethod
    def of_points(cls, points: Array) -> Table:
        """Return the table of points, shape (k, 3) [m], numbered from 1."""
        return cls(range(1, len(points) + 1), dict(zip(POSITION, points.T, strict=True)))

    @property
    def points(self) -> Array:
        """Positions, shape (k, 3) [m]."""
        return np.column_stack([self.columns[name] for name in POSITION])


def listed(value: Any) -> Array:
    """Return points that are given as a list of rows x, y, z, read-only, shape (k, 3) [m].

    Raises:
        ValueError: If the value is no such list; the message names row and column.
    """
    rows = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(rows, (list, tuple)):
        raise ValueError("must be a list of points [x, y, z]")
    require_few(len(rows), "points", MOST_POINTS)
    points = _table(POSITION, enumerate(rows, 1), _given).points
    points.setflags(write=False)
    return points


def read_table(file: str) -> Table:
    """Return the table in a CSV file.

    The first line may name the columns, in any order: x, y, z; t or time; qw, qx, qy, qz, or roll,
    pitch, yaw. Without such a line there are three columns x, y, z.

    Raises:
        ValueError: If it cannot be read; the message names file, row and column.
    """
    return read_rows(file, _MOST_BYTES, MOST_POINTS, _of_rows)


def _of_rows(rows: list[Row]) -> Table:
    if is_header(rows[0][1]):
        return _table(_header(*rows[0]), rows[1:], decimal)
    return _table(POSITION, rows, decimal)


def _header(row: int, cells: Sequence[str]) -> list[str]:
    """Return the names of the columns as this module calls them."""
    names = [_OTHER_NAMES.get(cell.lower(), cell.lower()) for cell in cells]
    for name, cell in zip(names, cells, strict=True):
        if name not in _KNOWN:
            raise ValueError(
                f"row {row}: no column may be called {cell!r}; separated by commas, they may be "
                "x, y, z; t or time; qw, qx, qy, qz; roll, pitch, yaw"
            )
        if names.count(name) > 1:
            raise ValueError(f"row {row}: column {name} is given twice")
    for group in _GROUPS:
        missing = [name for name in group if name not in names]
        if missing and (group is POSITION or len(missing) < len(group)):
            raise ValueError(f"row {row}: has no column {', '.join(missing)}")
    if {"qw", "roll"} <= set(names):
        raise ValueError(f"row {row}: has both quaternions and roll, pitch, yaw; give one of them")
    return names


def _table(
    names: Sequence[str], numbered: Iterable[tuple[int, Any]], number: Callable[[Any], float]
) -> Table:
    rows: list[int] = []
    table: list[list[float]] = []
    for row, cells in numbered:
        if not isinstance(cells, (list, tuple, np.ndarray)) or len(cells) != len(names):
            *some, last = names
            raise ValueError(
                f"row {row}: must be {len(names)} numbers, {', '.join(some)} and {last}"
            )
        rows.append(row)
        try:
            table.append([number(cell) for cell in cells])
        except (TypeError, ValueError):
            _refuse_first(cells, row, number)
    values = np.array(table).reshape(-1, len(names))
    return Table(rows, dict(zip(names, values.T, strict=True)))


def _refuse_first(cells: Iterable[Any], row: int, number: Callable[[Any], float]) -> None:
    """Raise a ValueError that names the first cell that is no number."""
    for column, cell in enumerate(cells, 1):
        try:
            number(cell)
        except (TypeError, ValueError):
            raise ValueError(
                f"row {row}, column {column}: {short(cell)} is not a finite number"
            ) from None


def _given(cell: Any) -> float:
    if not is_number(cell):
        raise ValueError
    return float(cell)
