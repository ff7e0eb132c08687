"""A scheme: what a redundant arm's velocities minimise, what they must do, and their bounds.

A network (`drake_rnn.laws.networks`) follows the optimum of the program that a scheme is at each
instant. The two know nothing of each other but that program.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays.algebra import functions_of, joined
from ...inputs.fields import Array
from ..layout import Signals
from .bounds import Bounds
from .costs import Cost, Shapes
from .quadratic_program import Program, Rates
from .rows import Rows

#: Signals whose rates no other signal tells: they are taken by differences of samples.
DIFFERENCED = ("J", "J_omega", "M")


@dataclass(frozen=True, eq=False)
class QPScheme:
    """A time-varying quadratic program in x: the joint velocities, then slacks of the cost.

    Attributes:
        cost: What is minimised.
        rows: What x must do.
        bounds: Bounds of x; None for none.
    """

    cost: Cost
    rows: Rows
    bounds: Bounds | None = None

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that it sees, by name."""
        bounds = {} if self.bounds is None else self.bounds.inputs
        return {**self.cost.inputs, **self.rows.inputs, **bounds}

    @property
    def differenced(self) -> Shapes:
        """Shapes of those signals among them whose rates `rates` is to be told."""
        return {name: shape for name, shape in self.inputs.items() if name in DIFFERENCED}

    def sizes(self, joints: int) -> tuple[int, int, int]:
        """Return the numbers of variables, equations and inequalities.

        Args:
            joints: Number n of joints.
        """
        k, rows = joints + self.cost.slacks, self.cost.rows()
        box = 0 if self.bounds is None else 2 * k
        return k, self.rows.size, box + (0 if rows is None else rows[1].size)

    def program(self, u: Signals) -> Program:
        """Return the program at an instant.

        Args:
            u: Signals.
        """
        W, c = self.cost.terms(u)
        A, b = self.rows.terms(u)
        box = None if self.bounds is None else self._wider_box(*self.bounds.box(u))
        if (rows := self.cost.rows()) is None:
            return Program(W, c, self._wider(A), b, box)
        # As many robots as the rest has.
        return Program(W, c, self._wider(A), b, box, rows[0], rows[1] + 0.0 * c[..., :1])

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> Rates:
        """Return how fast the program changes.

        Args:
            u: Signals.
            u_dot: Time derivatives of those in `differenced`.
            x: Variables, shape (..., k).
        """
        v = x[..., : x.shape[-1] - self.cost.slacks]
        W, c = self.cost.rates(u, u_dot, v)
        A, b = self.rows.rates(u, u_dot, v)
        box = None
        if self.bounds is not None:
            lower, upper = (self._wider(rate) for rate in self.bounds.rates(u, v))
            box = lower, upper
        return Rates(W, c, None if A is None else self._wider(A), b, box)

    def _wider(self, value: Array) -> Array:
        """Return a matrix or vector with zeros for the slacks at the end of its last axis."""
        if not self.cost.slacks:
            return value
        zeros = np.zeros((*value.shape[:-1], self.cost.slacks))
        return functions_of(value).concatenate((value, zeros), axis=-1)

    def _wider_box(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return bounds also of the slacks: between 0 and what no velocity exceeds."""
        if not self.cost.slacks:
            return lower, upper
        xp = functions_of(lower, upper)
        most = xp.maximum(xp.abs(lower), xp.abs(upper)).max(axis=-1, keepdims=True)
        return self._wider(lower), joined((upper, most))
