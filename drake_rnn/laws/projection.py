r"""Projection networks: dual, and primal-dual of a linear variational inequality.

Sources:
    Zhang, Wang, Xia, "A dual neural network for redundancy resolution of kinematically redundant
    manipulators subject to joint limits and joint velocity limits", IEEE Transactions on Neural
    Networks 14 (2003). The LVI-based primal-dual network: Zhang, "On the LVI-based primal-dual
    neural network for solving online linear and quadratic programming problems", American Control
    Conference (2005), and its simplified form, in which public code integrates them. The
    projection network: Xia, Leung, Wang, "A projection neural network and its application to
    constrained optimization problems", IEEE Transactions on Circuits and Systems I 49 (2002).
    Equations were read in public code, see below; the papers themselves were not read.

The optimum of the program of a scheme (`drake_rnn.laws.scheme`) is where a projection leaves the
network as it is. Elsewhere it moves there, with P the clip to the bounds, at the rate gamma: the
primal-dual one by

.. math::
    \dot y = \gamma (I + H^T) \left( P(y - (H y + p)) - y \right), \qquad y = (x, \lambda),

and the dual one by

.. math::
    \dot u = \gamma \left( P(E x - u) - E x \right), \qquad x = W^{-1} (E^T u - c) .

=========  ===========  =====================================================
paper      here         meaning
=========  ===========  =====================================================
theta      position     joint positions q
x          optimum      joint velocities of the network (state)
lambda, u  multipliers  multipliers of the task, and of the dual ones (state)
gamma      gain         gain of the network [1/s]
k          return_gain  gain of the way back [1/s]
K          feedback     gain of the position feedback [1/s]
=========  ===========  =====================================================

Not in the papers:
    The papers integrate in continuous time, by stiff methods. Here a step is implicit, and found
    exactly, at any gain and period; or it is printed, and refused where it is unstable; or it is a
    counted number of iterations. What is commanded is held for a sample, see
    `drake_rnn.laws.scheme`. A damping keeps the multipliers of the task bounded where the
    bounds leave no velocity that does it.

Networks of one projection whose equilibrium is the optimum of a program.

For :math:`\min \tfrac12 x^T W x + c^T x` with A x = b, bounds of x and C x <= d.

**LVI-based primal-dual network** (LVI-PDNN). The optimality conditions are a linear variational
inequality: with y = (x, lambda, mu), and Omega the bounds of x, all lambda and mu >= 0, it holds
just at the optimum that :math:`y = P_\Omega(y - (H y + p))`, where

.. math::
    H = \begin{pmatrix} W & -A^T & C^T \\ A & \varepsilon & 0 \\ -C & 0 & 0 \end{pmatrix}, \quad
    p = \begin{pmatrix} c \\ -b \\ d \end{pmatrix}, \qquad
    \dot y = \gamma (I + H^T) \left( P_\Omega(y - (H y + p)) - y \right) .

The *simplified* one leaves I + H^T out. It is the projection network of Xia, Leung and Wang for
these conditions. With W = I and no C it is the network (16) of
`drake_rnn.laws.simultaneous_learning`, and up to the sign of the multipliers that of
`drake_rnn.laws.parts.programs`.

**Dual network**. Its neurons u are the multipliers of all rows E = [A; I; C], whose bounds are b
twice, those of x, and -inf and d:

.. math::
    \dot u = \gamma \left( P(E x - u) - E x \right), \qquad x = W^{-1} (E^T u - c) .

In the *simplified* one the equations are solved, so that it has neurons for the bounds alone:
x = M E^T u + s, with E = [I; C], and M and s such that every x fulfils A x = b.

A small epsilon, the square of a damping, keeps lambda bounded where the bounds allow no x with
A x = b: at the optimum epsilon lambda is what is short, b - A x.

Sources:
    LVI-PDNN and its simplified form were read in public code: a simulation of a Kinova arm, and a
    drift-free scheme. The dual one was read in public code that has it as a rival, for W = I and
    c = 0. The simplified dual one (Liu, Wang, "A simplified dual neural network for quadratic
    programming with its KWTA application", IEEE Transactions on Neural Networks 17, 2006), and the
    iteration below, are from memory.

Piecewise linear networks of one projection, by themselves and a step later.

With P, which clips each entry to its bounds, and matrices that a program gives,

.. math::
    \dot y = \gamma K \left( P(B y + g) - D y - f \right), \qquad x = R y + r .

Both networks above have this form. They are stiff: the
larger the gain gamma, the nearer x is to the optimum of a program that changes. So a step is
Euler's implicit one,

.. math::
    y = y_0 + \gamma h K \left( P(B y + g) - D y - f \right),

whose solution is found by block principal pivoting (`drake_rnn.arrays.algebra`): which entries are
clipped, and to which bound, is guessed, which leaves a linear system; its solution corrects the
guess. That ends, as it does in `drake_rnn.laws.parts.programs`, because the guess is the
solution of a complementarity problem whose matrix is positive definite, or a product of such with
positive principal minors. Once the guess is right, the solution is exact. From sample to sample few
entries change sides, so mostly there is one round.

A network of one projection, sampled: it follows the optimum of a program by what is left of it.

Unlike a zeroing network it does not know how fast the program changes, and lags behind by the rate
of the optimum over its gain. ``implicit`` and ``iterate`` steps go to the program of the next
sample, which its rates tell; a step of ``euler`` is of the program at the sample, as is printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ..arrays import algebra as pivoting
from ..arrays.algebra import (
    Parts,
    clip,
    dot,
    functions_of,
    join,
    matmul,
    matvec,
    repeat,
    scale,
    solve,
    solved_for,
    transpose,
    vecmat,
)
from ..errors import InvalidInputError
from ..inputs.fields import Array, Gain, Weight, validated
from ..inputs.keys import Meaning
from ..robot.clearance import Clearance
from .law import (
    Circumstances,
    ContinuousReading,
    Layout,
    SampledReading,
    Signals,
    State,
)
from .parts.programs import Program, Rates, block_matrix, stacked_rows
from .scheme import LearningProgramLaw, MutualAvoidance, MutualRows

# Rounds of pivoting. Random programs need 5 on average from random starts; of 3200, none needed
# more than 44.
_ROUNDS = 200
# How far an entry may be on the wrong side, as a share of its size: rounding.
_NARROW = 1e-12


class NetworkInstant(NamedTuple):
    """A network at one instant, of N neurons; leading axes of robots are allowed.

    Attributes:
        B: Matrix of what is projected, shape (..., N, N).
        g: Its constant part, shape (..., N).
        lower: Lower bounds of the projection, shape (..., N), infinite for none.
        upper: Upper bounds, likewise.
        R: Matrix of the variables x, shape (..., k, N).
        r: Their constant part, shape (..., k), or 0.
        D: Matrix of what is taken off, shape (..., N, N); None for the identity.
        f: Its constant part, shape (..., N), or 0.
        K: Matrix K, shape (..., N, N); None for the identity.
    """

    B: Array
    g: Array
    lower: Array
    upper: Array
    R: Array
    r: Any = 0.0
    D: Array | None = None
    f: Any = 0.0
    K: Array | None = None

    def optimum(self, y: Array) -> Array:
        """Return the variables x, shape (..., k), of a state y, shape (..., N)."""
        return matvec(self.R, y) + self.r

    def error(self, y: Array) -> Array:
        """Return P(B y + g) - D y - f, shape (..., N); it vanishes where x is the optimum."""
        off = y if self.D is None else matvec(self.D, y)
        return clip(matvec(self.B, y) + self.g, self.lower, self.upper) - off - self.f

    def rate(self, y: Array) -> Array:
        """Return the rate of y at a gain of 1/s, shape (..., N)."""
        return self.along(self.error(y))

    def along(self, error: Array) -> Array:
        """Return the rate of y that an error gives, shape (..., N)."""
        return error if self.K is None else matvec(self.K, error)

    def slope(self, y: Array) -> Array:
        """Return the derivative of `rate` by y, shape (..., N, N)."""
        return self._slope(self._sides(y))

    def stable_below(self) -> float:
        """Return the gain times period from which on an explicit step of one robot is unstable.

        The least of two: with no entry clipped, and with all that have bounds.
        """
        has_bounds: Array = np.where(np.isfinite(self.lower) | np.isfinite(self.upper), 1.0, 0.0)
        least = np.inf
        for sides in (np.zeros_like(has_bounds), has_bounds):
            # Euler's method is stable where |1 + turns value| < 1.
            values: Any = np.linalg.eigvals(self._slope(sides))
            values = values[np.abs(values) > _NARROW]
            if values.size:
                least = min(least, float((-2.0 * values.real / np.abs(values) ** 2).min()))
        return least

    def after(self, y: Array, turns: Any) -> Array:
        """Return the state a step later by Euler's implicit method, shape (..., N).

        Args:
            y: State, shape (..., N).
            turns: Gain times period, a number or of shape (..., 1).
        """
        xp = functions_of(y, self.B)

        def advance(parts: Parts) -> Parts:
            y, sides, fewest, patience, is_done = parts
            solution = self._solution(start, sides, turns)
            ought = self._correct(solution, sides)
            ought, fewest, patience, end = pivoting.update_sides(sides, ought, fewest, patience)
            # What is done stays as it is, whatever other robots need.
            y, sides = xp.where(is_done, y, solution), xp.where(is_done, sides, ought)
            return y, sides, fewest, patience, is_done | end

        start, sides = y, self._sides(y)
        fewest, patience = pivoting.first(sides)
        parts = (y + 0.0 * sides, sides, fewest, patience, fewest < 0.0)
        return repeat(advance, parts, _ROUNDS)[0]

    def _solution(self, start: Array, sides: Array, turns: Any) -> Array:
        """Return the state a step later if the projection clips to these sides."""
        where = functions_of(sides, self.g).where
        offset = where(sides < 0.0, self.lower, where(sides > 0.0, self.upper, self.g)) - self.f
        matrix = np.eye(sides.shape[-1]) - scale(turns, self._slope(sides))
        return solved_for(matrix, start + turns * self.along(offset))

    def _correct(self, y: Array, sides: Array) -> Array:
        """Return the sides of a state; those that it has but for rounding are kept."""
        z, xp = matvec(self.B, y) + self.g, functions_of(y, self.g)
        rounding = _NARROW * (1.0 + xp.abs(z))
        ought = self._sides_of(z)
        near_low, near_high = abs(z - self.lower) <= rounding, abs(z - self.upper) <= rounding
        near = (near_low & (sides <= 0.0)) | (near_high & (sides >= 0.0))
        # What is clipped, and should not be so, is free in the next round, wherever it goes.
        free_sides = xp.where((sides != 0.0) & (ought != sides), 0.0, ought)
        return xp.where(near, sides, free_sides)

    def _sides(self, y: Array) -> Array:
        return self._sides_of(matvec(self.B, y) + self.g)

    def _sides_of(self, z: Array) -> Array:
        """Return which entries are clipped to the lower bound, -1, the upper one, 1, or none, 0."""
        where = functions_of(z).where
        # Where both bounds are the same there is one side.
        free = self.lower < self.upper
        return where(free & (z <= self.lower), -1.0, where(free & (z < self.upper), 0.0, 1.0))

    def _slope(self, sides: Array) -> Array:
        off = np.eye(sides.shape[-1]) if self.D is None else self.D
        slope = functions_of(sides, self.B).where(sides[..., None] == 0.0, self.B, 0.0) - off
        return slope if self.K is None else matmul(self.K, slope)


Network = Literal["lvi", "simplified_lvi", "dual", "simplified_dual"]

#: Networks whose state begins with the variables x.
PRIMAL: tuple[Network, ...] = ("lvi", "simplified_lvi")


class Inequality(NamedTuple):
    """A linear variational inequality, of N = k + m + l entries y = (x, lambda, mu).

    Attributes:
        H: Its matrix, shape (..., N, N).
        p: Its constant part, shape (..., N).
        lower: Lower bounds of the set Omega, shape (..., N).
        upper: Upper bounds, likewise.
    """

    H: Array
    p: Array
    lower: Array
    upper: Array


def project(network: Network, program: Program, damping: Any) -> NetworkInstant:
    """Return a network for a program.

    Args:
        network: Which one.
        program: The program; for ``simplified_dual`` one with bounds or inequalities.
        damping: The small number epsilon.
    """
    if network == "dual":
        return _dual(program, damping)
    if network == "simplified_dual":
        return _simplified_dual(program, damping)
    H, p, lower, upper = inequality(program, damping)
    eye = np.eye(p.shape[-1])
    K = eye + transpose(H) if network == "lvi" else None
    return NetworkInstant(eye - H, -p, lower, upper, eye[: program.c.shape[-1]], K=K)


def neurons(network: Network, k: int, m: int, has_bounds: bool, rows: int = 0) -> int:
    """Return the number of neurons of a network.

    Args:
        network: Which one.
        k: Number of the program's variables.
        m: Number of its equations.
        has_bounds: Whether the variables have bounds.
        rows: Number of its further inequalities.
    """
    bounds = k if has_bounds or network in PRIMAL else 0
    return bounds + rows + (0 if network == "simplified_dual" else m)


def inequality(program: Program, damping: Any) -> Inequality:
    """Return the optimality conditions of a program as a linear variational inequality.

    Args:
        program: The program, of k variables, m equations and l further inequalities.
        damping: The small number epsilon.
    """
    W, c, A, b = program[:4]
    own = scale(damping, np.eye(b.shape[-1]))
    blocks, p = [[W, -transpose(A)], [A, own]], [c, -b]
    lower, upper = [-np.inf + 0.0 * c, -np.inf + 0.0 * b], [np.inf + 0.0 * c, np.inf + 0.0 * b]
    if program.box is not None:
        lower[0], upper[0] = program.box
    if program.C is not None and program.d is not None:
        C, d = program.C, program.d
        none = np.zeros((d.shape[-1], b.shape[-1]))
        blocks[0].append(transpose(C))
        blocks[1].append(none.T)
        own = np.zeros((d.shape[-1], d.shape[-1]))
        if program.soft is not None:
            own = scale(program.soft, np.eye(d.shape[-1]))
        blocks.append([-C, none, own])
        p.append(d)
        lower.append(0.0 * d)
        upper.append(np.inf + 0.0 * d)
    return Inequality(block_matrix(blocks), join(p), join(lower), join(upper))


def iterate(program: Program, damping: Any, y: Array, count: int) -> Array:
    r"""Return the state after a number of iterations of 94LVI, shape (..., N).

    With :math:`e = y - P_\Omega(y - (H y + p))`,

    .. math::
        y \leftarrow P_\Omega(y - \rho (H^T e + H y + p)), \qquad
        \rho = |e|^2 / |(H^T + I) e|^2 .

    An iteration costs two products and no factorisation.

    Args:
        program: The program.
        damping: The small number epsilon.
        y: State to begin with, of the LVI-based networks, shape (..., N).
        count: Number of iterations.
    """
    H, p, lower, upper = inequality(program, damping)
    where = functions_of(p, y).where
    for _ in range(count):
        F = matvec(H, y) + p
        e = y - clip(y - F, lower, upper)
        back = vecmat(e, H)
        length = dot(back + e, back + e)
        rho = dot(e, e) / where(length == 0.0, 1.0, length)
        y = clip(y - rho * (back + F), lower, upper)
    return y


def _weight(program: Program) -> Array:
    """Return W with the leading axes of the robots, and in arrays of their kind."""
    return program.W + 0.0 * program.c[..., None]


def _dual(program: Program, damping: Any) -> NetworkInstant:
    W, c, A, b = _weight(program), *program[1:4]
    E, lower, upper = _bounded_rows(program)
    lead = join((b, lower)), join((b, upper))
    E = A if E is None else stacked_rows([A, E])
    R = solve(W, transpose(E))
    r = -solved_for(W, c)
    N, s = matmul(E, R), matvec(E, r)
    count = N.shape[-1]
    own = np.diag(np.arange(count) < b.shape[-1]).astype(float)
    return NetworkInstant(N - np.eye(count), s, *lead, R, r, N + scale(damping, own), s)


def _simplified_dual(program: Program, damping: Any) -> NetworkInstant:
    W, c, A, b = _weight(program), *program[1:4]
    E, lower, upper = _bounded_rows(program)
    if E is None:
        raise ValueError("simplified_dual: needs a program with bounds or inequalities")
    T, least = solve(W, transpose(A)), solved_for(W, c)
    soft = matmul(A, T) + scale(damping, np.eye(b.shape[-1]))
    s = matvec(T, solved_for(soft, b + matvec(A, least))) - least
    # W^-1 (I - A^T soft^-1 A W^-1) E^T
    back = solve(W, transpose(E))
    R = back - matmul(T, solve(soft, matmul(A, back)))
    N, f = matmul(E, R), matvec(E, s)
    return NetworkInstant(N - np.eye(N.shape[-1]), f, lower, upper, R, s, N, f)


def _bounded_rows(program: Program) -> tuple[Array | None, Array, Array]:
    """Return the rows E = [I; C] of what is bounded, and lower and upper bounds."""
    none = program.c[..., :0]
    rows, lower, upper = [], [none], [none]
    if program.box is not None:
        rows.append(np.eye(program.c.shape[-1]))
        lower.append(program.box[0])
        upper.append(program.box[1])
    if program.C is not None and program.d is not None:
        rows.append(program.C)
        lower.append(-np.inf + 0.0 * program.d)
        upper.append(program.d)
    return stacked_rows(rows) if rows else None, join(lower), join(upper)


Steps = Literal["implicit", "euler", "iterated"]


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
        iterations: Number of iterations per sample if they are ``iterate``.
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

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state: at zero, whatever the optimum is.

        See `Component.init`.
        """
        return {name: np.zeros(shape) for name, shape in self.shapes.items()}

    def step(
        self, state: State, u: Signals, period: float, t: float, program: Program, rates: Rates
    ) -> tuple[Array, State]:
        """Return the optimum at the next sample, as `ZeroingNetwork.step` does."""
        optimum = self._after(self._y(state), program, rates, period)
        return optimum["optimum"], optimum

    def _after(self, y: Array, program: Program, rates: Rates, period: float) -> State:
        """Return the parts of the state at the next sample, by name."""
        now = project(self.network, program, self.damping)
        error = now.error(y)
        left = functions_of(error).abs(error).max(axis=-1, keepdims=True)
        turns = period * self.gain
        if self.steps == "euler":
            # A network that has left its program grows without bound: its controller says so.
            with np.errstate(over="ignore", invalid="ignore"):
                y = y + turns * now.along(error)
                return {**self._by_name(y, now.optimum(y)), "residual_largest": left}
        later = program.ahead(rates, period)
        if self.steps == "iterated":
            y = iterate(later, self.damping, y, self.iterations)
            return {**self._by_name(y, y[..., : self.variables]), "residual_largest": left}
        ahead = project(self.network, later, self.damping)
        y = ahead.after(y, turns)
        return {**self._by_name(y, ahead.optimum(y)), "residual_largest": left}

    def rate(self, parts: Signals, program: Program) -> Array:
        """Return the time derivative of a network that begins with x, shape (..., N).

        Args:
            parts: Its parts of the state, by name.
            program: The program at the time.
        """
        return self.gain * project(self.network, program, self.damping).rate(self._y(parts))

    @property
    def _is_primal(self) -> bool:
        return self.network in PRIMAL

    def _y(self, parts: Signals) -> Array:
        if self._is_primal:
            return join((parts["optimum"], parts["multipliers"]))
        return parts["multipliers"]

    def _by_name(self, y: Array, x: Array) -> State:
        return {"optimum": x, "multipliers": y[..., self.variables :] if self._is_primal else y}


