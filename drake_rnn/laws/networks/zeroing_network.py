r"""A zeroing network, which follows the optimum of a program by an error that it drives to zero.

With the error E of `drake_rnn.laws.networks.optimality`, M its derivative by the state y and F the
rate that `drake_rnn.laws.networks.design` wants of it,

.. math::
    M \dot y = F(E, z, t) - \left.\frac{\partial E}{\partial t}\right|_y .

``euler``, ``taylor`` and ``four_step`` carry y on by this rate. ``implicit`` solves the design
formula for the error e of the next sample, which is possible at any gain, and makes one Newton
step to it,

.. math::
    y \leftarrow y + M^{-1} (e - E(y, t + h)), \qquad \text{with } E(y, t + h) \text{ and } M
    \text{ of the program as it will be, by its rates.}

Without inequalities E is linear in y, and the step is exact.

With a funnel its bounds and its task are held by barriers, and E and y are those of
`drake_rnn.laws.networks.barriers`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.algebra import acts, functions_of, joined, solved_for
from ...inputs.fields import Array
from ..layout import Signals
from ..parts.late import pushed
from ..parts.network_noise import NetworkNoise
from ..program.quadratic_program import Program, Rates
from .barriers import Barriers
from .design import Design
from .discretization import ExplicitFormula
from .funnel import Funnel
from .growth import GrowingGain
from .optimality import Optimality, Variables

_Parts = dict[str, Array]


@dataclass(frozen=True, eq=False)
class ZeroingNetwork:
    """The network; its state is kept by a law.

    Attributes:
        variables: Numbers of variables, equations and inequalities of the program.
        design: How its error should vanish.
        gain: The gain gamma.
        formula: How its state is carried on; None for implicit steps.
        damping: The small number epsilon of `Optimality`.
        noise: What disturbs it; None for nothing.
        funnel: What its residual should stay in, with barriers; None without them.
    """

    variables: Variables
    design: Design
    gain: GrowingGain
    formula: ExplicitFormula | None
    damping: Any
    noise: NetworkNoise | None = None
    funnel: Funnel | None = None

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        size, variables = self.variables.size, self.variables
        parts: dict[str, tuple[int, ...]] = {
            "optimum": (variables.x,),
            "multipliers": (variables.equations,),
        }
        if variables.inequalities:
            parts["bound_multipliers"] = (variables.inequalities,)
        if self.funnel is not None:
            parts |= {"logits": (variables.x,), "funnel_used": (1,)}
        if acts(self.design.integral):
            parts["integral"] = (size,)
        if self.formula is not None:
            parts["network_before"] = (2, size)
        if self.noise is not None:
            parts["noise_numbers"] = (size,)
        return {**parts, "residual_largest": (1,)}

    def start(self, rng: np.random.Generator) -> _Parts:
        """Return its parts of the initial state, by name: at zero, whatever the optimum is."""
        parts = {name: np.zeros(shape) for name, shape in self.shapes.items()}
        if self.noise is not None:
            parts["noise_numbers"] = self.noise.start(rng, self.variables.size)
        return parts

    def after(
        self, t: float, kept: Signals, program: Program, rates: Rates, count: Array, period: float
    ) -> _Parts:
        """Return its parts of the state at the next sample, by name.

        Args:
            t: Time of the sample [s].
            kept: Its parts of the state, by name.
            program: The program at the sample.
            rates: How fast it changes.
            count: Number of samples before this one, shape (..., 1).
            period: Time until the next sample [s].
        """
        conditions = self._conditions(program, t)
        y, z = self._y(kept, conditions, count), kept.get("integral")
        E = conditions.error(y)
        noise, held = self._noise(kept, t)
        later = conditions
        if self.formula is None or self.funnel is not None:
            later = self._conditions(program.ahead(rates, period), t + period)
        if self.formula is None:
            e = self.design.after(E, z, self.gain.at(t + period), noise, period)
            found = y
            for _ in range(later.newton_steps):
                found = found + later.shortened(
                    solved_for(later.slope(found), e - later.error(found))
                )
            risen = e
        else:
            # A network that has left its program grows without bound: its controller says so.
            with np.errstate(over="ignore", invalid="ignore"):
                wanted = self.design.rate(E, z, self.gain.at(t)) + noise
                rate = solved_for(conditions.slope(y), wanted - conditions.drift(y, rates))
                before = kept["network_before"]
                found = self.formula.after(y, before, rate, count, period)
            held["network_before"] = pushed(before, y, -2)
            risen = E
        if z is not None:
            held["integral"] = z + period * risen
        held["residual_largest"] = functions_of(E).abs(E).max(axis=-1, keepdims=True)
        if isinstance(conditions, Barriers):
            held |= {"logits": found[..., : self.variables.x], "funnel_used": conditions.used(y)}
        return {**self._named(found, later), **held}

    def _conditions(self, program: Program, t: float) -> Optimality | Barriers:
        if self.funnel is None:
            return Optimality(program, self.damping)
        return Barriers(program, self.damping, self.funnel, t)

    def _y(self, kept: Signals, conditions: Optimality | Barriers, count: Array) -> Array:
        if isinstance(conditions, Barriers):
            # No arm moves before the first sample.
            where = functions_of(count, kept["logits"]).where
            logits = where(count == 0.0, conditions.start(), kept["logits"])
            return joined((logits, kept["multipliers"]))
        names = ["optimum", "multipliers", "bound_multipliers"]
        return joined([kept[name] for name in names if name in kept])

    def _named(self, y: Array, conditions: Optimality | Barriers) -> _Parts:
        k, m, _ = self.variables
        parts = {"optimum": conditions.optimum(y), "multipliers": y[..., k : k + m]}
        if self.variables.inequalities:
            parts["bound_multipliers"] = y[..., k + m :]
        return parts

    def _noise(self, kept: Signals, t: float) -> tuple[Any, _Parts]:
        if self.noise is None:
            return 0.0, {}
        noise, numbers = self.noise.after(kept["noise_numbers"], t)
        return noise, {"noise_numbers": numbers}
