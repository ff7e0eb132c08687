r"""Laws that move to a target posture while the end effector stays in place.

State adjustment: the arm moves to a target posture while its end effector stays in place.

Source:
    Jin, He, Huang, Wang, "Recurrent neural network for state adjustment of redundant
    manipulators", IEEE Access 8 (2020). SA is (9) with (19), MSA is (10), (11) with (18).

At every instant the network tracks the solution of

.. math::
    \min_v \tfrac12 v^T v + r (q - q_d)^T v \quad \text{s.t.} \quad J v = 0, \quad
    s(t)\, \underline{v}(q) \le v \le s(t)\, \overline{v}(q)

by the projected primal-dual dynamics

.. math::
    \epsilon \dot v = -v + P(-r (q - q_d) - J^T \lambda), \qquad
    \epsilon \dot \lambda = J v.

========  =====================  ==========================================
paper     here                   meaning
========  =====================  ==========================================
sigma     position               joint positions q
sigma_s   target                 target posture q_d
omega     v                      joint velocities (state)
gamma     multipliers            multipliers of J v = 0 (state)
r         rate                   rate of convergence [1/s]
T         rise_time              time over which the velocity bounds open [s]
epsilon   time_constant          time constant of the network [s]
lambda    limit_stiffness        velocity per radian to a position limit [1/s]
========  =====================  ==========================================

Corrected: the paper's envelope sin(pi t / 2T) turns negative after 2T and inverts the
bounds; here it stays at 1 after T. Its (23) lacks a factor 1/2, which changes nothing. Its
text names two joints that start at their speed limit in SA; in fact three do.

Not in the paper:
    J v = epsilon d(multipliers)/dt, so the end effector's displacement is exactly epsilon
    times the change of the multipliers: integral action holds the end effector, which moves
    during the adjustment and returns only if the target lies on the self-motion manifold of
    the start. While the opening bounds of MSA are tight the multipliers wind up, and MSA moves
    the end effector ten times as far as SA. ``ramp_time`` ramps the pull instead of the bounds
    and causes no wind-up. The paper gives no initial v and multipliers; zero reproduces its
    seventh joint.

Null-space adjustment: the arm moves to a target posture while feedback holds the end effector.

Not in any paper: the equilibrium of the network of state adjustment (see `state_adjustment`), plus
feedback of the end effector's position. Without this feedback the errors that a sampled law makes
in each sample would never be corrected. At each sample

.. math::
    v = J^+ k (p_d - p) - S(t)\, r\, (I - J^+ J)(q - q_d), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1},

where S rises smoothly from 0 to 1: the pull is ramped, not the bounds. Joints that would exceed
their bounds are held at them, the worst first, and the others compensate; where too few are left,
the whole motion is slowed down.

The base class of laws that move to a target posture while the end effector stays in place.

The joint velocity within bounds that gives a task velocity, found by holding joints one by one.

The joint that would exceed its bound the most is held at it, and the others compensate, until all
keep theirs. Where too few joints are left, the whole motion is slowed down.

Functions of time that rise from 0 to 1 and stay there.

Times and durations are numbers, or arrays that are broadcast against each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from ..arrays.algebra import (
    Parts,
    clip,
    functions_of,
    in_steps,
    is_one,
    join,
    matmul,
    matvec,
    repeat,
    scale,
    solved_for,
    transpose,
    vecmat,
)
from ..inputs.fields import Array, Gain, GainOrZero, Time, TimeConstant, Vector, Weight, validated
from ..inputs.keys import Meaning
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .law import ContinuousLaw, Layout, SampledLaw, SampledReading, Signals
from .parts.bounded_velocity import kept_with_lag
from .parts.programs import check_substeps, stable_steps


@validated
class PostureLaw(SampledLaw):
    """A law with a target posture."""

    target: Annotated[Vector, Meaning("Target posture, shape (n,).", unit="rad")]
    limits: Annotated[JointLimits, Meaning("Position and velocity limits of the joints.")]
    rate: Annotated[Gain, Meaning("Rate of convergence to the target.", unit="1/s")] = 4.0
    limit_stiffness: Annotated[
        Gain,
        Meaning("Velocity allowed per radian left to a position limit.", unit="1/s"),
    ] = 20.0
    task_size: Annotated[
        Literal[2, 3, 6],
        Meaning("Number of rows of J, all of them held; of 6 rows the first three are rotation."),
    ] = 3

    def __post_init__(self) -> None:
        self.limits.require_size("target", self.target)
        if self.limits.violation(self.target).any():
            raise ValueError(f"target: {self.limits.complaint(self.target)}")

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {"rate": self.rate, "limit_stiffness": self.limit_stiffness}


def column(t: float | Array) -> float | Array:
    """Return times that multiply vectors: a number, or shape (..., 1) of times of shape (...)."""
    return t[..., np.newaxis] if isinstance(t, np.ndarray) and t.ndim else t


def sine_rise(t: float | Array, duration: Any) -> Any:
    """Return a rise along a quarter period of a sine; its slope jumps at the start."""
    xp = functions_of(t, duration)
    return xp.sin(np.pi / 2 * xp.clip(t / duration, 0.0, 1.0))


def smooth_rise(t: float | Array, duration: Any) -> Any:
    """Return a rise along a quintic with zero first and second derivatives at both ends."""
    u = functions_of(t, duration).clip(t / duration, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


@validated
class StateAdjustment(PostureLaw, ContinuousLaw):
    """SA; with a ``rise_time`` MSA, which starts from rest; with a ``ramp_time`` a smoother SA."""

    kind: Literal["state_adjustment"] = "state_adjustment"
    summary = (
        "State adjustment: the arm moves to a target posture while its end effector stays in place."
    )
    rise_time: Annotated[
        Time | None,
        Meaning("Time over which the velocity bounds open; None keeps them open.", unit="s"),
    ] = None
    ramp_time: Annotated[
        Time | None,
        Meaning(
            "Time over which the pull towards the target rises, without a jump of velocity or "
            "acceleration; None for the full pull at once. Not in the paper.",
            unit="s",
        ),
    ] = None
    time_constant: Annotated[
        TimeConstant,
        Meaning(
            "Time constant of the network; the end effector's drift is proportional to it.",
            unit="s",
        ),
    ] = 1e-3

    takes_many = True

    def __post_init__(self) -> None:
        super().__post_init__()
        has_no_bound = ~np.isfinite(self.limits.velocity)
        if self.rise_time is not None and has_no_bound.any():
            raise ValueError(
                "rise_time: needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(has_no_bound)) + 1} has none; give limits.velocity"
            )

    @property
    def keeps(self) -> tuple[str, ...]:
        return kept_with_lag(self.limit_stiffness, self.time_constant)

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,), multipliers=(self.task_size,))

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        return Layout(position=(n,), J=(self.task_size, n))

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        return Layout(
            velocity_lower=(n,),
            velocity_upper=(n,),
            saturated=(1,),
            displacement=(min(self.task_size, 3),),
        )

    def velocity_box(self, t: Any, q: Array) -> tuple[Array, Array]:
        """Return the velocities allowed at a time: lower and upper, shape (..., n) [rad/s].

        Args:
            t: The time, a number or of shape (..., 1) [s].
            q: Joint positions, shape (..., n) [rad].
        """
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        if self.rise_time is None:
            return lower, upper
        opening = sine_rise(t, self.rise_time)
        return opening * lower, opening * upper

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the right-hand side of (18) and (19)."""
        return self._rates(t, x, u)

    def _rates(self, t: Any, x: Array, u: Signals) -> Array:
        """Return the right-hand side at a time, a number or of shape (..., 1)."""
        v, multipliers = self.state.split(x)
        J, q = u["J"], u["position"]
        sought = self._pull(t, q) - vecmat(multipliers, J)
        lower, upper = self.velocity_box(t, q)
        v_dot = clip(sought, lower, upper) - v
        return self.state.join(v_dot, matvec(J, v)) / self.time_constant

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If the law would overshoot at this period, or its network would take
                too many substeps.
        """
        check_substeps(period / self.time_constant, f"time_constant: {self.time_constant:g} s")
        return super().sampled(period)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Integrate by Heun's method, with inputs held, in steps that keep the network stable."""

        def advance(parts: Parts, k: Any, h: Any) -> Parts:
            (x,) = parts
            begin = t + k * h
            k1 = self._rates(begin, x, u)
            k2 = self._rates(begin + h, x + h * k1, u)
            return (x + h / 2 * (k1 + k2),)

        count = stable_steps(period / self.time_constant, u["J"])
        (x,) = in_steps(advance, (x,), period, count)
        return x

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        multipliers = self.state.part(x, "multipliers")
        lower, upper = self.velocity_box(column(t), u["position"])
        pull = functions_of(x).einsum("...m,...mn->...n", multipliers, u["J"])
        sought = self._pull(column(t), u["position"]) - pull
        outside = ((sought < lower) | (sought > upper)).any(axis=-1, keepdims=True)
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": outside.astype(float),
            "displacement": self.time_constant * multipliers[..., -3:],
        }

    def _pull(self, t: Any, q: Array) -> Array:
        pull = self.rate * (self.target - q)
        if self.ramp_time is None:
            return pull
        return smooth_rise(t, self.ramp_time) * pull


