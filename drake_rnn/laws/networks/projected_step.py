r"""Piecewise linear networks of one projection, by themselves and a step later.

With P, which clips each entry to its bounds, and matrices that a program gives,

.. math::
    \dot y = \gamma K \left( P(B y + g) - D y - f \right), \qquad x = R y + r .

The networks of `drake_rnn.laws.networks.projected_program` have this form. They are stiff: the
larger the gain gamma, the nearer x is to the optimum of a program that changes. So a step is
Euler's implicit one,

.. math::
    y = y_0 + \gamma h K \left( P(B y + g) - D y - f \right),

whose solution is found by block principal pivoting (`drake_rnn.arrays.pivoting`): which entries are
clipped, and to which bound, is guessed, which leaves a linear system; its solution corrects the
guess. That ends, as it does in `drake_rnn.laws.parts.box_program`, because the guess is the
solution of a complementarity problem whose matrix is positive definite, or a product of such with
positive principal minors. Once the guess is right, the solution is exact. From sample to sample few
entries change sides, so mostly there is one round.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...arrays import pivoting
from ...arrays.algebra import clipped, functions_of, matmul, matvec, scaled, solved_for
from ...arrays.substeps import Parts, repeated
from ...inputs.fields import Array

# Rounds of pivoting, and of what is compiled, which makes all of them each time. Random programs
# need 5 on average from random starts; of 3200, none needed more than 44.
_ROUNDS, _ROUNDS_COMPILED = 200, 60
# How far an entry may be on the wrong side, as a share of its size: rounding.
_NARROW = 1e-12


class Projected(NamedTuple):
    """A network at one instant, of N neurons; leading axes of robots are allowed.

    Attributes:
        B: Matrix of what is projected, shape (..., N, N).
        g: Its constant part, shape (..., N).
        lower: Lower bounds of the projection, shape (..., N), infinite for none.
        upper: Upper bounds, likewise.
        R: Matrix of the variables x, shape (..., k, N).
        r: Their constant part, shape (..., k), or 0.
        D: Matrix of what is taken off, shape (..., N, N); None for the identity.
        f: Its constant part, shape (..., N), or 0.
        K: Matrix K, shape (..., N, N); None for the identity.
    """

    B: Array
    g: Array
    lower: Array
    upper: Array
    R: Array
    r: Any = 0.0
    D: Array | None = None
    f: Any = 0.0
    K: Array | None = None

    def optimum(self, y: Array) -> Array:
        """Return the variables x, shape (..., k), of a state y, shape (..., N)."""
        return matvec(self.R, y) + self.r

    def error(self, y: Array) -> Array:
        """Return P(B y + g) - D y - f, shape (..., N); it vanishes where x is the optimum."""
        off = y if self.D is None else matvec(self.D, y)
        return clipped(matvec(self.B, y) + self.g, self.lower, self.upper) - off - self.f

    def rate(self, y: Array) -> Array:
        """Return the rate of y at a gain of 1/s, shape (..., N)."""
        return self.along(self.error(y))

    def along(self, error: Array) -> Array:
        """Return the rate of y that an error gives, shape (..., N)."""
        return error if self.K is None else matvec(self.K, error)

    def slope(self, y: Array) -> Array:
        """Return the derivative of `rate` by y, shape (..., N, N)."""
        return self._slope(self._sides(y))

    def stable_below(self) -> float:
        """Return the gain times period from which on an explicit step of one robot is unstable.

        The least of two: with no entry clipped, and with all that have bounds.
        """
        bounded: Array = np.where(np.isfinite(self.lower) | np.isfinite(self.upper), 1.0, 0.0)
        least = np.inf
        for sides in (np.zeros_like(bounded), bounded):
            # Euler's method is stable where |1 + turns value| < 1.
            values: Any = np.linalg.eigvals(self._slope(sides))
            values = values[np.abs(values) > _NARROW]
            if values.size:
                least = min(least, float((-2.0 * values.real / np.abs(values) ** 2).min()))
        return least

    def after(self, y: Array, turns: Any) -> Array:
        """Return the state a step later by Euler's implicit method, shape (..., N).

        Args:
            y: State, shape (..., N).
            turns: Gain times period, a number or of shape (..., 1).
        """
        xp = functions_of(y, self.B)

        def advance(parts: Parts) -> Parts:
            y, sides, fewest, patience, done = parts
            found = self._solution(start, sides, turns)
            ought = self._corrected(found, sides)
            ought, fewest, patience, ended = pivoting.turned(sides, ought, fewest, patience)
            # What is done stays as it is, whatever other robots need.
            y, sides = xp.where(done, y, found), xp.where(done, sides, ought)
            return y, sides, fewest, patience, done | ended

        start, sides = y, self._sides(y)
        rounds = _ROUNDS if isinstance(sides, np.ndarray) else _ROUNDS_COMPILED
        fewest, patience = pivoting.first(sides)
        parts = (y + 0.0 * sides, sides, fewest, patience, fewest < 0.0)
        return repeated(advance, parts, rounds)[0]

    def _solution(self, start: Array, sides: Array, turns: Any) -> Array:
        """Return the state a step later if the projection clips to these sides."""
        where = functions_of(sides, self.g).where
        fixed = where(sides < 0.0, self.lower, where(sides > 0.0, self.upper, self.g)) - self.f
        matrix = np.eye(sides.shape[-1]) - scaled(turns, self._slope(sides))
        return solved_for(matrix, start + turns * self.along(fixed))

    def _corrected(self, y: Array, sides: Array) -> Array:
        """Return the sides of a state; those that it has but for rounding are kept."""
        z, xp = matvec(self.B, y) + self.g, functions_of(y, self.g)
        rounding = _NARROW * (1.0 + xp.abs(z))
        ought = self._sides_of(z)
        near_low, near_high = abs(z - self.lower) <= rounding, abs(z - self.upper) <= rounding
        near = (near_low & (sides <= 0.0)) | (near_high & (sides >= 0.0))
        # What is clipped, and should not be so, is free in the next round, wherever it goes.
        freed = xp.where((sides != 0.0) & (ought != sides), 0.0, ought)
        return xp.where(near, sides, freed)

    def _sides(self, y: Array) -> Array:
        return self._sides_of(matvec(self.B, y) + self.g)

    def _sides_of(self, z: Array) -> Array:
        """Return which entries are clipped to the lower bound, -1, the upper one, 1, or none, 0."""
        where = functions_of(z).where
        # Where both bounds are the same there is one side.
        free = self.lower < self.upper
        return where(free & (z <= self.lower), -1.0, where(free & (z < self.upper), 0.0, 1.0))

    def _slope(self, sides: Array) -> Array:
        off = np.eye(sides.shape[-1]) if self.D is None else self.D
        slope = functions_of(sides, self.B).where(sides[..., None] == 0.0, self.B, 0.0) - off
        return slope if self.K is None else matmul(self.K, slope)
