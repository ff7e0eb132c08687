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
conditions, the network

.. math::
    M \dot y = -\gamma(t) \Phi(E) - \partial E / \partial t, \qquad y = (x, \lambda, \mu),

makes E vanish as dE/dt = -gamma Phi(E) does. Without inequalities it is the network of ``vp-rnn``,

.. math::
    Q \dot y = -\dot Q y - \gamma(t) \Phi(Q y - u) + \dot u, \quad
    Q = \begin{pmatrix} I & J^T \\ J & 0 \end{pmatrix}, \quad
    u = \begin{pmatrix} -k (q - q_0) \\ b \end{pmatrix} .

With ``prescribed`` the bounds and the task are held by log barriers, as Singh and Keshavan do; the
variables of E, below, are then the barriers' logits.

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
    What is commanded is held for a sample, see `drake_rnn.laws.scheme`.
    ``discretization: implicit`` steps are stable at any gain, where the papers integrate in
    continuous time. A damping keeps the equations regular in a singular posture. In the code of
    Singh and Keshavan the network's variables are velocities, which a step may take out of their
    bounds, and the constraint is chi^2/2 = 0, whose slope vanishes where it holds; here they are
    logits, and chi = 0. Position limits are folded into the bounds, and there is a way back.

A zeroing network, which follows the optimum of a program by an error that it drives to zero.

With the error E of the optimality conditions, M its derivative by the state y and F the
rate that `drake_rnn.laws.zeroing_design` wants of it,

.. math::
    M \dot y = F(E, z, t) - \left.\frac{\partial E}{\partial t}\right|_y .

``euler``, ``taylor`` and ``four_step`` carry y on by this rate. ``implicit`` solves the design
formula for the error e of the next sample, which is possible at any gain, and makes one Newton
step to it,

.. math::
    y \leftarrow y + M^{-1} (e - E(y, t + h)), \qquad \text{with } E(y, t + h) \text{ and } M
    \text{ of the program as it will be, by its rates.}

Without inequalities E is linear in y, and the step is exact.

With a funnel its bounds and its task are held by barriers, and E and y are those of the
barriers below.

The optimality conditions of a program as an error that vanishes at its optimum.

With the multipliers lambda of the equations and mu of the inequalities, s = d - C x their slack,

.. math::
    E = \begin{pmatrix} W x + c + A^T \lambda + C^T \mu \\ A x - \varepsilon \lambda - b \\
    s + \mu - \sqrt{s^2 + \mu^2 + \delta} \end{pmatrix} .

The last rows, for each inequality one, are the smoothed function of Fischer and Burmeister: up to
delta they vanish just where s and mu are not negative and one of them is zero. A small epsilon
keeps the rows from being dependent where the Jacobian loses rank; at the optimum it is the damping
of a pseudoinverse, epsilon = mu^2.

The optimality conditions of a program whose bounds and equations are held by log barriers.

Each variable is within its bounds by the share :math:`\xi = (x - \underline x) / r`, where
:math:`r = \overline x - \underline x`; each residual :math:`\epsilon = A x - \varepsilon \lambda -
b` is within a funnel. With the logits
:math:`\chi = \ln (\xi / (1 - \xi))` and :math:`\chi_\epsilon` of the funnel the program is

.. math::
    \min_x \tfrac12 \chi^T \chi + c^T x \quad \text{s.t.} \quad \chi_\epsilon = 0, \qquad
    E = \begin{pmatrix} \frac{2 + 2 \cosh \chi}{r} \chi + c + A^T \lambda \\
    \chi_\epsilon \end{pmatrix} .

The network's own variables are the logits, whatever they are: x, which follows from them, is
within its bounds after any step.

A funnel that the task's residual should stay in: prescribed performance.

.. math::
    |\epsilon_i| < \rho(t), \qquad \rho = \rho_0 e^{-\delta t} + \rho_\infty, \qquad
    \chi = \ln \frac{\rho + \epsilon}{\rho - \epsilon} .

