r"""A scheme: what a redundant arm's velocities minimise, what they must do, and their bounds.

A network (`drake_rnn.laws.zeroing`) follows the optimum of the program that a scheme is
at each instant. The two know nothing of each other but that program.

Equations of a scheme: what the joint velocities x must do.

The end effector follows its path with a feedback of its position, and of its orientation as the
rotation vector from the actual to the desired one:

.. math::
    J x = b, \qquad b = \dot p_d + K (p_d - p), \qquad
    \dot b = \ddot p_d + K (\dot p_d - J x) .

Costs of a scheme at the velocity level: what is minimised of the joint velocities v.

====================  =====================================================  =======================
``cost``              minimised                                              known as
====================  =====================================================  =======================
``velocity``          v^T v / 2 + k (q - q_0)^T v - g dw(q)/dq v             least velocity (MVN);
                                                                             with k repetitive
                                                                             motion (RMP); with g
                                                                             manipulability
``kinetic_energy``    v^T M v / 2 + k (q - q_0)^T M v                        inertia-weighted
                                                                             pseudoinverse
``largest_velocity``  alpha (v^T v / 2 + k (q - q_0)^T v) + (1 - alpha) s,   bi-criteria with the
                      -s <= v_i <= s                                         infinity norm
====================  =====================================================  =======================

q_0 is the posture at the start: a closed path then ends near it, as in the null space of the task
the joints move towards q_0 at the rate k. w is the logarithm of the manipulability,
w = ln sqrt(det J J^T), M the joints' inertia. s is a variable of its own. `BarrierOfVelocity` is
the cost of a zeroing network with ``prescribed``.

Sources:
    Least velocity and repetitive motion are standard; the latter was read in the public code of a
    varying-parameter network (``vp-rnn``). The others are from memory: Whitney, "Resolved motion
    rate control of manipulators and human prostheses" (1969), weighs velocities by the inertia;
    Yoshikawa, "Manipulability of robotic mechanisms" (1985), has its gradient in the null space;
    Zhang, Cai et al., Advanced Robotics 22 (2008), have the bi-criteria cost, of which an abstract
    was read.

Bounds of a scheme: joint velocities within their limits, position limits folded in.

Rows that slow links of two arms down before each other, of Zhang, Zheng, Chen, Kong, Karimi,
"Mutual-collision-avoidance scheme synthesized by neural networks for dual redundant robot
manipulators executing cooperative tasks", IEEE Transactions on Neural Networks and Learning Systems
32 (2021), whose text was read. Of each link, P is the point that is nearest the other arm, E the
point there, r = E - P and d how far the two are apart. Where d < d_2,

.. math::
    r \diamond J_P \dot q \le S(d) \max(r \diamond J_P \dot q |_{d = d_2}, 0), \qquad
    S(d) = \sin^2 \frac{\pi}{2} \frac{d - d_1}{d_2 - d_1},

and S = 0 where d <= d_1. The product takes each coordinate by itself, as it is printed, or all of
them together: a scalar product, for which the axes of the world do not matter. Nothing is certified
by these rows: links of one arm, links at rest and obstacles have none, d is that of one posture,
and a link has one row: two of its pairs can take turns from sample to sample, and both come nearer.

Laws whose network follows the optimum extend `ProgramLaw`, or `LearningProgramLaw` if their
Jacobian may be learned; a clock steps `ProgramReading`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, Literal, Protocol

import numpy as np

from ..arrays.algebra import acts, functions_of, join, matvec, scale
from ..inputs.fields import Array, Gain, GainOrZero, Length, Positive, Vector, between, validated
from ..inputs.keys import Meaning, Only
from ..robot.clearance.clearance import CriticalPoints
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from ..robot.task_objectives import RowBlock
from .law import Component, Law, Layout, SampledReading, Signals, State
from .parts.jacobian import JacobianKeys, LearnedJacobian, SignalRates
from .parts.programs import Program, Rates, stacked_rows
from .parts.secondary import manipulability_gradient

Shapes = dict[str, tuple[int, ...]]

# Time over which the rate of a gradient is a difference, along the rates of the Jacobians [s].
_SHORT = 1e-4


class Cost(Protocol):
    """What a scheme minimises, 1/2 x^T W x + c^T x, where x begins with the joint velocities."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that it sees, by name."""

    @property
    def slacks(self) -> int:
        """Number of variables besides the joint velocities; each is bounded by `rows`."""

    def rows(self) -> tuple[Array, Array] | None:
        """Return constant rows C and right-hand sides d of its inequalities; None for none."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """Return W and c, shapes (..., k, k) and (..., k)."""

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """Return the time derivatives of W and c; None for what is constant.

        Args:
            u: Signals.
            u_dot: Time derivatives of those of them that no other signal tells.
            x: Joint velocities, shape (..., n) [rad/s].
        """


@dataclass(frozen=True, eq=False)
class ReturningVelocity:
    """The velocity's square, a way back and a way to postures of more manipulability.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s]; 0 for the least velocity.
        manipulability: Gain g of the gradient of the manipulability [rad/s]; 0 for none.
        task_size: Number of rows of J, 3 or 6; needed with that gain.
    """

    home: Array
    return_gain: Any
    manipulability: Any = 0.0
    task_size: int = 3

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        n = self.home.shape[-1]
        shapes: Shapes = {"position": (n,)}
        if acts(self.manipulability):
            shapes |= {"J": (self.task_size, n), "J_omega": (3, n)}
        return shapes

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        c = self.return_gain * (u["position"] - self.home)
        if acts(self.manipulability):
            c = c - self.manipulability * manipulability_gradient(u["J"], u["J_omega"])
        return np.eye(self.home.shape[-1]), c

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        rate = self.return_gain * x if acts(self.return_gain) else None
        if not acts(self.manipulability):
            return None, rate
        now, later = (
            manipulability_gradient(*(u[name] + ahead * u_dot[name] for name in ("J", "J_omega")))
            for ahead in (0.0, _SHORT)
        )
        turning = self.manipulability / _SHORT * (now - later)
        return None, turning if rate is None else rate + turning


@dataclass(frozen=True, eq=False)
class KineticEnergy:
    """The kinetic energy, and a way back of the same rate in all directions.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s].
    """

    home: Array
    return_gain: Any

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        n = self.home.shape[-1]
        return {"position": (n,), "M": (n, n)}

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        return u["M"], self.return_gain * matvec(u["M"], u["position"] - self.home)

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        away = u["position"] - self.home
        return u_dot["M"], self.return_gain * (matvec(u_dot["M"], away) + matvec(u["M"], x))


@dataclass(frozen=True, eq=False)
class BarrierOfVelocity:
    """The barrier of `drake_rnn.laws.zeroing`, and a way back of that rate near rest.

    Near rest it weighs each velocity by 4 over the square of its limit, which is W.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s].
        fastest: Limits of the joint velocities, shape (n,) [rad/s].
    """

    home: Array
    return_gain: Any
    fastest: Array

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        return {"position": (self.home.shape[-1],)}

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        weights = 4.0 / (self.fastest * self.fastest)
        pull = self.return_gain * weights * (u["position"] - self.home)
        return weights[..., None] * np.eye(self.home.shape[-1]), pull

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        return None, self.return_gain * 4.0 / (self.fastest * self.fastest) * x


@dataclass(frozen=True, eq=False)
class LargestVelocity:
    """The largest joint velocity s, blended with the square of all.

    Attributes:
        square: The cost that it is blended with, without slacks.
        blend: The weight alpha of that cost, above 0 and below 1: at 1 nothing determines s.
    """

    square: ReturningVelocity
    blend: Any

    slacks = 1

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        return self.square.inputs

    def rows(self) -> tuple[Array, Array]:
        """See `Cost.rows`."""
        n = self.square.home.shape[-1]
        eye, one = np.eye(n), np.ones((n, 1))
        return np.block([[eye, -one], [-eye, -one]]), np.zeros(2 * n)

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        W, c = self.square.terms(u)
        weights = np.pad(W, (0, 1))
        linear = join((self.blend * c, 0.0 * c[..., :1] + (1.0 - self.blend)))
        return scale(self.blend, weights), linear

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        _, c = self.square.rates(u, u_dot, x)
        return None, None if c is None else join((self.blend * c, 0.0 * c[..., :1]))


class Rows(Protocol):
    """Equations A x = b of a scheme."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that they see, by name."""

    @property
    def size(self) -> int:
        """Number m of equations."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """Return A and b, shapes (..., m, k) and (..., m)."""

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """Return the time derivatives of A and b, as `Cost.rates` does."""


@dataclass(frozen=True, eq=False)
class EndEffectorVelocity:
    """The end effector's velocity along its path, with feedback.

    Attributes:
        joints: Number n of joints.
        size: Number m of rows of J.
        feedback: Gain K of the feedback [1/s].
        turns: Whether they are those of a pose, the first three of rotation; by default 6 are.
    """

    joints: int
    size: int
    feedback: Any
    turns: bool | None = None

    @property
    def inputs(self) -> Shapes:
        """See `Rows.inputs`."""
        axes = 3 if self._turns else self.size
        shapes: Shapes = {"J": (self.size, self.joints), "p_WE": (axes,)}
        shapes |= {f"{letter}_WE_desired": (axes,) for letter in "pva"}
        if self._turns:
            shapes |= {"R_WE": (3, 3), "R_WE_desired": (3, 3)}
            shapes |= {"w_WE_desired": (3,), "alpha_WE_desired": (3,)}
        return shapes

    @property
    def _turns(self) -> bool:
        return self.size == 6 if self.turns is None else self.turns

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Rows.terms`."""
        away, v_desired = u["p_WE_desired"] - u["p_WE"], u["v_WE_desired"]
        if self._turns:
            away = join((rotation_error(u["R_WE"], u["R_WE_desired"]), away))
            v_desired = join((u["w_WE_desired"], v_desired))
        return u["J"], v_desired + self.feedback * away

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Rows.rates`; that of a rotation vector is exact as it vanishes."""
        v_desired, onward = u["v_WE_desired"], u["a_WE_desired"]
        if self._turns:
            v_desired = join((u["w_WE_desired"], v_desired))
            onward = join((u["alpha_WE_desired"], onward))
        return u_dot["J"], onward + self.feedback * (v_desired - matvec(u["J"], x))


class Bounds(Protocol):
    """Lower and upper bounds of a scheme's variables x."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that they see, by name."""

    def box(self, u: Signals) -> tuple[Array, Array]:
        """Return the lower and upper bounds, shape (..., k) each."""

    def rates(self, u: Signals, x: Array) -> tuple[Array, Array]:
        """Return their time derivatives, shape (..., k) each."""


@dataclass(frozen=True, eq=False)
class VelocityBox:
    """Velocities that approach a position limit no faster than in proportion to the way left.

    Attributes:
        limits: Limits of the joints; that of the velocity is finite.
        stiffness: Velocity allowed per radian left to a position limit [1/s].
    """

    limits: JointLimits
    stiffness: Any

    @property
    def inputs(self) -> Shapes:
        """See `Bounds.inputs`."""
        return {"position": (self.limits.size,)}

    def box(self, u: Signals) -> tuple[Array, Array]:
        """See `Bounds.box`."""
        return self.limits.velocity_box(u["position"], self.stiffness)

    def rates(self, u: Signals, x: Array) -> tuple[Array, Array]:
        """See `Bounds.rates`; zero where the velocity limit is the narrower one."""
        lower, upper = self.box(u)
        fastest = self.limits.velocity
        where = functions_of(lower, x).where
        narrower = (abs(lower) < fastest), (abs(upper) < fastest)
        closing = -self.stiffness * x
        return where(narrower[0], closing, 0.0), where(narrower[1], closing, 0.0)


@validated
class MutualAvoidance:
    """How links of two arms slow down before each other; nothing of it is certified."""

    inner: Annotated[
        Length,
        Meaning("Distance d1 at which a link is to come no nearer to the other arm.", unit="m"),
    ] = 0.02
    outer: Annotated[
        Length,
        Meaning("Distance d2 below which a link's row is in force.", unit="m"),
    ] = 0.1
    product: Annotated[
        Literal["scalar", "coordinates"],
        Meaning(
            "``scalar``, a row for each link: its point may not come nearer; ``coordinates``, "
            "three, as printed: it may not along any axis of the world.",
        ),
    ] = "scalar"
    fading: Annotated[
        bool,
        Meaning(
            "Whether a link may approach as it did at ``outer``, less and less until ``inner``; "
            "else not at all from ``outer`` on.",
        ),
    ] = True

    def __post_init__(self) -> None:
        if not self.outer > self.inner:
            raise ValueError(
                f"outer: must be greater than inner, {self.inner:g} m, not {self.outer:g}"
            )


# Bound of a row that is not in force: it is never met [m^2/s].
_NEVER_MET = 1e3


@dataclass(frozen=True, eq=False)
class MutualRows:
    """The rows of `MutualAvoidance`, with what they remember: how links came within ``outer``.

    Of a link that begins there, no approach is remembered.

    Attributes:
        settings: The thresholds and the form.
        links: Number L of links that have rows.
        points: Returns where they are nearest the other arm, of joint positions, shape (..., n).
    """

    settings: MutualAvoidance
    links: int
    points: Callable[[Array], CriticalPoints]

    @property
    def _each(self) -> int:
        return 1 if self.settings.product == "scalar" else 3

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.links * self._each

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"approach": (self.size,), "is_near": (self.links,)}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {"approach": np.zeros(self.size), "is_near": np.ones(self.links)}

    def step(
        self, state: State, u: Signals, period: float, v: Array
    ) -> tuple[tuple[Array, Array], State]:
        """Return C and d of the rows C v <= d; see `Component.step`.

        Args:
            state: See `Component.step`.
            u: Signals, of which ``position`` is seen.
            period: Not needed.
            v: Joint velocities of the network before, shape (..., n) [rad/s].
        """
        gaps, ways, J = self.points(u["position"])
        own, xp = self.settings, functions_of(gaps, v)
        C = ways[..., None] * J
        if own.product == "scalar":
            C = C.sum(axis=-2)
        else:
            C = C.reshape((*C.shape[:-3], self.size, C.shape[-1]))
        is_near = 1.0 * (gaps < own.outer)
        enters = self._of_rows(is_near * (1.0 - state["is_near"]))
        approach = xp.where(enters > 0.0, xp.maximum(matvec(C, v), 0.0), state["approach"])
        share = xp.maximum(gaps - own.inner, 0.0) / (own.outer - own.inner)
        fade = self._of_rows(xp.sin(0.5 * np.pi * share) ** 2) if own.fading else 0.0
        d = xp.where(self._of_rows(is_near) > 0.0, fade * approach, _NEVER_MET)
        return (C, d), {"approach": approach, "is_near": is_near}

    def _of_rows(self, values: Any) -> Array:
        """Return what each link has, shape (..., L), of each of its rows."""
        of_rows: Array = functions_of(values).repeat(values, self._each, axis=-1)
        return of_rows


#: Signals whose rates no other signal tells: they are taken by differences of samples.
DIFFERENTIATED_SIGNALS = ("J", "J_omega", "M")


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
    def differentiated_signals(self) -> Shapes:
        """Shapes of those signals among them whose rates `rates` is to be told."""
        return {
            name: shape for name, shape in self.inputs.items() if name in DIFFERENTIATED_SIGNALS
        }

    def sizes(self, joints: int) -> tuple[int, int, int]:
        """Return the numbers of variables, equations and inequalities.

        Args:
            joints: Number n of joints.
        """
        k, rows = joints + self.cost.slacks, self.cost.rows()
        box = 0 if self.bounds is None else 2 * k
        return k, self.rows.size, box + (0 if rows is None else rows[1].size)

    def program(self, u: Signals, further: tuple[Array, Array] | None = None) -> Program:
        """Return the program at an instant.

        Args:
            u: Signals.
            further: Further inequalities C v <= d of the joint velocities, see `MutualRows`.
        """
        W, c = self.cost.terms(u)
        A, b = self.rows.terms(u)
        box = None if self.bounds is None else self._wider_box(*self.bounds.box(u))
        rows = [] if (own := self.cost.rows()) is None else [own]
        if further is not None:
            rows.append((self._wider(further[0]), further[1]))
        if not rows:
            return Program(W, c, self._wider(A), b, box)
        C, d = zip(*rows, strict=True)
        # As many robots as the rest has.
        sides = join([each + 0.0 * c[..., :1] for each in d])
        return Program(W, c, self._wider(A), b, box, stacked_rows(list(C)), sides)

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
        return self._wider(lower), join((upper, most))


@validated
class ProgramLaw(Law):
    """A law with a scheme: a cost along a path, within bounds if they are asked for."""

    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joints; with ``bounds: velocity`` those of position and velocity."),
    ]
    home: Annotated[
        Vector,
        Meaning("Posture at the start, which the joints return to, shape (n,).", unit="rad"),
    ]
    task_size: Annotated[
        Literal[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
        Meaning("Number of rows of J; of 6 rows the first three are rotation, but of objectives."),
    ] = 3
    objectives: Annotated[
        tuple[RowBlock, ...] | None,
        Meaning("What is known of the rows of objectives; None for a position or a pose."),
    ] = None
    cost: Annotated[
        Literal["velocity", "kinetic_energy", "largest_velocity"],
        Meaning(
            "What is minimised: ``velocity``, ``kinetic_energy`` or ``largest_velocity``, see "
            "`drake_rnn.laws.scheme`.",
        ),
    ] = "velocity"
    return_gain: Annotated[
        GainOrZero,
        Meaning(
            "Gain k of the way back to that posture; 0 for the least velocity alone.",
            unit="1/s",
        ),
    ] = 1.0
    manipulability: Annotated[
        GainOrZero,
        Meaning(
            "Gain of the gradient of the manipulability [rad/s], with ``cost: velocity``.",
            unit="rad/s",
        ),
    ] = 0.0
    blend: Annotated[
        Positive,
        between(1e-3, 0.99),
        Meaning(
            "Weight of the velocity's square beside the largest velocity; nearly 1 has the "
            "square alone.",
            unit="1",
            only=(Only("cost", "largest_velocity"),),
        ),
    ] = 0.1
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain K of the feedback of position and orientation.", unit="1/s"),
    ] = 10.0
    bounds: Annotated[
        Literal["none", "velocity"],
        Meaning(
            "``velocity`` has the limits of position and velocity as inequalities of the "
            "program, which the network fulfils as well as it follows its optimum; ``none`` has "
            "none.",
        ),
    ] = "none"
    limit_stiffness: Annotated[
        Gain,
        Meaning(
            "Velocity allowed per radian left to a position limit [1/s], where the program has "
            "bounds.",
            unit="1/s",
        ),
    ] = 10.0

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        has_no_bound = ~np.isfinite(self.limits.velocity)
        if self._has_bounds and has_no_bound.any():
            raise ValueError(
                f"{self._bounding} needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(has_no_bound)) + 1} has none; give limits.velocity"
            )

        if self.objectives is None and self.task_size > 6:
            raise ValueError(f"task_size: may be 1 to 6 without objectives, not {self.task_size}")
        if self.manipulability and (self.cost != "velocity" or self.task_size not in (3, 6)):
            raise ValueError(
                "manipulability: needs cost: velocity and task: xyz or pose; leave it out"
            )

    @property
    def _bounding(self) -> str:
        """What has bounds in the program, as a document says it; empty without bounds."""
        return "" if self.bounds == "none" else f"bounds: {self.bounds}"

    @property
    def _has_bounds(self) -> bool:
        return bool(self._bounding)

    @property
    def turns(self) -> bool:
        """Whether the task is a pose."""
        return self.task_size == 6 and self.objectives is None

    @property
    def mutual_rows(self) -> MutualRows | None:
        """Rows of the program that slow links of two arms down; None for none."""
        return None

    @property
    def _cost(self) -> Cost:
        if self.cost == "kinetic_energy":
            return KineticEnergy(self.home, self.return_gain)
        square = ReturningVelocity(self.home, self.return_gain, self.manipulability, self.task_size)
        return square if self.cost == "velocity" else LargestVelocity(square, self.blend)

    @cached_property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""
        return QPScheme(
            self._cost,
            EndEffectorVelocity(self.limits.size, self.task_size, self.feedback, self.turns),
            VelocityBox(self.limits, self.limit_stiffness) if self._has_bounds else None,
        )

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        stiffness = {"limit_stiffness": self.limit_stiffness} if self._has_bounds else {}
        return {"feedback": self.feedback, "return_gain": self.return_gain, **stiffness}

    @property
    def limits_remedy(self) -> str:
        return "safety: {bounds: true} does"


# Parts of a network's state that are recorded, by the names of observables.
_METRIC_NAMES = {"residual": "residual_largest", "funnel_share": "funnel_used"}


#: A network that follows the optimum of a program: of the time, the program and how fast it changes
#: it finds the optimum x at the next sample. Among its parts of the state are ``optimum``, these
#: variables, and ``residual_largest``; it reads ``samples`` too, the number of samples before.
FollowingNetwork = Component[[float, Program, Rates], Array]


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

    @property
    def mutual_rows(self) -> MutualRows | None:
        """See `ProgramLaw.mutual_rows`."""


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
        parts = {name: shape for part in self._components for name, shape in part.shapes.items()}
        return Layout(v=(n,), **parts, samples=(1,))

    @property
    def _components(self) -> tuple[Component[..., Any], ...]:
        further = (self.learned_jacobian, self.law.mutual_rows)
        return (self.law.dynamics, self._rates, *(part for part in further if part is not None))

    @cached_property
    def inputs(self) -> Layout:
        return self.law.inputs

    @cached_property
    def observables(self) -> Layout:
        parts = self.state.parts
        return Layout(**{name: (1,) for name, part in _METRIC_NAMES.items() if part in parts})

    @property
    def learned_jacobian(self) -> LearnedJacobian | None:
        """Where its Jacobian comes from if it is learned; None if it is told."""
        return None

    @cached_property
    def _rates(self) -> SignalRates:
        signals = self.law.scheme.differentiated_signals
        return SignalRates(
            {k: s for k, s in signals.items() if k != "J" or self.learned_jacobian is None}
        )

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        start = {"v": np.zeros(self.law.limits.size), "samples": np.zeros(1)}
        for part in self._components:
            start |= part.init(u, rng)
        return self.state.from_parts(start)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        state, scheme = self.state.by_name(x), self.law.scheme
        count, before = state["samples"], state["optimum"]
        u_dot, rate_state = self._rates.step(state, u, period)
        if self.learned_jacobian is not None:
            J, learned = self.learned_jacobian.step(state, u, period)
            u, rate_state = {**u, "J": J}, {**rate_state, **learned}
            u_dot = {**u_dot, "J": 0.0 * J}
        further, rows = None, self.law.mutual_rows
        if rows is not None:
            v = before[..., : self.law.limits.size]
            further, mutual = rows.step(state, u, period, v)
            rate_state = {**rate_state, **mutual}
        program, rates = scheme.program(u, further), scheme.rates(u, u_dot, before)
        optimum, network = self.law.dynamics.step(state, u, period, t, program, rates)
        # The joint velocities come before what else the program has.
        v = 0.5 * (before + optimum)[..., : self.law.limits.size]
        return self.state.from_parts({"v": v, **network, **rate_state, "samples": count + 1.0})

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {name: self.state.part(x, _METRIC_NAMES[name]) for name in self.observables.parts}


@validated
class LearningProgramLaw(JacobianKeys, ProgramLaw):
    """A law of a program whose Jacobian is known, or learned from positions."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.manipulability and self.learns_jacobian:
            raise ValueError("manipulability: needs jacobian: known; leave it out")

    @property
    @abstractmethod
    def dynamics(self) -> FollowingNetwork:
        """The network that the law runs."""

    def _reading(self, period: float) -> LearningReading:
        """Return the reading with the numbers that suit its measurement, at a period [s]."""
        suits = self._learning_for(period)
        law = replace(self, variance=suits.variance, wander=suits.wander)
        return LearningReading(law, suits.samples, suits.still)

    @property
    def inputs(self) -> Layout:
        shapes = self.scheme.inputs
        if self.learns_jacobian:
            del shapes["J"]
            shapes |= {"position": (self.limits.size,)}
        return Layout(**shapes)

    @property
    def state(self) -> Layout:
        n, m = self.limits.size, self.task_size
        jacobian_part = {"J_hat": (m, n)} if self.learns_jacobian else {}
        return Layout(v=(n,), **self.dynamics.shapes, **jacobian_part)


@dataclass(frozen=True, eq=False)
class LearningReading(ProgramReading):
    """The sampled reading of a `LearningProgramLaw`.

    Attributes:
        law: The law, with the numbers that suit its measurement.
        samples: Number of samples over which velocities are difference quotients.
        still: Joint speed below which nothing is learned [rad/s].
    """

    law: LearningProgramLaw
    samples: int
    still: float

    @cached_property
    def learned_jacobian(self) -> LearnedJacobian | None:
        """See `ProgramReading.learned_jacobian`."""
        law = self.law
        if law.jacobian == "known":
            return None
        shape = (law.task_size, law.limits.size)
        return law.learned_jacobian(shape, self.samples, self.still, turns=law.turns)
