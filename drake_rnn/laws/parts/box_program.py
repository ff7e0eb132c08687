r"""A velocity within a box that does a task as well as it can, found by block principal pivoting.

.. math::
    \min_v \tfrac12 |v - g|^2 + \tfrac12 (J v - b)^T S^{-1} (J v - b) \quad \text{s.t.} \quad
    \underline v \le v \le \overline v

with S positive definite and small: the task is soft, so there is always a solution, and its
multipliers y = S^-1 (b - J v) stay bounded where no velocity in the box does the task. With the
joints at their bounds known, y solves m equations, (S + J_F J_F^T) y = b - J v_0, where F are the
free joints and v_0 has g for these and the bounds for the others. Each joint then wants g + J^T y,
and who wants beyond the box is at its bound in the next round, while who is at a bound and wants
away from it is free.

Who changes sides when is said in `drake_rnn.arrays.pivoting` (Kim and Park, "Fast nonnegative
matrix factorization: an active-set-like method and comparisons", SIAM Journal on Scientific
Computing 33, 2011, describe the same for one-sided bounds). Mostly there is one round or two.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import pivoting
from ...arrays.algebra import (
    clipped,
    functions_of,
    is_one,
    matmul,
    matvec,
    solved_regular,
    transposed,
    vecmat,
)
from ...arrays.substeps import Parts, repeated
from ...inputs.fields import Array

# Rounds, of which a thousandth of all programs needs more than six. Of random programs whose box
# allows nothing like the task one in a thousand needs 50, and the worst of 12000 needed 121.
_ROUNDS = 200
# What is compiled makes all of its rounds, each time.
_ROUNDS_COMPILED = 60


def wanted(J: Array, b: Array, g: Array, softness: Array) -> Array:
    """Return the velocity of the program without a box, shape (..., n) [rad/s].

    Args:
        J: Jacobian, shape (..., m, n).
        b: Task velocity, shape (..., m).
        g: Preferred joint velocities, shape (..., n) [rad/s].
        softness: Matrix S, shape (..., m, m).
    """
    y = solved_regular(matmul(J, transposed(J)) + softness, b - matvec(J, g))
    return g + vecmat(y, J)


def within_box(J: Array, b: Array, g: Array, softness: Array, lower: Array, upper: Array) -> Array:
    """Return the velocity of the program, shape (..., n) [rad/s].

    Args:
        J: Jacobian, shape (..., m, n).
        b: Task velocity, shape (..., m).
        g: Preferred joint velocities, shape (..., n) [rad/s].
        softness: Matrix S, shape (..., m, m).
        lower: Lower bounds, shape (..., n) [rad/s].
        upper: Upper bounds, likewise.
    """
    v = wanted(J, b, g, softness)
    if is_one(v):
        return _of_one(v, J, b, g, softness, lower, upper)
    program = (J, b, g, softness, lower, upper)
    if isinstance(v, np.ndarray):
        return _of_many(v, program)
    xp = functions_of(v)
    found = repeated(
        lambda parts: _round(xp, program, parts), _start(xp, v, lower, upper), _ROUNDS_COMPILED
    )
    return clipped(found[3], lower, upper)


def _start(xp: Any, v: Array, lower: Array, upper: Array) -> Parts:
    """Return sides, fewest wrong so far, patience, what is wanted, and who is done, at first."""
    shape = np.broadcast_shapes(v.shape, lower.shape)
    v = xp.broadcast_to(v, shape)
    sides = 1.0 * (v > upper) - 1.0 * (v < lower)
    return sides, *pivoting.first(sides), v, xp.abs(sides).max(axis=-1, keepdims=True) == 0.0


def _round(xp: Any, program: Parts, parts: Parts) -> Parts:
    """Return the parts of `_start` one round later."""
    J, b, g, softness, lower, upper = program
    sides, fewest, patience, _, _ = parts
    base = xp.where(sides < 0.0, lower, xp.where(sides > 0.0, upper, g))
    free = 1.0 * (sides == 0.0)
    system = matmul(J * free[..., None, :], transposed(J)) + softness
    v = g + vecmat(solved_regular(system, b - matvec(J, base)), J)
    # A joint at a bound that wants away from it is free in the next round, wherever it wants to.
    at_bound = xp.where(sides < 0.0, -1.0 * (v <= lower), 1.0 * (v >= upper))
    ought = xp.where(sides == 0.0, 1.0 * (v > upper) - 1.0 * (v < lower), at_bound)
    *next_ones, done = pivoting.turned(sides, ought, fewest, patience)
    return *next_ones, v, done


def _of_many(v: Array, program: Parts) -> Array:
    """Return the velocities of many robots in NumPy, of which few need many rounds."""
    lower, upper = program[4], program[5]
    parts = _start(np, v, lower, upper)
    found = parts[3].reshape(-1, v.shape[-1]).copy()
    lead = parts[3].shape[:-1]
    rows = [
        np.broadcast_to(given, lead + given.shape[given.ndim - axes :]).reshape(
            -1, *given.shape[given.ndim - axes :]
        )
        for given, axes in zip(program, (2, 1, 1, 2, 1, 1), strict=True)
    ]
    parts = tuple(part.reshape(-1, part.shape[-1]) for part in parts)
    numbers = np.arange(len(found))
    for _ in range(_ROUNDS):
        going = ~parts[4][:, 0]
        if not going.all():
            numbers, rows = numbers[going], [given[going] for given in rows]
            parts = tuple(part[going] for part in parts)
        if not numbers.size:
            break
        parts = _round(np, tuple(rows), parts)
        found[numbers] = parts[3]
    return clipped(found.reshape(*lead, -1), lower, upper)


def _of_one(
    v: Array, J: Array, b: Array, g: Array, softness: Array, lower: Array, upper: Array
) -> Array:
    """Return the velocity of one robot in NumPy, from the one without a box.

    Its joints change sides as in `pivoting.turned`, in plain numbers: a third of the time.
    """
    ends = list(zip(lower.tolist(), upper.tolist(), strict=True))
    none = [0] * len(ends)
    sides = _sides(none, v, ends)
    if sides == none:
        return v
    preferred, fewest, patience = g.tolist(), len(ends) + 1, pivoting.PATIENCE
    for _ in range(_ROUNDS):
        free = np.array([side == 0 for side in sides], dtype=float)
        held = zip(sides, ends, preferred, strict=True)
        base = np.array([end[side > 0] if side else middle for side, end, middle in held])
        y = solved_regular((J * free).dot(J.T) + softness, b - J.dot(base))
        v = g + y.dot(J)
        new = _sides(sides, v, ends)
        wrong = [k for k, (one, other) in enumerate(zip(sides, new, strict=True)) if one != other]
        if not wrong:
            break
        if len(wrong) < fewest:
            sides, fewest, patience = new, len(wrong), pivoting.PATIENCE
        elif patience > 0.0:
            sides, patience = new, patience - 1.0
        else:
            sides[wrong[-1]] = new[wrong[-1]]
    return clipped(v, lower, upper)


def _sides(sides: list[int], v: Array, ends: list[tuple[float, float]]) -> list[int]:
    """Return which bound each joint wants to be at, -1 or 1, or 0, free, given where it is."""
    new = []
    for side, wants, (lower, upper) in zip(sides, v.tolist(), ends, strict=True):
        below = wants < lower if side == 0 else side < 0 and wants <= lower
        above = wants > upper if side == 0 else side > 0 and wants >= upper
        new.append(-1 if below else 1 if above else 0)
    return new