# Gain where steps are implicit, and where they are explicit or Drake's [1/s].
_GAIN, _GAIN_EXPLICIT = 1e8, 100.0
_ITERATIONS = 20


@validated
class Projection(LearningProgramLaw):
    """A dual or primal-dual network around the program of a scheme."""

    kind: Literal["projection"] = "projection"
    follows_objectives = True
    summary = "Projection networks: dual, and primal-dual of a linear variational inequality."
    network: Annotated[
        Network,
        Meaning(
            "``lvi``, the LVI-based primal-dual one, ``dual``, or either ``simplified_lvi`` or "
            "``simplified_dual``.",
        ),
    ] = "lvi"
    gain: Annotated[
        Gain | None,
        Meaning(
            "Gain gamma of the network; by default 1e8 of ``implicit`` steps and 100 of others. "
            "``iterated`` has none.",
            unit="1/s",
        ),
    ] = None
    discretization: Annotated[
        Steps,
        Meaning("``implicit``, ``euler`` or, of ``lvi``, ``iterated``."),
    ] = "implicit"
    iterations: Annotated[
        Annotated[int, Field(strict=True, ge=1, le=1000)] | None,
        Meaning("Number of iterations per sample; only of ``iterated``, by default 20."),
    ] = None
    damping: Annotated[
        Weight,
        Meaning(
            "Damping of the optimum where J loses rank, or where bounds leave no velocity that "
            "does the task.",
            unit="m",
        ),
    ] = 1e-3

    mutual_avoidance: Annotated[
        MutualAvoidance | None,
        Meaning(
            "How links of two arms slow down before each other, by rows of the program; None for "
            "no such rows.",
        ),
    ] = None
    clearance: Annotated[
        Clearance | None,
        Meaning("Capsules of both arms, for these rows; None for nothing."),
    ] = None

    takes_many = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mutual_avoidance is not None:
            self._check_mutual_avoidance()
        if self.network == "simplified_dual" and self.bounds == "none":
            raise ValueError(
                "network: simplified_dual has a neuron for each bound; give bounds: velocity, or "
                "network: dual"
            )
        if self.cost != "velocity" and (
            self.discretization == "euler" or self.network not in ("lvi", "simplified_lvi")
        ):
            raise ValueError(
                f"cost: {self.cost} needs network: lvi or simplified_lvi and discretization: "
                "implicit or iterated; or give cost: velocity"
            )
        is_iterated = self.discretization == "iterated"
        if is_iterated and self.network != "lvi":
            raise ValueError(
                f"discretization: iterated is of network: lvi, not of {self.network}; give "
                "discretization: implicit"
            )
        if is_iterated and self.gain is not None:
            raise ValueError("gain: discretization: iterated has none; leave it out")
        if self.iterations is not None and not is_iterated:
            raise ValueError(
                "iterations: belongs to discretization: iterated, not to "
                f"{self.discretization}; leave it out"
            )

    def _check_mutual_avoidance(self) -> None:
        if self.clearance is None or not self.clearance.mutual_links:
            raise ValueError(
                "mutual_avoidance: needs a clearance of two arms that the law moves; leave it out"
            )
        if self.clearance.size != self.limits.size:
            raise ValueError(
                f"clearance: is of {self.clearance.size} joints; the limits are of "
                f"{self.limits.size}"
            )
        if self.discretization == "euler":
            raise ValueError(
                "mutual_avoidance: needs discretization: implicit or iterated, not euler, whose "
                "stability with its rows is not known"
            )

    @cached_property
    def mutual_rows(self) -> MutualRows | None:
        """See `ProgramLaw.mutual_rows`."""
        if self.mutual_avoidance is None or self.clearance is None:
            return None
        clearance = self.clearance
        return MutualRows(self.mutual_avoidance, clearance.mutual_links, clearance.critical_points)

    @cached_property
    def dynamics(self) -> ProjectionNetwork:
        """The network that the law runs."""
        gain = _GAIN if self.discretization == "implicit" else _GAIN_EXPLICIT
        k, m, count = self.scheme.sizes(self.limits.size)
        count += 0 if self.mutual_rows is None else self.mutual_rows.size
        return ProjectionNetwork(
            self.network,
            k,
            m,
            self.scheme.bounds is not None,
            count - (0 if self.scheme.bounds is None else 2 * k),
            gain if self.gain is None else self.gain,
            self.discretization,
            _ITERATIONS if self.iterations is None else self.iterations,
            self.damping**2,
        )

    def sampled(self, period: float) -> SampledReading:
        """Return a `LearningReading`.

        Raises:
            InvalidInputError: If ``euler`` is unstable at this period, whatever the Jacobian is.
        """
        if self.discretization == "euler":
            self._require_stable(np.zeros((self.task_size, self.limits.size)), period)
        return self._reading(period)

    def continuous(self) -> ContinuousReading:
        """Return a `ContinuousProjection`.

        Raises:
            InvalidInputError: If the network's velocities are no state of it, or it is stepped.
        """
        if self.network not in PRIMAL:
            raise InvalidInputError(
                f"integrator: the velocities of network: {self.network} follow from its signals at "
                "once, which would close a loop without a state; give a period, or network: lvi"
            )
        if self.cost != "velocity":
            raise InvalidInputError(
                f"integrator: Drake integrates the joint velocities alone; with cost: {self.cost} "
                "give a period instead"
            )
        if self.mutual_avoidance is not None:
            raise InvalidInputError(
                "integrator: mutual_avoidance remembers how fast links came near, from sample to "
                "sample; give a period instead"
            )
        if self.discretization != "implicit" or self.learns_jacobian:
            learned_text, exact = "jacobian: learned", f"discretization: {self.discretization}"
            text = learned_text if self.learns_jacobian else exact
            raise InvalidInputError(f"integrator: {text} is of samples; give a period instead")
        return ContinuousProjection(self)

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """See `Law.doubts`.

        Raises:
            InvalidInputError: If ``euler`` is unstable at this period in the posture of the start.
        """
        J, task_J, period = circumstances.J, circumstances.task_J, circumstances.period
        if self.discretization == "euler" and period is not None:
            if self.turns or self.objectives is not None:
                J = None if task_J is None else task_J(self.home)
            if J is not None:
                self._require_stable(J, period)
        return self._learning_doubts("a noise")

    @property
    def arms_thresholds(self) -> tuple[float, float] | None:
        """See `Law.arms_thresholds`."""
        own = self.mutual_avoidance
        return None if own is None else (own.outer, own.inner)

    @property
    def distance_doubt(self) -> str:
        """See `Law.distance_doubt`."""
        if self.mutual_avoidance is None:
            return super().distance_doubt
        return (
            "law.mutual_avoidance: slows links of both arms down before each other, and certifies "
            "no distance; links of one arm, links at rest and obstacles have no rows; "
            "safety.collisions keeps a distance of all"
        )

    def _require_stable(self, J: Array, period: float) -> None:
        n, m = self.limits.size, self.task_size
        box = None if self.scheme.bounds is None else (-np.ones(n), np.ones(n))
        program = Program(np.eye(n), np.zeros(n), J, np.zeros(m), box)
        most = project(self.network, program, self.damping**2).stable_below() / period
        if self.dynamics.gain >= most:
            raise InvalidInputError(
                f"law.gain: must be below {most:.4g} /s at a period of {period:g} s with "
                f"discretization: euler, network: {self.network} and the Jacobian at the start, "
                f"not {self.dynamics.gain:g}; or give discretization: implicit"
            )


@dataclass(frozen=True, eq=False)
class ContinuousProjection(ContinuousReading):
    """A `Projection` law that Drake integrates, of a network that begins with x.

    Attributes:
        law: The law.
    """

    law: Projection

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        shapes = self.law.dynamics.shapes
        return Layout(v=shapes["optimum"], multipliers=shapes["multipliers"])

    @property
    def inputs(self) -> Layout:
        return self.law.inputs

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        v, multipliers = self.state.split(x)
        parts = {"optimum": v, "multipliers": multipliers}
        return self.law.dynamics.rate(parts, self.law.scheme.program(u))
