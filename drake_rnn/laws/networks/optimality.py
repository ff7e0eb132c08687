r"""The optimality conditions of a program as an error that vanishes at its optimum.

With the multipliers lambda of the equations and mu of the inequalities, s = d - C x their slack,

.. math::
    E = \begin{pmatrix} W x + c + A^T \lambda + C^T \mu \\ A x - \varepsilon \lambda - b \\
    s + \mu - \sqrt{s^2 + \mu^2 + \delta} \end{pmatrix} .

The last rows, for each inequality one, are the smoothed function of Fischer and Burmeister: up to
delta they vanish just where s and mu are not negative and one of them is zero. A small epsilon
keeps the rows from being dependent where the Jacobian loses rank; at the optimum it is the damping
of a pseudoinverse, epsilon = mu^2.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import functions_of, joined, matvec, scaled, transposed, vecmat
from ...inputs.fields import Array
from ..program.quadratic_program import Program, Rates, block_matrix

# The smoothing delta; the slack of an inequality that holds is then off by half of its root.
_SMOOTH = float(np.finfo(float).eps)


class Variables(NamedTuple):
    """Where the parts of a network's state are.

    Attributes:
        x: Number of the program's variables.
        equations: Number of its equations.
        inequalities: Number of its inequalities.
    """

    x: int
    equations: int
    inequalities: int

    @property
    def size(self) -> int:
        """Number of all variables and multipliers."""
        return self.x + self.equations + self.inequalities


class Optimality:
    """The conditions of one program.

    Args:
        program: The program.
        damping: The small number epsilon.
    """

    #: Newton steps to an error that is wanted: without inequalities the first one is exact.
    newton_steps = 1

    def __init__(self, program: Program, damping: Any) -> None:
        self.program, self.damping = program, damping
        self._k, self._m = program.c.shape[-1], program.b.shape[-1]

    @cached_property
    def _inequalities(self) -> tuple[Array, Array] | None:
        return self.program.inequalities()

    def optimum(self, y: Array) -> Array:
        """Return the program's variables x, shape (..., k)."""
        return y[..., : self._k]

    def error(self, y: Array) -> Array:
        """Return E, of the shape of y: x, lambda and mu, shape (..., k + m + l)."""
        x, multipliers, mu = self._parts(y)
        W, c, A, b = self.program[:4]
        stationary = matvec(W, x) + c + vecmat(multipliers, A)
        equal = matvec(A, x) - self.damping * multipliers - b
        if self._inequalities is None:
            return joined((stationary, equal))
        C, d = self._inequalities
        slack = d - matvec(C, x)
        stationary = stationary + vecmat(mu, C)
        return joined((stationary, equal, slack + mu - _radius(slack, mu)))

    def slope(self, y: Array) -> Array:
        """Return the derivative of E by y, shape (..., k + m + l, k + m + l)."""
        x, _, mu = self._parts(y)
        W, A = self.program.W, self.program.A
        own = scaled(-1.0 * self.damping, np.eye(self._m))
        if self._inequalities is None:
            return block_matrix([[W, transposed(A)], [A, own]])
        C, d = self._inequalities
        slack = d - matvec(C, x)
        r = _radius(slack, mu)
        count = d.shape[-1]
        none = np.zeros((count, self._m))
        by_x = (slack / r - 1.0)[..., None] * C
        by_mu = (1.0 - mu / r)[..., None] * np.eye(count)
        return block_matrix(
            [[W, transposed(A), transposed(C)], [A, own, none.T], [by_x, none, by_mu]]
        )

    def drift(self, y: Array, rates: Rates) -> Array:
        """Return the rate of E while y stays as it is, of the shape of y."""
        x, multipliers, mu = self._parts(y)
        stationary = _moved(rates.W, x) + (0.0 if rates.c is None else rates.c) + 0.0 * x
        equal = _moved(rates.A, x) - (0.0 if rates.b is None else rates.b) + 0.0 * multipliers
        if rates.A is not None:
            stationary = stationary + vecmat(multipliers, rates.A)
        if self._inequalities is None:
            return joined((stationary, equal))
        C, d = self._inequalities
        C_dot, d_dot = rates.inequalities(self.program)
        if C_dot is not None:
            stationary = stationary + vecmat(mu, C_dot)
        slack = d - matvec(C, x)
        opening = (0.0 * slack if d_dot is None else d_dot) - _moved(C_dot, x)
        return joined((stationary, equal, (1.0 - slack / _radius(slack, mu)) * opening))

    def shortened(self, step: Array) -> Array:
        """Return a Newton step as it is."""
        return step

    def _parts(self, y: Array) -> tuple[Array, Array, Array]:
        k, m = self._k, self._m
        return y[..., :k], y[..., k : k + m], y[..., k + m :]


def _radius(slack: Array, mu: Array) -> Array:
    return functions_of(slack, mu).sqrt(slack * slack + mu * mu + _SMOOTH)


def _moved(rate: Array | None, x: Array) -> Any:
    return 0.0 if rate is None else matvec(rate, x)