chi is infinite at the wall. A sampled residual may step past it, where no logarithm is: from a
share of 0.99 on chi goes on along its tangent, so that the network comes back from there too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from ..arrays.algebra import acts, functions_of, join, matvec, scale, solved_for, transpose, vecmat
from ..errors import InvalidInputError
from ..inputs.fields import Array, Gain, GainOrZero, Positive, Weight, validated
from ..inputs.keys import Meaning, Only
from .law import Circumstances, SampledReading, Signals, State
from .parts.jacobian import push
from .parts.programs import Program, Rates, block_matrix
from .scheme import (
    BarrierOfVelocity,
    Cost,
    LearningProgramLaw,
)
from .zeroing_design import (
    FORMULAS,
    Activation,
    Design,
    Discretization,
    ExplicitFormula,
    GrowingGain,
    Growth,
    NetworkNoise,
    Shape,
    activation,
)

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
            return join((stationary, equal))
        C, d = self._inequalities
        slack = d - matvec(C, x)
        stationary = stationary + vecmat(mu, C)
        return join((stationary, equal, slack + mu - _radius(slack, mu)))

    def slope(self, y: Array) -> Array:
        """Return the derivative of E by y, shape (..., k + m + l, k + m + l)."""
        x, _, mu = self._parts(y)
        W, A = self.program.W, self.program.A
        own = scale(-1.0 * self.damping, np.eye(self._m))
        if self._inequalities is None:
            return block_matrix([[W, transpose(A)], [A, own]])
        C, d = self._inequalities
        slack = d - matvec(C, x)
        r = _radius(slack, mu)
        count = d.shape[-1]
        none = np.zeros((count, self._m))
        by_x = (slack / r - 1.0)[..., None] * C
        by_mu = (1.0 - mu / r)[..., None] * np.eye(count)
        return block_matrix(
            [[W, transpose(A), transpose(C)], [A, own, none.T], [by_x, none, by_mu]]
        )

    def drift(self, y: Array, rates: Rates) -> Array:
        """Return the rate of E while y stays as it is, of the shape of y."""
        x, multipliers, mu = self._parts(y)
        stationary = _move(rates.W, x) + (0.0 if rates.c is None else rates.c) + 0.0 * x
        equal = _move(rates.A, x) - (0.0 if rates.b is None else rates.b) + 0.0 * multipliers
        if rates.A is not None:
            stationary = stationary + vecmat(multipliers, rates.A)
        if self._inequalities is None:
            return join((stationary, equal))
        C, d = self._inequalities
        C_dot, d_dot = rates.inequalities(self.program)
        if C_dot is not None:
            stationary = stationary + vecmat(mu, C_dot)
        slack = d - matvec(C, x)
        opening = (0.0 * slack if d_dot is None else d_dot) - _move(C_dot, x)
        return join((stationary, equal, (1.0 - slack / _radius(slack, mu)) * opening))

    def shorten(self, step: Array) -> Array:
        """Return a Newton step as it is."""
        return step

    def _parts(self, y: Array) -> tuple[Array, Array, Array]:
        k, m = self._k, self._m
        return y[..., :k], y[..., k : k + m], y[..., k + m :]


def _radius(slack: Array, mu: Array) -> Array:
    return functions_of(slack, mu).sqrt(slack * slack + mu * mu + _SMOOTH)


def _move(rate: Array | None, x: Array) -> Any:
    return 0.0 if rate is None else matvec(rate, x)


# Share of the funnel from which on chi goes on along its tangent.
_TANGENT = 0.99


