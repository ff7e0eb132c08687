r"""A projected primal-dual network: from any state to the optimum of a quadratic program.

.. math::
    \delta \dot v = -v + P(-D^T y), \qquad \delta \dot y = R v - b

has its rest where v is least in norm under R v = b and its bounds, if D = R; P clips to the bounds.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array

# Radians of the fastest mode in a step of Runge and Kutta's fourth-order method, stable to 2.8.
_PER_STEP = 2.2


class PrimalDual(NamedTuple):
    """The network with all that it is fed held; n variables v, m multipliers y.

    Its state z is v and y in one vector, shape (n + m,).

    Attributes:
        drive: D, rows that move v, shape (m, n).
        rows: R, rows that v is to meet, shape (m, n).
        aims: b, shape (m,).
        lower, upper: Bounds of v, shape (n,).
        time_constant: delta [s].
    """

    drive: Array
    rows: Array
    aims: Array
    lower: Array
    upper: Array
    time_constant: float

    def rate(self, z: Array) -> Array:
        """Time derivative of the state."""
        drive, rows, aims, lower, upper, time_constant = self
        n = lower.size
        rate = np.empty(z.size)
        # np.clip costs three times as much for arrays of this size.
        np.minimum(np.maximum(-z[n:].dot(drive), lower), upper, out=rate[:n])
        rate[:n] -= z[:n]
        np.subtract(rows.dot(z[:n]), aims, out=rate[n:])
        rate /= time_constant
        return rate

    def after(self, z: Array, period: float) -> Array:
        """The state a period later, in as many substeps as keep Runge and Kutta's method stable."""
        # The largest row sum of R R^T bounds its largest eigenvalue, and that the fastest mode.
        square = float(np.abs(self.rows.dot(self.rows.T)).sum(axis=0).max())
        count = substeps(period, sqrt(square), self.time_constant)
        h, rate = period / count, self.rate
        for _ in range(count):
            k1 = rate(z)
            k2 = rate(z + h / 2 * k1)
            k3 = rate(z + h / 2 * k2)
            k4 = rate(z + h * k3)
            k2 += k3
            z = z + h / 6 * (k1 + 2 * k2 + k4)
        return z


def substeps(period: float, norm: float, time_constant: float) -> int:
    """How many a period takes, of a network whose rows have this norm."""
    fastest = max(1.0, norm) / time_constant
    return ceil(period * fastest / _PER_STEP - 1e-9)
