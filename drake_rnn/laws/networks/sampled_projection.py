"""A network of one projection, sampled: it follows the optimum of a program by what is left of it.

Unlike a zeroing network it does not know how fast the program changes, and lags behind by the rate
of the optimum over its gain. ``implicit`` and ``iterated`` steps go to the program of the next
sample, which its rates tell; a step of ``euler`` is of the program at the sample, as is printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...arrays.algebra import functions_of, joined
from ...inputs.fields import Array
from ..layout import Signals
from ..program.quadratic_program import Program, Rates
from .projected_program import PRIMAL, Network, iterated, neurons, projected

Steps = Literal["implicit", "euler", "iterated"]

_Parts = dict[str, Array]


@dataclass(frozen=True, eq=False)
class ProjectionNetwork:
    """The network; its state is kept by a law.

    The neurons that are no variables of the program are ``multipliers``: of the equations and then
    of the inequalities, or, of the dual networks, of all rows that they count.

    Attributes:
        network: Which one.
        variables: Number k of the program's variables.
        equations: Number m of its equations.
        bounded: Whether its variables have bounds.
        rows: Number of its further inequalities.
        gain: The gain gamma [1/s].
        steps: How its state is carried on.
        iterations: Number of iterations per sample if they are ``iterated``.
        damping: The small number epsilon.
    """

    network: Network
    variables: int
    equations: int
    bounded: bool
    rows: int
    gain: Any
    steps: Steps
    iterations: int
    damping: Any

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        k, m = self.variables, self.equations
        size = neurons(self.network, k, m, self.bounded, self.rows)
        own = size - k if self._is_primal else size
        return {"optimum": (k,), "multipliers": (own,), "residual_largest": (1,)}

    def start(self, rng: np.random.Generator) -> _Parts:
        """Return its parts of the initial state, by name: at zero, whatever the optimum is."""
        return {name: np.zeros(shape) for name, shape in self.shapes.items()}

    def after(
        self, t: float, kept: Signals, program: Program, rates: Rates, count: Array, period: float
    ) -> _Parts:
        """Return its parts of the state at the next sample, by name; as `ZeroingNetwork.after`."""
        y = self._y(kept)
        now = projected(self.network, program, self.damping)
        error = now.error(y)
        left = functions_of(error).abs(error).max(axis=-1, keepdims=True)
        turns = period * self.gain
        if self.steps == "euler":
            # A network that has left its program grows without bound: its controller says so.
            with np.errstate(over="ignore", invalid="ignore"):
                y = y + turns * now.along(error)
                return {**self._named(y, now.optimum(y)), "residual_largest": left}
        later = program.ahead(rates, period)
        if self.steps == "iterated":
            y = iterated(later, self.damping, y, self.iterations)
            return {**self._named(y, y[..., : self.variables]), "residual_largest": left}
        ahead = projected(self.network, later, self.damping)
        y = ahead.after(y, turns)
        return {**self._named(y, ahead.optimum(y)), "residual_largest": left}

    def rate(self, kept: Signals, program: Program) -> Array:
        """Return the time derivative of a network that begins with x, shape (..., N).

        Args:
            kept: Its parts of the state, by name.
            program: The program at the time.
        """
        return self.gain * projected(self.network, program, self.damping).rate(self._y(kept))

    @property
    def _is_primal(self) -> bool:
        return self.network in PRIMAL

    def _y(self, kept: Signals) -> Array:
        if self._is_primal:
            return joined((kept["optimum"], kept["multipliers"]))
        return kept["multipliers"]

    def _named(self, y: Array, x: Array) -> _Parts:
        return {"optimum": x, "multipliers": y[..., self.variables :] if self._is_primal else y}
