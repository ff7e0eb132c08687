r"""Zeroing networks: the optimum of a time-varying program by an error that is driven to zero.

Sources:
    Zhang, Kong, Zheng, "Power-type varying-parameter RNN for solving TVQP problems: design,
    analysis, and applications", IEEE Transactions on Neural Networks and Learning Systems 30
    (2019). Read in public code: the network with fixed and varying gains for equations (``vp-rnn``,
    of these authors); the noise-tolerant one with inequalities (code that names Jin et al., IEEE
    Transactions on Industrial Electronics 63 (2016)); barriers, activations and the four-step
    formula (``ZNN_Optimal_Control``, of Singh and Keshavan, IEEE Access 10 (2022)). The papers of
    the last two were not read.

With the program of the scheme (`drake_rnn.laws.scheme`) and the error E of its optimality
conditions (`drake_rnn.laws.zeroing_network`), the network

.. math::
    M \dot y = -\gamma(t) \Phi(E) - \partial E / \partial t, \qquad y = (x, \lambda, \mu),

makes E vanish as dE/dt = -gamma Phi(E) does. Without inequalities it is the network of ``vp-rnn``,

.. math::
    Q \dot y = -\dot Q y - \gamma(t) \Phi(Q y - u) + \dot u, \quad
    Q = \begin{pmatrix} I & J^T \\ J & 0 \end{pmatrix}, \quad
    u = \begin{pmatrix} -k (q - q_0) \\ b \end{pmatrix} .

With ``prescribed`` the bounds and the task are held by log barriers, as Singh and Keshavan do:
`drake_rnn.laws.zeroing_network` has E, whose variables are then the barriers' logits.

=========  =====================  =====================================================
paper      here                   meaning
=========  =====================  =====================================================
theta      position               joint positions q
x          optimum                joint velocities of the network (state)
lambda     multipliers            multipliers of the task (state)
mu         bound_multipliers      multipliers of the bounds (state)
z          integral               integral of E (state)
chi        logits                 logits of the velocities within their bounds (state)
gamma      gain                   gain of the design formula [1/s]
eta        integral_gain          gain of the noise-tolerant formula [1/s]
Phi        activation             activation function
k          return_gain            gain of the way back [1/s]
K          feedback               gain of the position feedback [1/s]
=========  =====================  =====================================================

Not in the papers:
    What is commanded is held for a sample, see `drake_rnn.laws.program_law`.
    ``discretization: implicit`` steps are stable at any gain, where the papers integrate in
    continuous time. A damping keeps the equations regular in a singular posture. In the code of
    Singh and Keshavan the network's variables are velocities, which a step may take out of their
    bounds, and the constraint is chi^2/2 = 0, whose slope vanishes where it holds; here they are
    logits, and chi = 0. Position limits are folded into the bounds, and there is a way back.
"""

from __future__ import annotations

from functools import cached_property
from math import inf, isfinite
from typing import Annotated, Literal

from ..errors import InvalidInputError
from ..inputs.fields import Gain, GainOrZero, Positive, Weight, validated
from ..inputs.keys import Meaning, Only
from .law import Circumstances, SampledReading
from .program_law import LearningProgramLaw
from .scheme import (
    BarrierOfVelocity,
    Cost,
)
from .zeroing_design import (
    FORMULAS,
    Activation,
    Design,
    Discretization,
    GrowingGain,
    Growth,
    NetworkNoise,
    Shape,
    activation,
)
from .zeroing_network import Funnel, Variables, ZeroingNetwork

# Damping [m]: of equations alone, whose optimum changes smoothly up to singular postures; and with
# bounds, which can leave none, so that multipliers grow as the inverse of its square.
_DAMPING, _DAMPING_OF_BOUNDS = 1e-4, 1e-3


