r"""Quadratic programs of laws: as data, with bounds alone, and with further rows.

A velocity within a box that does a task as well as it can, found by block principal pivoting.

.. math::
    \min_v \tfrac12 |v - g|^2 + \tfrac12 (J v - b)^T S^{-1} (J v - b) \quad \text{s.t.} \quad
    \underline v \le v \le \overline v

with S positive definite and small: the task is soft, so there is always a solution, and its
multipliers y = S^-1 (b - J v) stay bounded where no velocity in the box does the task. With the
joints at their bounds known, y solves m equations, (S + J_F J_F^T) y = b - J v_0, where F are the
free joints and v_0 has g for these and the bounds for the others. Each joint then wants g + J^T y,
and who wants beyond the box is at its bound in the next round, while who is at a bound and wants
away from it is free.

Who changes sides when is said in `drake_rnn.arrays.algebra` (Kim and Park, "Fast nonnegative
matrix factorization: an active-set-like method and comparisons", SIAM Journal on Scientific
Computing 33, 2011, describe the same for one-sided bounds). Mostly there is one round or two.

The same program with further rows, A v >= c.

Where a row keeps the arm from its task, what is left of the task's error is large, and at its price
even a joint speed of rad/s that lessens it by a tenth of a millimetre a second pays. So the price
is bounded there: the multipliers of the task, y = S^-1 (b - J v), are held to a largest size by a
softer S, as if the error had a price in proportion to itself, not to its square.

Rows come and go from sample to sample, and the velocity with them. So where any is in the way, a
change of the velocity has a price as well, a hundred times that of a preference.

The dual active-set method of Goldfarb and Idnani ("A numerically stable dual method for solving
strictly convex quadratic programs", Mathematical Programming 27, 1983) begins with the velocity of
the program without rows and adds the bound that is failed most, round by round; each multiplier
that would become negative on the way leaves its bound first. With N the bounds that count and K =
(I + J^T S^-1 J)^-1 = I - J^T (S + J J^T)^-1 J, a round solves n equations with N K N^T. At the end
the velocity is that of the bounds that count, whatever the rounds were. In NumPy daqp finds these,
in a tenth of the time.

A quadratic program at one instant, and how fast it changes.

.. math::
    \min_x \tfrac12 x^T W x + c^T x \quad \text{s.t.} \quad A x = b, \quad
    \underline x \le x \le \overline x, \quad C x \le d .

A projected primal-dual network, which converges to the optimum of a quadratic program.

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

from functools import cache, partial
from math import ceil, sqrt
from typing import Any, NamedTuple

import daqp
import numpy as np

from ...arrays import algebra as pivoting
from ...arrays.algebra import (
    Parts,
    clip,
    dot,
    either,
    functions_of,
    in_steps,
    is_one,
    join,
    larger,
    matmul,
    matvec,
    repeat,
    rounded_up,
    solve,
    solved_for,
    solved_regular,
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


# Rounds, of which a thousandth of all programs needs more than six. Of random programs whose box
# allows nothing like the task one in a thousand needs 50, and the worst of 12000 needed 121.
_ROUNDS = 200


def unbounded_velocity(J: Array, b: Array, g: Array, softness: Array) -> Array:
    """Return the velocity of the program without a box, shape (..., n) [rad/s].

    Args:
        J: Jacobian, shape (..., m, n).
        b: Task velocity, shape (..., m).
        g: Preferred joint velocities, shape (..., n) [rad/s].
        softness: Matrix S, shape (..., m, m).
    """
    if not J.shape[-2]:
        return g + 0.0
    y = solved_regular(matmul(J, transpose(J)) + softness, b - matvec(J, g))
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
    v = unbounded_velocity(J, b, g, softness)
    if not J.shape[-2]:
        return clip(v, lower, upper)
    if is_one(v):
        return _of_one(v, J, b, g, softness, lower, upper)
    program = (J, b, g, softness, lower, upper)
    if isinstance(v, np.ndarray):
        return _of_many(v, program)
    xp = functions_of(v)
    result = repeat(lambda parts: _round(xp, program, parts), _start(xp, v, lower, upper), _ROUNDS)
    return clip(result[3], lower, upper)


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
    system = matmul(J * free[..., None, :], transpose(J)) + softness
    v = g + vecmat(solved_regular(system, b - matvec(J, base)), J)
    # A joint at a bound that wants away from it is free in the next round, wherever it wants to.
    at_bound = xp.where(sides < 0.0, -1.0 * (v <= lower), 1.0 * (v >= upper))
    ought = xp.where(sides == 0.0, 1.0 * (v > upper) - 1.0 * (v < lower), at_bound)
    *next_ones, is_done = pivoting.update_sides(sides, ought, fewest, patience)
    return *next_ones, v, is_done


def _of_many(v: Array, program: Parts) -> Array:
    """Return the velocities of many robots in NumPy, of which few need many rounds."""
    lower, upper = program[4], program[5]
    parts = _start(np, v, lower, upper)
    velocity = parts[3].reshape(-1, v.shape[-1]).copy()
    lead = parts[3].shape[:-1]
    rows = [
        np.broadcast_to(array, lead + array.shape[array.ndim - axes :]).reshape(
            -1, *array.shape[array.ndim - axes :]
        )
        for array, axes in zip(program, (2, 1, 1, 2, 1, 1), strict=True)
    ]
    parts = tuple(part.reshape(-1, part.shape[-1]) for part in parts)
    numbers = np.arange(len(velocity))
    for _ in range(_ROUNDS):
        going = ~parts[4][:, 0]
        if not going.all():
            numbers, rows = numbers[going], [array[going] for array in rows]
            parts = tuple(part[going] for part in parts)
        if not numbers.size:
            break
        parts = _round(np, tuple(rows), parts)
        velocity[numbers] = parts[3]
    return clip(velocity.reshape(*lead, -1), lower, upper)


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
    v_preferred, fewest, patience = g.tolist(), len(ends) + 1, pivoting.PATIENCE
    for _ in range(_ROUNDS):
        free = np.array([side == 0 for side in sides], dtype=float)
        entries = zip(sides, ends, v_preferred, strict=True)
        base = np.array([end[side > 0] if side else middle for side, end, middle in entries])
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
    return clip(v, lower, upper)


def _sides(sides: list[int], v: Array, ends: list[tuple[float, float]]) -> list[int]:
    """Return which bound each joint wants to be at, -1 or 1, or 0, free, given where it is."""
    new = []
    for side, wants, (lower, upper) in zip(sides, v.tolist(), ends, strict=True):
        below = wants < lower if side == 0 else side < 0 and wants <= lower
        above = wants > upper if side == 0 else side > 0 and wants >= upper
        new.append(-1 if below else 1 if above else 0)
    return new


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
        c: Their bounds, shape (k,) [rad/s]; -inf where there is none.
    """

    A: Array
    c: Array

    def hold(self, v: Array) -> Any:
        """Return whether a velocity, shape (n,) [rad/s], is within these bounds."""
        return (self.A @ v >= self.c - _SLACK).all()