def velocity_within(
    J: Array, task_velocity: Array, pull: Array, bounds: tuple[Array, Array], damping: Any
) -> Array:
    """Return the velocities within bounds, nearest to ``pull``, that give ``task_velocity``.

    Args:
        J: Jacobian, shape (..., m, n).
        task_velocity: Desired velocity of the end effector, shape (..., m).
        pull: Joint velocities to come close to, shape (..., n) [rad/s].
        bounds: Lower and upper velocities, shape (..., n) [rad/s].
        damping: Damping mu of the pseudoinverse [m].
    """
    m, n = J.shape[-2:]
    damping_matrix = scale(damping**2, np.eye(m))
    lower, upper = bounds

    def tried(free: Array, hold: Array) -> tuple[Array, Array]:
        """Return the velocities with some joints held, and by how much free ones are too fast."""
        J_free = J * free[..., np.newaxis, :]
        gram = matmul(J_free, transpose(J_free)) + damping_matrix
        v = hold + free * pull
        missing = task_velocity - matvec(J, v)
        v = v + matvec(transpose(J_free), solved_for(gram, missing))
        return v, functions_of(v).maximum(lower - v, v - upper) * free

    def advance(parts: Parts) -> Parts:
        before, free, hold, keeps, ends = parts
        v, excess = tried(free, hold)
        xp = functions_of(v)
        v = xp.where(ends, before, v)
        too_fast = excess.max(axis=-1, keepdims=True)
        keeps = keeps | ~ends & (too_fast <= 0.0)
        few = free.sum(axis=-1, keepdims=True) <= m
        ends = ends | keeps | few | ~xp.isfinite(v).all(axis=-1, keepdims=True)
        worst = ~ends & (np.arange(n) == excess.argmax(axis=-1)[..., np.newaxis])
        hold = xp.where(worst, clip(v, lower, upper), hold)
        return v, xp.where(worst, 0.0, free), hold, keeps, ends

    if is_one(pull):
        v, keeps = _of_one(tried, m, n, lower, upper)
        return v if keeps else _slow(v, lower, upper)
    xp = functions_of(J, task_velocity, pull)
    shape = np.broadcast_shapes(J.shape[:-2], pull.shape[:-1], lower.shape[:-1])
    zeros, no = xp.zeros((*shape, n)), xp.zeros((*shape, 1), bool)
    parts = repeat(advance, (zeros, zeros + 1.0, zeros, no, no), n)
    return xp.where(parts[3], parts[0], _slow(parts[0], lower, upper))


