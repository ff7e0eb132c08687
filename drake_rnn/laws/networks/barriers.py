r"""The optimality conditions of a program whose bounds and equations are held by log barriers.

Each variable is within its bounds by the share :math:`\xi = (x - \underline x) / r`, where
:math:`r = \overline x - \underline x`; each residual :math:`\epsilon = A x - \varepsilon \lambda -
b` is within a funnel (`drake_rnn.laws.networks.funnel`). With the logits
:math:`\chi = \ln (\xi / (1 - \xi))` and :math:`\chi_\epsilon` of the funnel the program is

.. math::
    \min_x \tfrac12 \chi^T \chi + c^T x \quad \text{s.t.} \quad \chi_\epsilon = 0, \qquad
    E = \begin{pmatrix} \frac{2 + 2 \cosh \chi}{r} \chi + c + A^T \lambda \\
    \chi_\epsilon \end{pmatrix} .

The network's own variables are the logits, whatever they are: x, which follows from them, is
within its bounds after any step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import functions_of, joined, matvec, scaled, transposed, vecmat
from ...inputs.fields import Array
from ..program.quadratic_program import Program, Rates, block_matrix
from .funnel import Funnel

# Largest change of a logit in one Newton step: the barrier is far from linear over more.
_LONGEST = 1.0
# Least way between two bounds [rad/s].
_NARROWEST = 1e-9
# Explicit steps can make logits grow without bound: the controller says so.
_AS_FAR_AS_IT_GOES = np.errstate(over="ignore", invalid="ignore")


class Barriers:
    """The conditions of one program with bounds, at one instant.

    Args:
        program: The program; of its cost the linear term alone is used.
        damping: The small number epsilon.
        funnel: The funnel.
        t: The time [s].
    """

    #: Newton steps to an error that is wanted: one leaves the network at the funnel's wall.
    newton_steps = 3

    def __init__(self, program: Program, damping: Any, funnel: Funnel, t: Any) -> None:
        if program.box is None:
            raise ValueError("barriers need bounds")
        self.program, self.damping, self.funnel, self.t = program, damping, funnel, t
        self._lower, upper = program.box
        # Far beyond a position limit the one velocity that is left is the fastest one back.
        self._range = functions_of(upper).maximum(upper - self._lower, _NARROWEST)
        self._k = program.c.shape[-1]

    def start(self) -> Array:
        """Return the logits of rest, shape (..., k), or of the middle where bounds exclude it."""
        xp = functions_of(self._lower)
        share = -self._lower / self._range
        share = xp.where((share > 0.0) & (share < 1.0), share, 0.5)
        return xp.log(share / (1.0 - share))

    def optimum(self, y: Array) -> Array:
        """Return the program's variables x, shape (..., k), of the logits and multipliers y."""
        chi = y[..., : self._k]
        return self._lower + self._range * 0.5 * (1.0 + functions_of(chi).tanh(0.5 * chi))

    def used(self, y: Array) -> Array:
        """Return the share of the funnel that the residual without damping takes, (..., 1)."""
        A, b = self.program.A, self.program.b
        return self.funnel.used(matvec(A, self.optimum(y)) - b, self.t)

    @_AS_FAR_AS_IT_GOES
    def error(self, y: Array) -> Array:
        """Return E, of the shape of y: logits and multipliers, shape (..., k + m)."""
        chi, multipliers = y[..., : self._k], y[..., self._k :]
        stationary = chi * self._steepness(chi) + self.program.c
        stationary = stationary + vecmat(multipliers, self.program.A)
        return joined((stationary, self.funnel.barrier(self._residual(y), self.t)[0]))

    @_AS_FAR_AS_IT_GOES
    def slope(self, y: Array) -> Array:
        """Return the derivative of E by y, shape (..., k + m, k + m)."""
        chi, A = y[..., : self._k], self.program.A
        steepness = self._steepness(chi)
        sinh = functions_of(chi).sinh(chi)
        own = (steepness + 2.0 * chi * sinh / self._range)[..., None] * np.eye(self._k)
        slope = self.funnel.barrier(self._residual(y), self.t)[1][..., None]
        by_chi = slope * A / steepness[..., None, :]
        by_multipliers = -slope * scaled(self.damping, np.eye(A.shape[-2]))
        return block_matrix([[own, transposed(A)], [by_chi, by_multipliers]])

    @_AS_FAR_AS_IT_GOES
    def drift(self, y: Array, rates: Rates) -> Array:
        """Return the rate of E while y stays as it is, of the shape of y."""
        chi, multipliers = y[..., : self._k], y[..., self._k :]
        lower_rate, upper_rate = rates.box or (0.0 * chi, 0.0 * chi)
        widening = upper_rate - lower_rate
        stationary = -chi * self._steepness(chi) * widening / self._range
        stationary = stationary + (0.0 if rates.c is None else rates.c)
        share = 0.5 * (1.0 + functions_of(chi).tanh(0.5 * chi))
        moved = matvec(self.program.A, lower_rate + share * widening)
        moved = moved - (0.0 if rates.b is None else rates.b)
        if rates.A is not None:
            stationary = stationary + vecmat(multipliers, rates.A)
            moved = moved + matvec(rates.A, self.optimum(y))
        _, slope, narrowing = self.funnel.barrier(self._residual(y), self.t)
        return joined((stationary, slope * moved + narrowing))

    def shortened(self, step: Array) -> Array:
        """Return a Newton step, made so short that no logit changes by more than 1."""
        xp = functions_of(step)
        longest = xp.abs(step[..., : self._k]).max(axis=-1, keepdims=True)
        return step * (_LONGEST / xp.maximum(longest, _LONGEST))

    def _residual(self, y: Array) -> Array:
        A, b = self.program.A, self.program.b
        return matvec(A, self.optimum(y)) - self.damping * y[..., self._k :] - b

    def _steepness(self, chi: Array) -> Array:
        """Return d chi/dx = 1/(r xi (1 - xi)), shape (..., k)."""
        return (2.0 + 2.0 * functions_of(chi).cosh(chi)) / self._range