def within_rows(
    v: Array,
    J: Array,
    b: Array,
    g: Array,
    softness: Array,
    lower: Array,
    upper: Array,
    rows: Rows,
) -> Array:
    """Return the velocity of the program for one robot, shape (n,) [rad/s]; NaN without one.

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
    if not len(b):
        # Without a task, what is preferred is all that is asked for: no change has a price.
        return cheapest(J, b, g, softness, lower, upper, rows)
    # Preferred velocity and the one until now, at a price of one together.
    g, calm = (g + _CALM * v) / (1.0 + _CALM), (1.0 + _CALM) * softness
    solution = cheapest(J, b, g, calm, lower, upper, rows)
    y = _weigh(softness, b - J @ solution)
    size = functions_of(y).sqrt((y * y).sum())
    # Without a solution the size is not a number.
    return either(
        size > _DEAREST,
        lambda: cheapest(J, b, g, calm * (size / _DEAREST), lower, upper, rows),
        lambda: solution,
    )


# Rounds in which bounds are added or left, and by how much one that does not count may be failed
# [rad/s].
_ROUNDS_OF_ROWS, _FAILED = 60, 1e-10
# By how much velocities at bounds may be off before it is said to be more than rounding [rad/s].
_ROUNDING = 1e-13
# Part of a bound's normal that others must leave of it, squared, so that it can be added to them.
_APART = 1e-14


def cheapest(
    J: Array, b: Array, g: Array, softness: Array, lower: Array, upper: Array, rows: Rows
) -> Array:
    """Return the velocity of the program, shape (n,) [rad/s]; NaN without one.

    Args:
        J: Jacobian, shape (m, n).
        b: Task velocity, shape (m,).
        g: Preferred joint velocities, shape (n,) [rad/s].
        softness: Matrix S, shape (m, m).
        lower: Lower bounds, shape (n,) [rad/s].
        upper: Upper bounds, likewise.
        rows: Further bounds.
    """
    xp = functions_of(g, lower, rows.A)
    if xp is np:
        v = _by_daqp((J, b, g, softness), lower, upper, rows)
        return np.full(g.size, np.nan) if v is None else clip(v, lower, upper)
    eye = np.eye(g.size)
    K, free = _on_columns((J, b, g, softness), eye)
    v, pull = clip(g, lower, upper), 0.0 * g
    if len(b):
        v = within_box(J, b, g, softness, lower, upper)
        pull = solved_for(softness, b - J @ v) @ J
    slope = v - g - pull
    # Which bounds of joints count, with their multipliers.
    sides = 1.0 * ((v <= lower) & (slope > 0.0)) - 1.0 * ((v >= upper) & (slope < 0.0))
    bounds = _Bounds(xp.concatenate((eye, -eye, rows.A)), join((lower, -upper, rows.c - _SLACK)), K)
    c = xp.where(sides > 0.0, lower, xp.where(sides < 0.0, -upper, 0.0))
    none = 0.0 * slope[:1]
    adding = (0.0 * slope, none, none, none)
    working = (sides[:, None] * eye, c, abs(sides), abs(sides * slope))
    is_done = none > 0.0
    parts = (v, *working, *adding, is_done, is_done)
    parts = repeat(bounds.advance, parts, _ROUNDS_OF_ROWS)
    N, c, used = parts[1:4]
    # What is gathered over rounds is off by rounding; of bounds that are much alike, twice.
    for _ in range(2):
        free = free + K @ N.T @ solved_for(N @ K @ N.T + (1.0 - used) * eye, c - N @ free)
    v = free
    is_found = parts[-1] & ~parts[-2] & (bounds.A @ v >= bounds.c - 1e3 * _FAILED).all()
    return xp.where(is_found, clip(v, lower, upper), np.nan)


def _on_columns(task: tuple[Array, ...], columns: Array) -> tuple[Array, Array]:
    """Return columns times the inverse of the Hessian, and the velocity without bounds, (n,).

    Args:
        task: J, b, g and S of the program.
        columns: The columns, shape (n, k).
    """
    J, b, g, softness = task
    if not len(b):
        return columns, g
    sides = (J @ columns, (b - matvec(J, g))[:, None])
    solution = solve(
        matmul(J, transpose(J)) + softness, functions_of(*sides).concatenate(sides, axis=1)
    )
    return columns - J.T @ solution[:, :-1], g + solution[:, -1] @ J


def _by_daqp(task: tuple[Array, ...], lower: Array, upper: Array, rows: Rows) -> Array | None:
    """Return the velocity of the program in NumPy, shape (n,) [rad/s]; None without one.

    daqp finds the bounds that count; where these hold with equality it is worked out as of JAX.
    """
    J, b, g, softness = task
    n, S_J = g.size, _weigh(softness, J)
    eye = _identity(n)
    low = np.concatenate((lower, rows.c - _SLACK))
    high = np.concatenate((upper, np.full(len(rows.c), np.inf)))
    H, f = eye + J.T @ S_J, -g - S_J.T @ b
    tolerances = {"primal_tol": _FAILED, "dual_tol": _FAILED}
    v, _, flag, info = daqp.solve(H, f, rows.A, high, low, **tolerances)
    if flag <= 0:
        return None
    multipliers = np.asarray(info["lam"])
    (counts,) = multipliers.nonzero()
    if not 0 < counts.size <= n:
        return np.asarray(v)
    N = np.concatenate((eye, rows.A))[counts]
    c = np.where(multipliers[counts] > 0.0, high[counts], low[counts])
    KN, free = _on_columns(task, N.T)
    M, short = N @ KN, c - N @ free
    if len(c) == 1:
        return free + (short / M[0]) @ KN.T
    try:
        v = free + KN @ solve(M, short)
        # Bounds that are much alike need it twice.
        left = c - N @ v
        return v if np.abs(left).max() < _ROUNDING else v + KN @ solve(M, left)
    except np.linalg.LinAlgError:
        return np.asarray(v)


@cache
def _identity(size: int) -> Array:
    return np.eye(size)


def _weigh(softness: Array, x: Array) -> Array:
    """Return S^-1 x, of a matrix, shape (m, n), or a vector, shape (m,)."""
    if not isinstance(x, np.ndarray) or not isinstance(softness, np.ndarray):
        return solved_for(softness, x) if x.ndim == 1 else solve(softness, x)
    # Mostly S is diagonal. LAPACK takes ten times as long for the same bits.
    if np.count_nonzero(softness) > len(softness):
        return np.asarray(solve(softness, x))
    rows = softness.diagonal()
    return np.asarray(x / rows if x.ndim == 1 else x * (1.0 / rows)[:, None])


class _Bounds(NamedTuple):
    """All bounds of a program, A v >= c, with the inverse of its Hessian.

    Attributes:
        A: Rows of length 1, shape (k, n).
        c: Their bounds, shape (k,) [rad/s].
        K: The inverse, shape (n, n).
    """

    A: Array
    c: Array
    K: Array

    def advance(self, parts: Parts) -> Parts:
        """Return the parts one round later.

        Args:
            parts: The velocity, shape (n,); of up to n bounds that count the rows N, shape (n, n),
                their sides, whether the place is taken, and multipliers, shape (n,) each; of the
                bound that is being added its row, shape (n,), its side, its multiplier and whether
                there is one, shape (1,) each; whether there is no solution, and who is done.
        """
        v, N, c, used, u, row, side, multiplier, is_adding, _, _ = parts
        xp = functions_of(v)
        left = self.A @ v - self.c
        worst = left.argmin()
        is_new = is_adding == 0.0
        row = xp.where(is_new, self.A[worst], row)
        side = xp.where(is_new, self.c[worst], side)
        multiplier = xp.where(is_new, 0.0, multiplier)
        is_done = is_new & (left[worst] >= -_FAILED)
        along = self.K @ row
        NK = N @ self.K
        M = NK @ N.T + (1.0 - used) * np.eye(len(v))
        r = solved_for(M, N @ along)
        way = along - r @ NK
        # Once more, for what rounding has left of it.
        more = solved_for(M, N @ way)
        r, way = r + more, way - more @ NK
        rise, whole = row @ way, row @ along
        moves = rise > _APART * whole
        full = xp.where(moves, (side - row @ v) / xp.where(moves, rise, 1.0), np.inf)
        blocks = (used > 0.0) & (r > 0.0)
        shares = xp.where(blocks, u / xp.where(blocks, r, 1.0), np.inf)
        first = shares.argmin()
        is_full = full <= shares[first]
        t = xp.where(is_full, full, shares[first])
        fails = (t == np.inf) & ~is_done
        t = xp.where(is_done | fails, 0.0, t)
        v = xp.where(moves, v + t * way, v)
        u = xp.where(used > 0.0, xp.maximum(u - t * r, 0.0), 0.0)
        multiplier = multiplier + t
        places = np.arange(len(v))
        goes_on = ~(is_done | fails)
        enters = goes_on & is_full & (places == used.argmin())
        leaves = goes_on & ~is_full & (places == first)
        changes = enters | leaves
        N = xp.where(enters[:, None], row, xp.where(leaves[:, None], 0.0, N))
        c = xp.where(enters, side, xp.where(leaves, 0.0, c))
        u = xp.where(enters, multiplier, xp.where(leaves, 0.0, u))
        used = xp.where(changes, 1.0 * enters, used)
        is_adding = xp.where(is_full, 0.0, 1.0)
        return v, N, c, used, u, row, side, multiplier, is_adding, fails, is_done | fails


class Program(NamedTuple):
    """A program of k variables, m equations and, where there are any, l inequalities.

    Attributes:
        W: Weight, symmetric and positive semidefinite, shape (..., k, k).
        c: Linear term, shape (..., k).
        A: Matrix of the equations, shape (..., m, k).
        b: Their right-hand side, shape (..., m).
        box: Lower and upper bounds of x, finite, shape (..., k) each; None for none.
        C: Matrix of the inequalities, shape (..., l, k); None for none.
        d: Their right-hand side, shape (..., l); None for none.
        soft: By how much they may be failed for a multiplier of 1, in a network that begins with x;
            None for hard ones.
    """

    W: Array
    c: Array
    A: Array
    b: Array
    box: tuple[Array, Array] | None = None
    C: Array | None = None
    d: Array | None = None
    soft: Any = None

    def ahead(self, rates: Rates, time: float) -> Program:
        """Return the program a time [s] later, if its rates stay as they are."""
        later = partial(_later, time=time)
        box = self.box
        if box is not None and rates.box is not None:
            box = later(box[0], rates.box[0]), later(box[1], rates.box[1])
        return Program(
            W=later(self.W, rates.W),
            c=later(self.c, rates.c),
            A=later(self.A, rates.A),
            b=later(self.b, rates.b),
            box=box,
            C=None if self.C is None else later(self.C, rates.C),
            d=None if self.d is None else later(self.d, rates.d),
            soft=self.soft,
        )

    def inequalities(self) -> tuple[Array, Array] | None:
        """Return all inequalities as rows and right-hand sides, the box first; None for none."""
        rows, sides = [], []
        if self.box is not None:
            eye = np.eye(self.c.shape[-1])
            rows += [eye, -eye]
            sides += [self.box[1], -self.box[0]]
        if self.C is not None and self.d is not None:
            rows.append(self.C)
            sides.append(self.d)
        return (stacked_rows(rows), join(sides)) if rows else None


class Rates(NamedTuple):
    """Time derivatives of what a `Program` consists of; None for what is constant."""

    W: Array | None = None
    c: Array | None = None
    A: Array | None = None
    b: Array | None = None
    box: tuple[Array, Array] | None = None
    C: Array | None = None
    d: Array | None = None

    def inequalities(self, program: Program) -> tuple[Array | None, Array | None]:
        """Return the rates of `Program.inequalities`; None for what is constant."""
        sides, k = [], program.c.shape[-1]
        changing = self.box is not None or self.d is not None
        if program.box is not None:
            lower, upper = (0.0 * program.c,) * 2 if self.box is None else self.box
            sides += [upper, -lower]
        if program.d is not None:
            sides.append(0.0 * program.d if self.d is None else self.d)
        rows = self.C
        if rows is not None and program.box is not None:
            rows = stacked_rows([np.zeros((2 * k, k)), rows])
        return rows, join(sides) if changing else None


def stacked_rows(blocks: list[Array]) -> Array:
    """Return matrices one above the other; their leading axes are broadcast."""
    if len(blocks) == 1:
        return blocks[0]
    return _concatenate(blocks, -2)


def block_matrix(blocks: list[list[Array]]) -> Array:
    """Return a matrix made of rows of blocks; the blocks' leading axes are broadcast."""
    return _concatenate([_concatenate(row, -1) for row in blocks], -2)


def _concatenate(blocks: list[Array], axis: int) -> Array:
    lead = np.broadcast_shapes(*(block.shape[:-2] for block in blocks))
    xp = functions_of(*blocks)
    whole = [xp.broadcast_to(block, lead + block.shape[-2:]) for block in blocks]
    return xp.concatenate(whole, axis=axis)


def _later(value: Array, rate: Array | None, time: Any) -> Array:
    return value if rate is None else value + time * rate
