r"""How the state y of a network is carried on from sample to sample.

================  ====================================================  =======  ==============
name              y at the next sample                                  order    gain h below
================  ====================================================  =======  ==============
``implicit``      one Newton step to what the design formula asks for   2        any
``euler``         y + h y'                                              2        2
``taylor``        3/2 y - y_1 + 1/2 y_2 + h y'                          3        1
``four_step``     3/5 y + 1/5 y_1 + 1/5 y_2 + 8/5 h y'                  3        1
================  ====================================================  =======  ==============

y_1 and y_2 are the states of the last two samples. The order is that of the error that is left at
a fixed product of gain and period h: halving the period divides it by 4 or by 8. The last column
is where a linear activation becomes unstable, see `ExplicitFormula.stable_below`.

Sources:
    ``four_step`` was read in public code (``ZNN_Optimal_Control``); ``taylor`` is from memory of
    the papers on discrete zeroing networks of Taylor type. Both follow from Taylor's series:
    tests hold the order. ``implicit`` is ours.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array

Discretization = Literal["implicit", "euler", "taylor", "four_step"]

# Largest modulus of a stable formula's roots, but for rounding.
_UNIT = 1.0 + 1e-12


class ExplicitFormula(NamedTuple):
    """A formula y_next = a_0 y + a_1 y_1 + a_2 y_2 + s h y'.

    Attributes:
        weights: The numbers a_0, a_1 and a_2.
        step: The number s.
    """

    weights: tuple[float, float, float]
    step: float

    def after(self, y: Array, before: Array, rate: Array, count: Array, h: float) -> Array:
        """Return the state a sample later, shape (..., k); of the first two by Euler's formula.

        Args:
            y: State now, shape (..., k).
            before: States of the last two samples, the newer one first, shape (..., 2, k).
            rate: Rate of the state, shape (..., k).
            count: Number of samples so far, shape (..., 1).
            h: Period [s].
        """
        first = y + h * rate
        if self.weights[1:] == (0.0, 0.0):
            return first
        now, one, two = self.weights
        later = now * y + one * before[..., 0, :] + two * before[..., 1, :] + self.step * h * rate
        return functions_of(y).where(count >= 2.0, later, first)

    def stable_below(self) -> float:
        """Return the product of gain and period from which on y' = -gain y is unstable."""
        low, high = 0.0, 4.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            now, one, two = self.weights
            roots = np.roots([1.0, self.step * middle - now, -one, -two])
            if np.abs(roots).max() <= _UNIT:
                low = middle
            else:
                high = middle
        return round(low, 9)


FORMULAS = {
    "euler": ExplicitFormula((1.0, 0.0, 0.0), 1.0),
    "taylor": ExplicitFormula((1.5, -1.0, 0.5), 1.0),
    "four_step": ExplicitFormula((0.6, 0.2, 0.2), 1.6),
}
