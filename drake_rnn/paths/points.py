"""A smooth closed curve through points that are given or read from a CSV file."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array, validated
from .curve import TURN, Curve, Triple


def _number(cell: Any, row: int, column: int) -> float:
    try:
        number = float(cell)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"row {row}, column {column}: {cell!r} is not a finite number")
    return number


def _closed(numbered: Iterable[tuple[int, Sequence[Any]]]) -> Array:
    """Return the points in numbered rows of cells, read-only, with the first repeated as the last.

    Args:
        numbered: Number of each row, for messages, and its three cells x, y and z [m].
    """
    rows: list[int] = []
    table: list[list[float]] = []
    for row, cells in numbered:
        if not isinstance(cells, (list, tuple, np.ndarray)) or len(cells) != 3:
            raise ValueError(f"row {row}: must be 3 numbers, x, y and z")
        rows.append(row)
        table.append([_number(cell, row, column) for column, cell in enumerate(cells, 1)])
    points = np.array(table).reshape(-1, 3)
    same = 1e-9 * np.ptp(points, axis=0).max() if table else 0.0
    repeated = np.linalg.norm(np.diff(points, axis=0), axis=1) <= same
    if repeated.any():
        raise ValueError(f"row {rows[int(repeated.argmax()) + 1]}: repeats the point before it")
    if table and np.linalg.norm(points[-1] - points[0]) <= same:
        points = points[:-1]
    distinct = len(np.unique(points, axis=0))
    if distinct < 4:
        raise ValueError(f"a closed curve needs at least 4 distinct points, not {distinct}")
    points = np.vstack([points, points[:1]])
    points.setflags(write=False)
    return points


def _listed(value: Any) -> Array:
    rows = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(rows, (list, tuple)):
        raise ValueError("must be a list of points [x, y, z]")
    return _closed(enumerate(rows, 1))


def _read(file: str) -> Array:
    try:
        with open(file, newline="", encoding="utf-8-sig") as lines:
            reader = csv.reader(lines)
            return _closed((reader.line_num, cells) for cells in reader if cells)
    except OSError as error:
        raise ValueError(f"file {file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"file {file}: is not a text file") from None
    except (ValueError, csv.Error) as error:
        raise ValueError(f"file {file}: {error}") from None


@validated
class Points(Curve):
    """A smooth closed curve through given points: a periodic cubic spline over the chord length.

    Args:
        file: CSV file of three columns x, y, z without a header [m]; give this or ``points``.
        points: Rows x, y, z in the base frame, shape (k, 3) [m]; at least 4 distinct points. The
            first may be repeated as the last.
        absolute: Whether the points stay where they are; otherwise the curve is moved so that the
            first point is at the arm's start, apart from ``offset``.
    """

    kind: Literal["points"] = "points"
    file: str | None = None
    points: Annotated[Array, BeforeValidator(_listed)] | None = None
    absolute: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.points is None):
            raise ValueError("give either a file or points")
        if self.absolute and self.offset.any():
            raise ValueError(
                "offset: cannot be combined with absolute, which also sets where the path starts; "
                "give one of them"
            )
        self._table  # noqa: B018 (a bad file is refused now, not during a run)

    @property
    def has_place(self) -> bool:
        """Whether the points stay where they are."""
        return self.absolute

    @cached_property
    def _table(self) -> Array:
        """The points, with the first repeated as the last, shape (k + 1, 3) [m]."""
        return _read(self.file) if self.file is not None else np.asarray(self.points)

    @cached_property
    def _spline(self) -> tuple[list[float], list[list[list[float]]]]:
        """Phases at the points, and the coefficients of x, y and z between them."""
        way = np.cumsum([0.0, *np.linalg.norm(np.diff(self._table, axis=0), axis=1)])
        phase = TURN * way / way[-1]
        displacement = (self._table - self._table[0]).T
        spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            breaks=phase, samples=displacement, periodic_end_condition=True
        )
        slope = spline.MakeDerivative(1).vector_values(phase)
        second = spline.MakeDerivative(2).vector_values(phase)
        third = np.diff(second) / np.diff(phase)
        orders = displacement[:, :-1], slope[:, :-1], second[:, :-1] / 2, third / 6
        return phase.tolist(), np.stack(orders, axis=-1).swapaxes(0, 1).tolist()

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """See `Curve.trace`."""
        phases, coefficients = self._spline
        piece = min(bisect_right(phases, phase), len(coefficients)) - 1
        u = phase - phases[piece]
        p, dp, ddp = zip(
            *[
                (a + u * (b + u * (c + u * d)), b + u * (2 * c + 3 * u * d), 2 * c + 6 * u * d)
                for a, b, c, d in coefficients[piece]
            ],
            strict=True,
        )
        return p, dp, ddp

    def start_point(self, p_WE: Array) -> Array:
        """See `RelativePath.start_point`; with ``absolute`` it is the first of the points."""
        return self._table[0].copy() if self.absolute else super().start_point(p_WE)
