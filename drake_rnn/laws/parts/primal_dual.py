r"""A projected primal-dual network, which converges to the optimum of a quadratic program.

.. math::
    \delta \dot v = -v + P(g - D^T y), \qquad \delta \dot y = R v - b

where P clips to the bounds of v. If D = R, its equilibrium is the v nearest to g with R v = b that
lies within the bounds; the one of least norm if g is left out.

Multipliers that do not wind up.

A primal-dual network adds up the error of its constraints in the multipliers. Where the bounds
allow no v that fulfils them, the multipliers grow for as long as that lasts, and it takes them as
long, or longer, to come back once it is over. A bound on their norm ends that. Below the bound
nothing changes, and the norm does not depend on the frame of the task.

How many Euler or Heun steps keep a network stable for a period, and whether they can be made.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import (
    Parts,
    clip,
    dot,
    functions_of,
    in_steps,
    is_one,
    join,
    larger,
    matmul,
    matvec,
    rounded_up,
    square_sum,
    transpose,
    vecmat,
)
from ...errors import InvalidInputError
from ...inputs.fields import Array

# Angle of the fastest mode per step [rad]; the fourth-order Runge-Kutta method is stable up to 2.8.
_PER_STEP = 2.2


class PrimalDual(NamedTuple):
    """The network with its inputs held, of n variables v and m multipliers y.

    Its state z is v and y in one vector, shape (..., n + m).

    Attributes:
        drive: Matrix D, by which the multipliers drive v, shape (..., m, n).
        rows: Matrix R of the constraints, shape (..., m, n).
        aims: Right-hand side b of the constraints, shape (..., m).
        lower, upper: Bounds of v, shape (..., n).
        time_constant: Time constant delta [s].
        preferred: Preferred value g of v, shape (..., n); None for zero.
    """

    drive: Array
    rows: Array
    aims: Array
    lower: Array
    upper: Array
    time_constant: Any
    preferred: Array | None = None

    def rate(self, z: Array) -> Array:
        """Return the time derivative of the state, shape (..., n + m)."""
        if not is_one(z):
            return self._rate(z)
        drive, rows, aims, lower, upper, time_constant, preference = self
        n = lower.size
        rate = np.empty(z.size)
        # np.clip costs three times as much for arrays of this size.
        sought = -z[n:].dot(drive)
        if preference is not None:
            sought += preference
        np.minimum(np.maximum(sought, lower), upper, out=rate[:n])
        rate[:n] -= z[:n]
        np.subtract(rows.dot(z[:n]), aims, out=rate[n:])
        rate /= time_constant
        return rate

    def after(self, z: Array, period: float) -> Array:
        """Return the state a period [s] later, by Runge-Kutta substeps that are stable."""
        rate = self.rate

        def advance(parts: Parts, k: Any, h: Any) -> Parts:
            (z,) = parts
            k1 = rate(z)
            k2 = rate(z + h / 2 * k1)
            k3 = rate(z + h / 2 * k2)
            k4 = rate(z + h * k3)
            k2 += k3
            return (z + h / 6 * (k1 + 2 * k2 + k4),)

        count = substeps(period, self._norm(is_one(z)), self.time_constant)
        (z,) = in_steps(advance, (z,), period, count)
        return z

    def _rate(self, z: Array) -> Array:
        """Return what `rate` does, of many robots."""
        n = self.lower.shape[-1]
        v, y = z[..., :n], z[..., n:]
        sought = -vecmat(y, self.drive)
        if self.preferred is not None:
            sought = sought + self.preferred
        target = clip(sought, self.lower, self.upper)
        return join((target - v, matvec(self.rows, v) - self.aims)) / self.time_constant

    def _norm(self, of_one: bool) -> Any:
        """Return a bound on the norm of R, a float or of shape (..., 1)."""
        # The largest row sum of R R^T bounds its largest eigenvalue, which sets the fastest mode.
        if of_one:
            return sqrt(float(np.abs(self.rows.dot(self.rows.T)).sum(axis=0).max()))
        gram = matmul(self.rows, transpose(self.rows))
        xp = functions_of(gram)
        sums = vecmat(xp.ones(gram.shape[:-1]), xp.abs(gram))
        return xp.sqrt(sums.max(axis=-1, keepdims=True))


def substeps(period: float, norm: Any, time_constant: Any) -> Any:
    """Return the number of stable substeps in a period: an int, or one for each of many robots.

    Args:
        period: Sampling period [s].
        norm: Norm of the matrix R.
        time_constant: Time constant delta [s].
    """
    fastest = larger(1.0, norm) / time_constant
    return rounded_up(period * fastest / _PER_STEP)


def within(multipliers: Array, limit: Any, rows: Array | None = None) -> Array:
    """Return the multipliers, shape (..., m), scaled down to a norm of at most ``limit``.

    Args:
        multipliers: Multipliers y, shape (..., m).
        limit: Largest norm.
        rows: Matrix A if the norm is that of A^T y, shape (..., m, k); None for y itself.
    """
    weighted_sum = multipliers if rows is None else vecmat(multipliers, rows)
    square = dot(weighted_sum, weighted_sum)
    if isinstance(square, float):
        return multipliers if square <= limit * limit else multipliers * (limit / sqrt(square))
    inside = square <= limit * limit
    xp = functions_of(multipliers)
    # No derivative of the root at 0.
    return xp.where(
        inside, multipliers, multipliers * (limit / xp.sqrt(xp.where(inside, 1.0, square)))
    )


def not_outward(rate: Array, multipliers: Array, limit: Any, rows: Array | None = None) -> Array:
    """Return the multipliers' rate, shape (..., m), without what increases a norm at its limit.

    Args:
        rate: Rate of the multipliers, shape (..., m).
        multipliers: Multipliers y, shape (..., m).
        limit: Largest norm.
        rows: As for `within`.
    """
    sizes, grows = multipliers, rate
    if rows is not None:
        sizes, grows = vecmat(multipliers, rows), vecmat(rate, rows)
    square, outward = dot(sizes, sizes), dot(sizes, grows)
    if isinstance(square, float):
        if square < limit * limit or outward <= 0.0:
            return rate
        return rate - multipliers * (outward / square)
    xp = functions_of(rate)
    free = (square < limit * limit) | (outward <= 0.0)
    return xp.where(free, rate, rate - multipliers * (outward / xp.where(free, 1.0, square)))


#: Steps that a sample may take; at some 10 us each, a tenth of a second.
MOST_SUBSTEPS = 10_000


def check_substeps(count: float, text: str, most: int = MOST_SUBSTEPS) -> None:
    """Raise an InvalidInputError if a network is too fast for the sampling period.

    Args:
        count: Number of stable steps in a period.
        text: What it follows from, for the message: key and value.
        most: Number of steps that are allowed.
    """
    if count > most:
        raise InvalidInputError(
            f"law.{text}: the network would need about {count:.3g} substeps per period; it may "
            f"take at most {most}"
        )


def stable_steps(turns: Any, J: Array) -> Any:
    """Return the number of steps in a period: an int, or one for each of many robots.

    Args:
        turns: Period, in time constants of the network.
        J: Jacobian of its constraints, shape (..., m, n); where its norm exceeds 1, it makes the
            network faster.
    """
    if type(J) is np.ndarray and J.ndim == 2:
        # The same for one robot, without the calls.
        entries = J.ravel()
        return max(1, ceil(turns * max(1.0, entries.dot(entries)) - 1e-9))
    return rounded_up(turns * larger(1.0, square_sum(J)))