@validated
class Funnel:
    """The funnel; its numbers are velocities, of each row of the task."""

    start: Annotated[
        GainOrZero,
        Meaning(
            "Width rho_0 that it loses, its half width at the start being ``start + end`` [m/s, "
            "rad/s].",
        ),
    ] = 2.0
    end: Annotated[
        Positive,
        Meaning("Half width rho_inf that is left in the end [m/s, rad/s]."),
    ] = 0.005
    decay: Annotated[GainOrZero, Meaning("Rate delta of its decay.", unit="1/s")] = 100.0

    def width(self, t: Any) -> tuple[Any, Any]:
        """Return the half width rho and its rate at a time [s]."""
        left = self.start * functions_of(t, self.decay).exp(-self.decay * t)
        return left + self.end, -self.decay * left

    def barrier(self, residual: Array, t: Any) -> tuple[Array, Array, Array]:
        """Return chi, its slope by the residual and its rate as the funnel narrows.

        Args:
            residual: Residual of the task, shape (..., m).
            t: The time [s].
        """
        width, narrowing = self.width(t)
        share = residual / width
        xp = functions_of(residual)
        inner = xp.clip(share, -_TANGENT, _TANGENT)
        steepness = 2.0 / (1.0 - inner * inner)
        chi = xp.log((1.0 + inner) / (1.0 - inner)) + steepness * (share - inner)
        slope = steepness / width
        return chi, slope, -slope * share * narrowing

    def used(self, residual: Array, t: Any) -> Array:
        """Return the largest share of the funnel that a residual takes, shape (..., 1)."""
        return functions_of(residual).abs(residual).max(axis=-1, keepdims=True) / self.width(t)[0]


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
        return join((stationary, self.funnel.barrier(self._residual(y), self.t)[0]))

    @_AS_FAR_AS_IT_GOES
    def slope(self, y: Array) -> Array:
        """Return the derivative of E by y, shape (..., k + m, k + m)."""
        chi, A = y[..., : self._k], self.program.A
        steepness = self._steepness(chi)
        sinh = functions_of(chi).sinh(chi)
        own = (steepness + 2.0 * chi * sinh / self._range)[..., None] * np.eye(self._k)
        slope = self.funnel.barrier(self._residual(y), self.t)[1][..., None]
        by_chi = slope * A / steepness[..., None, :]
        by_multipliers = -slope * scale(self.damping, np.eye(A.shape[-2]))
        return block_matrix([[own, transpose(A)], [by_chi, by_multipliers]])

    @_AS_FAR_AS_IT_GOES
    def drift(self, y: Array, rates: Rates) -> Array:
        """Return the rate of E while y stays as it is, of the shape of y."""
        chi, multipliers = y[..., : self._k], y[..., self._k :]
        lower_rate, upper_rate = rates.box or (0.0 * chi, 0.0 * chi)
        widening = upper_rate - lower_rate
        stationary = -chi * self._steepness(chi) * widening / self._range
        stationary = stationary + (0.0 if rates.c is None else rates.c)
        share = 0.5 * (1.0 + functions_of(chi).tanh(0.5 * chi))
        drift_rate = matvec(self.program.A, lower_rate + share * widening)
        drift_rate = drift_rate - (0.0 if rates.b is None else rates.b)
        if rates.A is not None:
            stationary = stationary + vecmat(multipliers, rates.A)
            drift_rate = drift_rate + matvec(rates.A, self.optimum(y))
        _, slope, narrowing = self.funnel.barrier(self._residual(y), self.t)
        return join((stationary, slope * drift_rate + narrowing))

    def shorten(self, step: Array) -> Array:
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

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state: at zero, whatever the optimum is.

        See `Component.init`.
        """
        parts = {name: np.zeros(shape) for name, shape in self.shapes.items()}
        if self.noise is not None:
            parts["noise_numbers"] = self.noise.init(rng, self.variables.size)
        return parts

    def step(
        self, state: State, u: Signals, period: float, t: float, program: Program, rates: Rates
    ) -> tuple[Array, State]:
        """Return the optimum x at the next sample, shape (..., k); see `Component.step`.

        It reads the part ``samples`` as well, the number of samples before, shape (..., 1).

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            t: Time of the sample [s].
            program: The program at the sample.
            rates: How fast it changes.
        """
        optimum = self._after(t, state, program, rates, period)
        return optimum["optimum"], optimum

    def _after(
        self, t: float, parts: State, program: Program, rates: Rates, period: float
    ) -> State:
        """Return the parts of the state at the next sample, by name."""
        count = parts["samples"]
        conditions = self._conditions(program, t)
        y, z = self._y(parts, conditions, count), parts.get("integral")
        E = conditions.error(y)
        noise, noise_state = self._noise(parts, t)
        later = conditions
        if self.formula is None or self.funnel is not None:
            later = self._conditions(program.ahead(rates, period), t + period)
        if self.formula is None:
            e = self.design.after(E, z, self.gain.at(t + period), noise, period)
            root = y
            for _ in range(later.newton_steps):
                root = root + later.shorten(solved_for(later.slope(root), e - later.error(root)))
            e_new = e
        else:
            # A network that has left its program grows without bound: its controller says so.
            with np.errstate(over="ignore", invalid="ignore"):
                e_next = self.design.rate(E, z, self.gain.at(t)) + noise
                rate = solved_for(conditions.slope(y), e_next - conditions.drift(y, rates))
                before = parts["network_before"]
                root = self.formula.after(y, before, rate, count, period)
            noise_state["network_before"] = push(before, y, -2)
            e_new = E
        if z is not None:
            noise_state["integral"] = z + period * e_new
        noise_state["residual_largest"] = functions_of(E).abs(E).max(axis=-1, keepdims=True)
        if isinstance(conditions, Barriers):
            noise_state |= {
                "logits": root[..., : self.variables.x],
                "funnel_used": conditions.used(y),
            }
        return {**self._by_name(root, later), **noise_state}

    def _conditions(self, program: Program, t: float) -> Optimality | Barriers:
        if self.funnel is None:
            return Optimality(program, self.damping)
        return Barriers(program, self.damping, self.funnel, t)

    def _y(self, parts: Signals, conditions: Optimality | Barriers, count: Array) -> Array:
        if isinstance(conditions, Barriers):
            # No arm moves before the first sample.
            where = functions_of(count, parts["logits"]).where
            logits = where(count == 0.0, conditions.start(), parts["logits"])
            return join((logits, parts["multipliers"]))
        names = ["optimum", "multipliers", "bound_multipliers"]
        return join([parts[name] for name in names if name in parts])

    def _by_name(self, y: Array, conditions: Optimality | Barriers) -> State:
        k, m, _ = self.variables
        parts = {"optimum": conditions.optimum(y), "multipliers": y[..., k : k + m]}
        if self.variables.inequalities:
            parts["bound_multipliers"] = y[..., k + m :]
        return parts

    def _noise(self, parts: Signals, t: float) -> tuple[Any, State]:
        if self.noise is None:
            return 0.0, {}
        noise, numbers = self.noise.step(parts["noise_numbers"], t)
        return noise, {"noise_numbers": numbers}


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