def _of_one(trial: Any, m: int, n: int, lower: Array, upper: Array) -> tuple[Array, bool]:
    """Return the velocities of one robot, and whether they are within their bounds."""
    free, hold = np.ones(n), np.zeros(n)
    for _ in range(n):
        v, excess = trial(free, hold)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            return v, True
        if free.sum() <= m or not np.isfinite(v).all():
            break
        free[worst] = 0.0
        hold[worst] = min(max(v[worst], lower[worst]), upper[worst])
    return v, False


def _slow(v: Array, lower: Array, upper: Array) -> Array:
    """Return the velocities, as far towards ``v`` from those nearest to rest as bounds permit."""
    xp = functions_of(v, lower)
    rest = clip(xp.zeros(v.shape), lower, upper)
    change = v - rest
    room = xp.where(change > 0, upper - rest, rest - lower)
    far = xp.abs(change) > room
    share = xp.where(far, room / xp.where(far, xp.abs(change), 1.0), 1.0)
    return rest + share.min(axis=-1, keepdims=True) * change


@validated
class NullSpaceAdjustment(PostureLaw):
    """A sampled law without memory; its state is the commanded velocity.

    It holds a fixed point and does not track a moving one, because it has no feed-forward.
    """

    kind: Literal["null_space_adjustment"] = "null_space_adjustment"
    summary = (
        "Null-space adjustment: the arm moves to a target posture while feedback holds the end "
        "effector."
    )
    ramp_time: Annotated[
        Time,
        Meaning("Time over which the pull towards the target rises.", unit="s"),
    ] = 0.75
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain of the feedback of the end effector's displacement.", unit="1/s"),
    ] = 50.0
    damping: Annotated[
        Weight,
        Meaning(
            "Damping mu of the pseudoinverse; small compared to the singular values of J.",
            unit="m",
        ),
    ] = 1e-3

    takes_many = True

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {**super().sampled_gains, "feedback": self.feedback}

    @property
    def keeps(self) -> tuple[str, ...]:
        return ("position", "velocity")

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        n, m = self.limits.size, self.task_size
        position = {"p_WE": (min(m, 3),), "p_WE_desired": (min(m, 3),)}
        rotation = {"R_WE": (3, 3), "R_WE_desired": (3, 3)} if m == 6 else {}
        return Layout(position=(n,), J=(m, n), **position, **rotation)

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        return Layout(velocity_lower=(n,), velocity_upper=(n,), saturated=(1,))

    def velocity_box(self, t: Any, q: Array) -> tuple[Array, Array]:
        """Return the velocities allowed at a time: lower and upper, shape (..., n) [rad/s].

        A joint that starts outside its limits is brought back gradually, like the pull.

        Args:
            t: The time, a number or of shape (..., 1) [s].
            q: Joint positions, shape (..., n) [rad].
        """
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        share = smooth_rise(t, self.ramp_time)
        where = functions_of(q).where
        return where(lower > 0, share * lower, lower), where(upper < 0, share * upper, upper)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        q = u["position"]
        error = u["p_WE_desired"] - u["p_WE"]
        if self.task_size == 6:
            error = join((rotation_error(u["R_WE"], u["R_WE_desired"]), error))
        pull = smooth_rise(t, self.ramp_time) * self.rate * (self.target - q)
        bounds = self.velocity_box(t, q)
        return velocity_within(u["J"], self.feedback * error, pull, bounds, self.damping)

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        lower, upper = self.velocity_box(column(t), u["position"])
        at_bound = (x <= lower + 1e-9) | (x >= upper - 1e-9)
        at_bound &= upper - lower > 1e-9
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": at_bound.any(axis=-1, keepdims=True).astype(float),
        }
