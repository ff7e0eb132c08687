r"""The program of `drake_rnn.laws.parts.box_program` with further rows, A v >= c.

Where a row keeps the arm from its task, what is left of the task's error is large, and at its price
even a joint speed of rad/s that lessens it by a tenth of a millimetre a second pays. So the price
is bounded there: the multipliers of the task, y = S^-1 (b - J v), are held to a largest size by a
softer S, as if the error had a price in proportion to itself, not to its square.

Rows come and go from sample to sample, and the velocity with them. So where any is in the way, a
change of the velocity has a price as well, a hundred times that of a preference.
"""

from __future__ import annotations

from functools import cache
from math import sqrt
from typing import NamedTuple

import daqp
import numpy as np

from ...arrays.algebra import clipped, solved
from ...inputs.fields import Array

# By how much a row may be short [rad/s]: rounding errors must not leave a program without solution.
_SLACK = 1e-7
# Price of a change of the velocity where rows are in the way, against that of one preferred.
_CALM = 100.0
# Largest size of the multipliers of a task that rows keep from being done [rad/s per m/s].
_DEAREST = 5.0


class Rows(NamedTuple):
    """Further bounds of the program, A v >= c.

    Attributes:
        A: Rows of length 1, shape (k, n).
        c: Their bounds, shape (k,) [rad/s].
    """

    A: Array
    c: Array

    def hold(self, v: Array) -> bool:
        """Return whether a velocity, shape (n,) [rad/s], is within these bounds."""
        return bool((self.A @ v >= self.c - _SLACK).all())


class Bounds(NamedTuple):
    """Bounds of the program, of velocities and, behind them, of rows.

    Attributes:
        A: The rows, shape (k, n).
        low: Lower bounds, shape (n + k,) [rad/s].
        high: Upper bounds, likewise.
    """

    A: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, lower: Array, upper: Array, rows: Rows) -> Bounds:
        """Return bounds of velocities, shape (n,) [rad/s] each, with those of rows."""
        low = np.concatenate((lower, rows.c - _SLACK))
        return cls(rows.A, low, np.concatenate((upper, np.full(len(rows.c), np.inf))))


def within_rows(
    v: Array,
    J: Array,
    b: Array,
    g: Array,
    softness: Array,
    lower: Array,
    upper: Array,
    rows: Rows,
) -> Array | None:
    """Return the velocity of the program for one robot, shape (n,) [rad/s]; None without one.

    For where the program without rows does not keep them.

    Args:
        v: The velocity until now, shape (n,) [rad/s].
        J: Jacobian, shape (m, n).
        b: Task velocity, shape (m,).
        g: Preferred joint velocities, shape (n,) [rad/s].
        softness: Matrix S, shape (m, m).
        lower: Lower bounds, shape (n,) [rad/s].
        upper: Upper bounds, likewise.
        rows: Further bounds.
    """
    bounds = Bounds.of(lower, upper, rows)
    if not len(b):
        # Without a task, what is preferred is all that is asked for: no change has a price.
        return cheapest(J, b, g, softness, bounds)
    # Preferred velocity and the one until now, at a price of one together.
    g, calm = (g + _CALM * v) / (1.0 + _CALM), (1.0 + _CALM) * softness
    found = cheapest(J, b, g, calm, bounds)
    if found is None:
        return None
    y = _weighed(softness, b - J @ found)
    size = sqrt(y.dot(y))
    return found if size <= _DEAREST else cheapest(J, b, g, calm * (size / _DEAREST), bounds)


def cheapest(J: Array, b: Array, g: Array, softness: Array, bounds: Bounds) -> Array | None:
    """Return the velocity of the program, shape (n,) [rad/s]; None without one.

    Args:
        J: Jacobian, shape (m, n).
        b: Task velocity, shape (m,).
        g: Preferred joint velocities, shape (n,) [rad/s].
        softness: Matrix S, shape (m, m).
        bounds: The bounds.
    """
    weighed = _weighed(softness, J)
    H, f = _identity(g.size) + J.T @ weighed, -g - weighed.T @ b
    v, _, flag, _ = daqp.solve(H, f, bounds.A, bounds.high, bounds.low)
    return clipped(v, bounds.low[: g.size], bounds.high[: g.size]) if flag > 0 else None


@cache
def _identity(size: int) -> Array:
    return np.eye(size)


def _weighed(softness: Array, x: Array) -> Array:
    """Return S^-1 x, of a matrix, shape (m, n), or a vector, shape (m,)."""
    # Mostly S is diagonal. LAPACK takes ten times as long for the same bits.
    if np.count_nonzero(softness) > len(softness):
        return np.asarray(solved(softness, x))
    rows = softness.diagonal()
    return np.asarray(x / rows if x.ndim == 1 else x * (1.0 / rows)[:, None])