@validated
class Zeroing(LearningProgramLaw):
    """A zeroing network around the program of a scheme, sampled."""

    kind: Literal["zeroing"] = "zeroing"
    follows_objectives = True
    summary = (
        "Zeroing networks: the optimum of a time-varying program by an error that is driven to "
        "zero."
    )
    gain: Annotated[
        Gain,
        Meaning("Gain gamma of the design formula at the start.", unit="1/s"),
    ] = 100.0
    growth: Annotated[
        Growth,
        Meaning("How the gain grows: ``none``, ``exponential``, ``power`` or ``power_of_gain``."),
    ] = "none"
    growth_rate: Annotated[
        Gain,
        Meaning(
            "The rate a of its growth.",
            unit="1/s",
            only=(Only("growth", "exponential", "power", "power_of_gain"),),
        ),
    ] = 1.0
    activation: Annotated[
        Shape,
        Meaning("Activation function Phi, see `drake_rnn.laws.zeroing_design`."),
    ] = "linear"
    exponent: Annotated[
        Positive | None,
        Meaning("The number p of the activation; by default the one of the public code."),
    ] = None
    steepness: Annotated[
        Positive | None,
        Meaning("The number z of the activation; likewise."),
    ] = None
    integral_gain: Annotated[
        GainOrZero,
        Meaning("Gain eta of the noise-tolerant formula; 0 for the plain one.", unit="1/s"),
    ] = 0.0
    discretization: Annotated[
        Discretization,
        Meaning("``implicit``, ``euler``, ``taylor`` or ``four_step``."),
    ] = "implicit"
    damping: Annotated[
        Weight | None,
        Meaning(
            "Damping of the optimum where J loses rank, or where bounds leave no velocity that "
            "does the task; 1e-4 by default, with ``bounds`` 1e-3.",
            unit="m",
        ),
    ] = None
    noise: Annotated[
        NetworkNoise | None,
        Meaning("What disturbs the network; None for nothing."),
    ] = None
    prescribed: Annotated[
        Funnel | None,
        Meaning(
            "Funnel of the task's residual J v - b, with which velocities are held within their "
            "bounds, and the residual within the funnel, by log barriers; None without it.",
        ),
    ] = None

    takes_many = True

    def __post_init__(self) -> None:
        super().__post_init__()
        activation(self.activation, self.exponent, self.steepness)
        if self.prescribed is not None:
            self._check_prescribed()

    def _check_prescribed(self) -> None:
        if self.bounds != "none":
            raise ValueError("bounds: prescribed has bounds of its own; leave one of them out")
        if self.cost != "velocity" or self.manipulability:
            name = "cost" if self.cost != "velocity" else "manipulability"
            raise ValueError(f"{name}: prescribed has a cost of its own; leave one of them out")
        if self.learns_jacobian:
            raise ValueError(
                "jacobian: prescribed needs jacobian: known, for a residual of a J that is not "
                "learned yet is outside of any funnel"
            )

    @property
    def _bounding(self) -> str:
        return super()._bounding if self.prescribed is None else "prescribed:"

    @property
    def _cost(self) -> Cost:
        if self.prescribed is None:
            return super()._cost
        return BarrierOfVelocity(self.home, self.return_gain, self.limits.velocity)

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; the logits are of velocities within their limits, whatever they are."""
        return () if self.prescribed is None else ("velocity",)

    @cached_property
    def phi(self) -> Activation:
        """The activation function with its numbers."""
        return activation(self.activation, self.exponent, self.steepness)

    @cached_property
    def dynamics(self) -> ZeroingNetwork:
        """The network that the law runs."""
        return ZeroingNetwork(
            self._variables,
            Design(self.phi, self.integral_gain),
            self.gain_over_time,
            FORMULAS.get(self.discretization),
            self._damping**2,
            self.noise,
            self.prescribed,
        )

    @property
    def _variables(self) -> Variables:
        sizes = self.scheme.sizes(self.limits.size)
        # Barriers have no multipliers.
        return Variables(*sizes) if self.prescribed is None else Variables(*sizes[:2], 0)

    @property
    def _damping(self) -> float:
        if self.damping is not None:
            return self.damping
        return _DAMPING if self.prescribed or self.scheme.bounds is None else _DAMPING_OF_BOUNDS

    @cached_property
    def gain_over_time(self) -> GrowingGain:
        """The gain as a function of time."""
        return GrowingGain(self.gain, self.growth, self.growth_rate)

    def sampled(self, period: float) -> SampledReading:
        """Return a `LearningReading`.

        Raises:
            InvalidInputError: If an explicit ``discretization`` is unstable at this period.
        """
        most = self._most(period)
        for name, gain in (("gain", self.gain), ("integral_gain", self.integral_gain)):
            if gain >= most:
                raise InvalidInputError(
                    f"law.{name}: must be below {most:.6g} /s at a period of {period:g} s with "
                    f"discretization: {self.discretization} and activation: {self.activation}, not "
                    f"{gain:g}; or give discretization: implicit"
                )
        return self._reading(period)

    def _most(self, period: float) -> float:
        """Return the gain from which on errors that are small grow at this period [1/s]."""
        formula, slope = FORMULAS.get(self.discretization), self.phi.slope_at_zero
        if formula is None or slope == 0.0 or not isfinite(slope):
            return inf
        return formula.stable_below() / (slope * period)

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """See `Law.doubts`; a gain that grows may leave what can be sampled, or computed."""
        self._require_start(circumstances)
        return [*self._learning_doubts("a noise"), *self._growth_doubts(circumstances)]

    def _require_start(self, circumstances: Circumstances) -> None:
        offset, velocity = circumstances.start_offset, circumstances.start_velocity
        if self.prescribed is None or offset is None or velocity is None:
            return
        half = self.prescribed.width(0.0)[0]
        fastest = float(abs(velocity + self.feedback * offset).max())
        if fastest >= half:
            raise InvalidInputError(
                f"law.prescribed: the start is outside of the funnel: at rest the residual J v - b "
                f"is {fastest:.4g} m/s along an axis, and start + end = {half:.4g} m/s; give a "
                "larger start, a smaller law.feedback or a path that begins nearer to the arm"
            )

    def _growth_doubts(self, circumstances: Circumstances) -> list[str]:
        lasts, until = self.gain_over_time.lasts, circumstances.duration
        if until is None:
            return []
        if until > lasts:
            raise InvalidInputError(
                f"law.growth: {self.growth} makes the gain exceed 1e250 times the first one, which "
                f"no computer can hold, after {lasts:.6g} s; give a duration below that, not "
                f"{until:g} s, or a smaller law.growth_rate"
            )
        if circumstances.period is None:
            return []
        most = self._most(circumstances.period)
        unstable = self.gain_over_time.reaches(most)
        if unstable >= until:
            return []
        return [
            f"law.growth: from {unstable:.3g} s on the gain exceeds {most:.3g} /s, up to which "
            f"discretization: {self.discretization} is stable at this period; end before, or give "
            "discretization: implicit"
        ]
