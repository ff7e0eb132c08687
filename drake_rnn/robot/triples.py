"""Vectors of three coordinates, each a number or an array with an entry for each robot.

The coordinates of an arm at rest are mostly 0 and 1. What is exactly 0 or 1 as a number costs no
arithmetic, which leaves every sum its bits. JAX's compiler makes short loops of coordinates that
are apart, and computes what several of them need several times over, which does little harm as
long as most are 0 or 1: see `dot`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays.namespace import AnyArray, robots_first

Triple = tuple[Any, Any, Any]
#: Columns.
Matrix = tuple[Triple, Triple, Triple]

ZERO: Triple = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def constant(vector: AnyArray) -> Triple:
    """Return the coordinates of a constant vector, shape (3, ...); numbers where robots agree."""
    x, y, z = (_number(coordinate) for coordinate in vector)
    return x, y, z


def _number(coordinate: AnyArray) -> Any:
    if not isinstance(coordinate, (float, np.ndarray)) or not np.size(coordinate):
        return coordinate
    first = float(np.ravel(coordinate)[0])
    return first if np.all(coordinate == first) else coordinate


def constant_matrix(array: AnyArray) -> Matrix:
    """Return the entries of a constant matrix, shape (3, 3, ...)."""
    x, y, z = (constant(column) for column in array.swapaxes(0, 1))
    return x, y, z


def times(a: Any, b: Any) -> Any:
    """Return the product of two coordinates."""
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    if isinstance(b, float) and b in (0.0, 1.0):
        return a if b else 0.0
    return a * b


def plus(a: Any, b: Any) -> Any:
    """Return the sum of two coordinates."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Any, b: Any) -> Any:
    """Return the difference of two coordinates."""
    if isinstance(b, float) and b == 0.0:
        return a
    return -b if isinstance(a, float) and a == 0.0 else a - b


def added(a: Triple, b: Triple) -> Triple:
    """Return the sum of two vectors."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtracted(a: Triple, b: Triple) -> Triple:
    """Return the difference of two vectors."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scaled(factor: Any, a: Triple) -> Triple:
    """Return a vector times a number."""
    return times(factor, a[0]), times(factor, a[1]), times(factor, a[2])


def cross(a: Triple, b: Triple) -> Triple:
    """Return the cross product of two vectors."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


def product(R: Matrix, a: Triple) -> Triple:
    """Return a matrix times a vector."""
    x, y, z = R
    return added(added(scaled(a[0], x), scaled(a[1], y)), scaled(a[2], z))


def is_full(columns: Matrix) -> bool:
    """Return whether no entry of a constant matrix is exactly 0 for all robots."""
    return not any(isinstance(c, float) and c == 0.0 for column in columns for c in column)


def dot(
    xp: Any, R: Sequence[Triple], columns: Sequence[Triple], robots: tuple[int, ...]
) -> list[Triple]:
    """Return a matrix times vectors, for JAX: its compiler computes a matrix product only once.

    In NumPy the sums of a matrix product might depend on the number of robots.
    """
    A, B = (robots_first(matrix(xp, list(zip(*m, strict=True)), robots), 2) for m in (R, columns))
    AB = A @ B
    return [(AB[..., 0, k], AB[..., 1, k], AB[..., 2, k]) for k in range(len(columns))]


def matrix(xp: Any, rows: Sequence[Sequence[Any]], robots: tuple[int, ...]) -> AnyArray:
    """Return a matrix of coordinates as an array with robots last, shape (rows, columns, ...)."""
    if xp is np:
        filled = np.empty((len(rows), len(rows[0]), *robots))
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                filled[i, j] = entry
        return filled
    # Rows of their own: XLA then computes only those that are used.
    return xp.stack([xp.stack([xp.broadcast_to(entry, robots) for entry in row]) for row in rows])
