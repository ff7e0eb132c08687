"""A scheme: what a redundant arm's velocities minimise, what they must do, and their bounds.

A network (`drake_rnn.laws.networks`) follows the optimum of the program that a scheme is at each
instant. The two know nothing of each other but that program.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...inputs.fields import Array
from ..layout import Signals
from .bounds import Bounds
from .costs import Cost, Shapes
from .quadratic_program import Program, Rates
from .rows import Rows

#: Signals whose rates no other signal tells: they are taken by differences of samples.
DIFFERENCED = ("J", "M")


@dataclass(frozen=True, eq=False)
class QPScheme:
    """A time-varying quadratic program in the joint velocities x.

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

    def program(self, u: Signals) -> Program:
        """Return the program at an instant.

        Args:
            u: Signals.
        """
        W, c = self.cost.terms(u)
        A, b = self.rows.terms(u)
        return Program(W, c, A, b, None if self.bounds is None else self.bounds.box(u))

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> Rates:
        """Return how fast the program changes.

        Args:
            u: Signals.
            u_dot: Time derivatives of those in `differenced`.
            x: Joint velocities, shape (..., n) [rad/s].
        """
        W, c = self.cost.rates(u, u_dot, x)
        A, b = self.rows.rates(u, u_dot, x)
        return Rates(W, c, A, b, None if self.bounds is None else self.bounds.rates(u, x))
