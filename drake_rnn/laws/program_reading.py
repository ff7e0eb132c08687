"""The sampled reading of laws whose network follows the optimum of a scheme's program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import JointLimits
from .law import SampledReading
from .layout import Layout, Signals
from .parts.learned_jacobian import LearnedJacobian
from .parts.signal_rates import SignalRates
from .program.quadratic_program import Program, Rates
from .program.scheme import QPScheme

# Parts of a network's state that are recorded, by the names of observables.
_TOLD = {"residual": "residual_largest", "funnel_share": "funnel_used"}


class FollowingNetwork(Protocol):
    """A network that follows the optimum of a program.

    Among its parts of the state are ``optimum``, the variables x, and ``residual_largest``.
    """

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""

    def start(self, rng: np.random.Generator) -> dict[str, Array]:
        """Return its parts of the initial state, by name."""

    def after(
        self, t: float, kept: Signals, program: Program, rates: Rates, count: Array, period: float
    ) -> dict[str, Array]:
        """Return its parts of the state at the next sample, by name."""


class FollowingLaw(Protocol):
    """What the reading needs of a law."""

    @property
    def limits(self) -> JointLimits:
        """Limits of the joints; only their number is used."""

    @property
    def inputs(self) -> Layout:
        """Signals that it sees."""

    @property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""

    @property
    def dynamics(self) -> FollowingNetwork:
        """The network."""


@dataclass(frozen=True, eq=False)
class ProgramReading(SampledReading):
    """The network of a law, sampled.

    What is commanded is held for a sample: the mean of the network's velocities at its two ends,
    which moves the joints as the ramp between them does. How J changes is told by the last samples;
    of one that is learned it is not known.

    Attributes:
        law: The law.
    """

    law: FollowingLaw

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        learned = {} if self.learned is None else self.learned.shapes
        parts = {**self.law.dynamics.shapes, **self._rates.shapes, **learned}
        return Layout(v=(n,), **parts, samples=(1,))

    @cached_property
    def inputs(self) -> Layout:
        return self.law.inputs

    @cached_property
    def observables(self) -> Layout:
        parts = self.state.parts
        return Layout(**{name: (1,) for name, part in _TOLD.items() if part in parts})

    @property
    def learned(self) -> LearnedJacobian | None:
        """Where its Jacobian comes from if it is learned; None if it is told."""
        return None

    @cached_property
    def _rates(self) -> SignalRates:
        known = self.law.scheme.differenced
        return SignalRates({k: s for k, s in known.items() if k != "J" or self.learned is None})

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        start = {"v": np.zeros(self.law.limits.size), "samples": np.zeros(1)}
        start |= self.law.dynamics.start(rng) | self._rates.start(u)
        return self.state.joined(
            start | ({} if self.learned is None else self.learned.start(rng, u))
        )

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        kept, scheme = self.state.named(x), self.law.scheme
        count, before = kept["samples"], kept["optimum"]
        u_dot, held = self._rates.advanced(kept, u, count, period)
        if self.learned is not None:
            J, learned = self.learned.advanced(kept, u, period)
            u, held = {**u, "J": J}, {**held, **learned}
            u_dot = {**u_dot, "J": 0.0 * J}
        program, rates = scheme.program(u), scheme.rates(u, u_dot, before)
        found = self.law.dynamics.after(t, kept, program, rates, count, period)
        # The joint velocities come before what else the program has.
        v = 0.5 * (before + found["optimum"])[..., : self.law.limits.size]
        return self.state.joined({"v": v, **found, **held, "samples": count + 1.0})

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {name: self.state.part(x, _TOLD[name]) for name in self.observables.parts}
