"""Multipliers that do not wind up.

A primal-dual network adds up the error of its constraints in the multipliers. Where the bounds
allow no v that fulfils them, the multipliers grow for as long as that lasts, and it takes them as
long, or longer, to come back once it is over. A bound on their norm ends that. Below the bound
nothing changes, and the norm does not depend on the frame of the task.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from ...arrays.algebra import dot, functions_of, vecmat
from ...inputs.fields import Array


def within(multipliers: Array, limit: Any, rows: Array | None = None) -> Array:
    """Return the multipliers, shape (..., m), scaled down to a norm of at most ``limit``.

    Args:
        multipliers: Multipliers y, shape (..., m).
        limit: Largest norm.
        rows: Matrix A if the norm is that of A^T y, shape (..., m, k); None for y itself.
    """
    sized = multipliers if rows is None else vecmat(multipliers, rows)
    square = dot(sized, sized)
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
    sized, grows = multipliers, rate
    if rows is not None:
        sized, grows = vecmat(multipliers, rows), vecmat(rate, rows)
    square, outward = dot(sized, sized), dot(sized, grows)
    if isinstance(square, float):
        if square < limit * limit or outward <= 0.0:
            return rate
        return rate - multipliers * (outward / square)
    xp = functions_of(rate)
    free = (square < limit * limit) | (outward <= 0.0)
    return xp.where(free, rate, rate - multipliers * (outward / xp.where(free, 1.0, square)))
