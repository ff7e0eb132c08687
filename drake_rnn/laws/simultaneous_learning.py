r"""Simultaneous learning and control: the arm tracks a path while it learns its own Jacobian.

Source:
    Liu, Fan, Zheng, Li, Jin, "A simultaneous learning and control scheme for redundant
    manipulators with physical constraints on decision variable and its derivative", IEEE
    Transactions on Industrial Electronics 69 (2022). RNN (16) has J and no bound on the
    acceleration, (19) has J and the bound, (20) learns J_hat instead of J.

At every instant the network tracks the solution of

.. math::
    \min_v \tfrac12 v^T v + d (q - q_0)^T v \quad \text{s.t.} \quad
    J v = \dot p_d - \kappa (p - p_d), \quad \underline{v}(q) \le v \le \overline{v}(q)

by the projected primal-dual dynamics, slowed down by :math:`\eta \ge 1` whenever they would
accelerate the joints beyond their bounds,

.. math::
    \dot v = \tfrac{\delta}{\eta} (P(J^T \lambda - d (q - q_0)) - v), \qquad
    \dot \lambda = \tfrac{\delta}{\eta} (\dot p_d - \kappa (p - p_d) - J v).

=============  ===================  =============================================
paper          here                 meaning
=============  ===================  =============================================
theta          position             joint positions q
theta_dot      v                    commanded joint velocities (state)
lambda         multipliers          multipliers of the task equation (state)
J-hat          J_hat                learned Jacobian (state)
theta_dot - n  velocity             joint velocities with the injected noise n
p_r-dot        v_WE                 end effector's velocity
delta          rate                 rate of the network [1/s]
kappa          kappa                gain of the position feedback [1/s]
d              return_gain          pull towards the initial posture q_0 [1/s]
alpha          limit_stiffness      velocity per radian to a position limit [1/s]
rho            rho                  time constant of the learning [rad^2/s]
c_max          limits.acceleration  largest joint acceleration [rad/s^2]
=============  ===================  =============================================

Corrected: rho = tau / xi gives 1e6 for the printed values; they are swapped, and rho is 1e-6.
(18) is 0/0 at rest; as in (25), ``eta = max(1, |v_dot| / c_max)``. The text's "(12e)" is (12d).
Joint 4's upper limit is printed as +0.0698 rad; the Panda's is -0.0698.

Not in the paper:
    The noise n is added in the diagram, not by the law. With ``velocity`` = v - n and
    ``v_WE`` = J v, as printed, J_hat is biased and the arm does not follow its path; learning
    succeeds if ``v_WE`` is the velocity that ``velocity`` causes. v and the multipliers must
    share one eta, or the multipliers wind up. eta slows the feedback as well: if kappa times
    the position error is more than the arm can accelerate to, the loop enters a limit cycle.
    ``feedback_limit`` bounds that speed. Where the arm cannot do what is asked, the multipliers
    grow without end, and the arm does not come back when it could: ``multiplier_limit`` bounds
    them. An arm that follows its box with a bounded acceleration may be too fast to brake before
    a position limit: ``position_bound: braking`` cuts its velocity in time, and touches no other.

Warm-up: one small pulse per joint, so that a learning law sees every direction.

Not in any paper: the excitation ends before the task begins and keeps every bound, while injected
noise violates the acceleration bound for as long as it lasts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from math import ceil
from typing import Annotated, Any, Literal

import numpy as np

from ..arrays.algebra import (
    Parts,
    Product,
    clip,
    flat,
    functions_of,
    in_steps,
    is_one,
    join,
    larger,
    products,
    select,
)
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Count,
    Gain,
    GainOrZero,
    Positive,
    Speed,
    Time,
    Vector,
    Weight,
    validated,
)
from ..inputs.keys import Meaning, Only
from ..robot.limits import JointLimits
from .law import Circumstances, ContinuousLaw, Layout, SampledLaw, SampledReading, Signals
from .parts.bounded_velocity import kept_with_lag
from .parts.jacobian import first_J_hat, gradient, rank_one_update
from .parts.path_task import Braking
from .parts.programs import check_substeps, not_outward, stable_steps, within


@validated
class WarmUp:
    """A motion in which one joint after another moves forth and back to where it was."""

    pulse: Annotated[Time, Meaning("Duration of each joint's pulse.", unit="s")] = 0.2
    acceleration: Annotated[
        Positive,
        Meaning(
            "Acceleration of the moving joint: positive for the first quarter of its pulse, "
            "negative for the next half, positive for the last quarter.",
            unit="rad/s^2",
        ),
    ] = 0.5
    rho: Annotated[
        Weight,
        Meaning(
            "Time constant of the learning during the warm-up.",
            unit="rad^2/s",
            only=(Only("jacobian", "learned"),),
        ),
    ] = 1e-6

    def duration(self, size: int) -> float:
        """Return the duration of the warm-up of ``size`` joints [s]."""
        return size * self.pulse

    def joint_velocity(self, t: Any, size: int) -> Array:
        """Return the velocity of every joint at time ``t``, shape (..., size) [rad/s]."""
        joint, share = self._place(t)
        # A triangle wave through 0, 1, 0, -1, 0.
        height = 1.0 - abs(4.0 * ((share + 0.25) % 1.0) - 2.0)
        return self._of_one(joint, height * self.acceleration * self.pulse / 4.0, size)

    def joint_acceleration(self, t: Any, size: int) -> Array:
        """Return the acceleration of every joint at time ``t``, shape (..., size) [rad/s^2]."""
        joint, share = self._place(t)
        rising = (share < 0.25) | (share >= 0.75)
        acceleration = functions_of(joint).where(rising, self.acceleration, -self.acceleration)
        return self._of_one(joint, acceleration, size)

    def _place(self, t: Any) -> tuple[Any, Any]:
        """Return the number of the moving joint and the fraction of its pulse that has passed.

        Both have shape (), or (..., 1) for robots with pulses of their own.
        """
        joint = (t + 1e-9 * self.pulse) // self.pulse
        return joint, larger(0.0, t / self.pulse - joint)

    @staticmethod
    def _of_one(joint: Any, value: Any, size: int) -> Array:
        """Return a value for one joint, and 0 for all others."""
        return functions_of(joint, value).where(np.arange(size) == joint, value, 0.0)


# Distance from the path that counts as none [m].
_NEAR = 1e-6
# Ratio of the deceleration asked for to that possible, from which on some arms cycled for ever.
_CYCLES = 8.0

# v -> J v and y -> J^T y; pull, lower, upper, task velocity; inverse of the acceleration bounds.
_Constants = tuple[Product, Product, Array, Array, Array, Array, Array | None]
# J_hat, or its rate, that follows from J_hat, joint velocities and the end effector's velocity.
_LearningRule = Callable[[Array, Array, Array], Array]


@validated
class SimultaneousLearning(SampledLaw, ContinuousLaw):
    """RNN (16), (19) and (20): velocity level, with bounds on velocity and acceleration."""

    kind: Literal["simultaneous_learning"] = "simultaneous_learning"
    follows_objectives = True
    summary = (
        "Simultaneous learning and control: the arm tracks a path while it learns its own Jacobian."
    )
    limits: Annotated[
        JointLimits,
        Meaning(
            "Position and velocity limits of the joints, and acceleration limits unless "
            "``acceleration_bound`` is ``none``.",
        ),
    ]
    home: Annotated[
        Vector,
        Meaning("Posture that the joints are pulled towards, shape (n,).", unit="rad"),
    ]
    task_size: Annotated[Literal[1, 2, 3, 4, 5], Meaning("Number of rows of J.")] = 3
    kappa: Annotated[Gain, Meaning("Gain of the position feedback.", unit="1/s")] = 4.0
    rate: Annotated[Gain, Meaning("Rate of the network.", unit="1/s")] = 1000.0
    return_gain: Annotated[GainOrZero, Meaning("Pull towards ``home``.", unit="1/s")] = 1.0
    limit_stiffness: Annotated[
        Gain,
        Meaning(
            "Velocity allowed per radian left to a position limit. The network itself brakes in "
            "time if this is at most acceleration / velocity.",
            unit="1/s",
        ),
    ] = 2.0
    feedback_limit: Annotated[
        Speed | None,
        Meaning("Largest speed commanded by the feedback; None for no bound.", unit="m/s"),
    ] = None
    multiplier_limit: Annotated[
        Positive | Literal["none"],
        Meaning(
            "Largest norm of the multipliers; ``none`` for no bound, as in the paper. On a path "
            "that an arm can follow they reach 1 to 4, and more close to a singular posture.",
            unit="rad^2/(s m)",
        ),
    ] = 10.0
    position_bound: Annotated[
        Literal["braking", "printed"],
        Meaning(
            "``braking`` keeps each joint slow enough to stop within its position limits at its "
            "largest acceleration; ``printed`` has the paper's box alone.",
            only=(Only("acceleration_bound", "scalar", "per_joint"),),
        ),
    ] = "braking"
    acceleration_bound: Annotated[
        Literal["scalar", "per_joint", "none"],
        Meaning(
            "``scalar`` limits all joints to the smallest of their bounds, as in the paper; "
            "``per_joint`` limits each joint to its own; ``none`` is RNN (16).",
        ),
    ] = "scalar"
    jacobian: Annotated[
        Literal["known", "learned"],
        Meaning("``known`` reads J; ``learned`` reads ``velocity`` and ``v_WE`` instead."),
    ] = "learned"
    rho: Annotated[
        Weight,
        Meaning(
            "Time constant of the learning.",
            unit="rad^2/s",
            only=(Only("jacobian", "learned"),),
        ),
    ] = 1e-6
    J_hat_initial: Annotated[
        Literal["uniform", "zero", "exact"],
        Meaning(
            "Initial J_hat: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own.",
            only=(Only("jacobian", "learned"),),
        ),
    ] = "uniform"
    warm_up: Annotated[
        WarmUp | None,
        Meaning("Small motion of every joint before the task begins, in place of noise."),
    ] = None
    substeps: Annotated[
        Count | None,
        Meaning(
            "Euler steps of the network per sample; by default as many as keep it stable: rate "
            "times step is at most 1, and at most ``1 / |J|^2`` where ``|J|`` exceeds 1.",
            only=(Only("period"),),
        ),
    ] = None

    takes_many = True

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        if self.acceleration_bound != "none":
            self.limits.require("acceleration", f"acceleration_bound: {self.acceleration_bound}")
        bound = np.inf if self._inverse_bound is None else 1.0 / self._inverse_bound.max()
        if self.warm_up is not None and self.warm_up.acceleration > bound:
            raise InvalidInputError(
                f"law.warm_up.acceleration: may be at most the bound, {bound:g} rad/s^2, "
                f"not {self.warm_up.acceleration:g}"
            )

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; as printed, a joint may be too fast to brake at a position limit."""
        if self.acceleration_bound == "none":
            return kept_with_lag(self.limit_stiffness, 1.0 / self.rate)
        if self.position_bound == "printed":
            return ("velocity", "acceleration")
        return ("position", "velocity", "acceleration")

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"kappa": self.kappa}

    def doubts(self, circumstances: Circumstances) -> list[str]:
        return [*self._doubts_of_delay(circumstances), *self._doubts_of_start(circumstances)]

    def _doubts_of_start(self, circumstances: Circumstances) -> list[str]:
        """Return a warning if the arm may be asked to turn round faster than it can."""
        offset, J = circumstances.start_offset, circumstances.J
        if offset is None or J is None or self._bound is None:
            return []
        away = float(np.linalg.norm(offset))
        if away < _NEAR:
            return []
        # Acceleration of the tip towards the path at which the first joint reaches its bound.
        moves = np.abs(np.linalg.pinv(J) @ (offset / away))
        most = 1.0 / float((moves / self._bound).max())
        speed = self.kappa * away
        if self.feedback_limit is not None:
            speed = min(speed, self.feedback_limit)
        if self.kappa * speed <= _CYCLES * most:
            return []
        return [
            f"law.kappa: the arm starts {away:.3g} m off its path, so {self.kappa:g} /s asks for "
            f"{speed:.2g} m/s and, to stop again, {self.kappa * speed:.2g} m/s^2; "
            f"limits.acceleration allows about {most:.2g} there, and the arm may cycle for ever; "
            f"consider law.feedback_limit: {4.0 * most / self.kappa:.1g}"
        ]

    def _doubts_of_delay(self, circumstances: Circumstances) -> list[str]:
        in_doubt = circumstances.loop_delay > 0.0 and not circumstances.reference_is_delayed
        if self.acceleration_bound == "none" or not in_doubt:
            return []
        return [
            "law.acceleration_bound: slows the law's loop in addition to the filter, which already "
            "keeps the bound, and the arm may lose the path; consider acceleration_bound: none"
        ]

    @property
    def learns_jacobian(self) -> bool:
        """See `Law.learns_jacobian`."""
        return self.jacobian == "learned"

    @cached_property
    def state(self) -> Layout:
        n, m = self.limits.size, self.task_size
        if not self.learns_jacobian:
            return Layout(v=(n,), multipliers=(m,))
        return Layout(v=(n,), multipliers=(m,), J_hat=(m, n))

    @cached_property
    def inputs(self) -> Layout:
        n, m = self.limits.size, self.task_size
        task = {"p_WE": (m,), "p_WE_desired": (m,), "v_WE_desired": (m,)}
        if self.jacobian == "known":
            return Layout(position=(n,), **task, J=(m, n))
        return Layout(position=(n,), **task, velocity=(n,), v_WE=(m,))

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        return Layout(
            velocity_lower=(n,), velocity_upper=(n,), acceleration_demand=(n,), saturated=(1,)
        )

    @cached_property
    def _bound(self) -> Array | None:
        """Largest acceleration of each joint, shape (n,) [rad/s^2]; None if it is not bounded."""
        if self.acceleration_bound == "none":
            return None
        bound = self.limits.require("acceleration", "the acceleration bound")
        if self.acceleration_bound == "scalar":
            return bound.min(axis=-1, keepdims=True) + np.zeros(bound.shape[-1])
        return bound

    @cached_property
    def _inverse_bound(self) -> Array | None:
        """Inverse of the acceleration bounds, shape (n,) [s^2/rad]; multiplying is cheaper."""
        return None if self._bound is None else 1.0 / self._bound

    @cached_property
    def _braking(self) -> Braking | None:
        """What keeps the position limits; None where the acceleration is not bounded."""
        if self._bound is None or self.position_bound == "printed":
            return None
        return Braking(self.limits, self._bound, self.limit_stiffness)

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        n, m = self.limits.size, self.task_size
        parts = [np.zeros(n), np.zeros(m)]
        if self.jacobian == "learned":
            parts.append(first_J_hat(self.J_hat_initial, (m, n), rng, u))
        return self.state.join(*parts)

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If the network would take too many substeps, or, with ``substeps``,
                so few that it would overshoot the velocity limits.
        """
        if self.substeps is None:
            check_substeps(period * self.rate, f"rate: {self.rate:g} /s")
        else:
            check_substeps(self.substeps, f"substeps: {self.substeps}")
            fewest = ceil(self.rate * period - 1e-9)
            if self.substeps < fewest:
                raise InvalidInputError(
                    f"law.substeps: must be at least {fewest} at rate {self.rate:g} /s and a "
                    f"period of {period:g} s, not {self.substeps}; the network would overshoot "
                    "the velocity limits"
                )
        return super().sampled(period)

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the right-hand side of (16), (19) or (20)."""
        warm_up, n = self.warm_up, self.limits.size
        if warm_up is None:
            return self._rates(x, u)
        learning = partial(gradient, rho=warm_up.rho)
        return select(
            t < warm_up.duration(n),
            lambda: self._warming_up(warm_up.joint_acceleration(t, n), x, u, learning),
            lambda: self._rates(x, u),
        )

    def _rates(self, x: Array, u: Signals) -> Array:
        v, multipliers, *learning_state = self.state.split(x)
        J = learning_state[0] if learning_state else u["J"]
        v_dot, multipliers_dot = self._network(v, multipliers, self._constants(u, J))
        if self._braking is not None:
            v_dot = self._braking.rate(v_dot, v, u["position"])
        if not isinstance(self.multiplier_limit, str):
            multipliers_dot = not_outward(multipliers_dot, multipliers, self.multiplier_limit)
        if not learning_state:
            return self.state.join(v_dot, multipliers_dot)
        rate = gradient(J, u["velocity"], u["v_WE"], self.rho)
        return self.state.join(v_dot, multipliers_dot, rate)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Integrate the learning exactly, with its inputs held; then the network by Euler steps.

        The velocity that is then cut to brake in time is also the network's own, and its
        multipliers are bounded, so that neither winds up.
        """
        warm_up, n = self.warm_up, self.limits.size
        if warm_up is None:
            return self._task_step(x, u, period)
        learning = partial(rank_one_update, rho=warm_up.rho, period=period)
        return select(
            t + period <= warm_up.duration(n),
            lambda: self._warming_up(warm_up.joint_velocity(t + period, n), x, u, learning),
            lambda: self._task_step(x, u, period),
        )

    def _task_step(self, x: Array, u: Signals, period: float) -> Array:
        before, multipliers, *learning_state = self.state.split(x)
        if learning_state:
            J = rank_one_update(learning_state[0], u["velocity"], u["v_WE"], self.rho, period)
        else:
            J = u["J"]
        constants = self._constants(u, J)

        def advance(parts: Parts, k: Any, h: Any) -> Parts:
            v, multipliers = parts
            v_dot, multipliers_dot = self._network(v, multipliers, constants)
            return v + h * v_dot, multipliers + h * multipliers_dot

        keys: Any = self.substeps
        count = stable_steps(self.rate * period, J) if keys is None else keys
        v, multipliers = in_steps(advance, (before, multipliers), period, count)
        braking = self._braking
        if braking is not None and not braking.is_idle(constants[3], constants[4], period):
            v = braking.hold(v, before, u["position"], period)
        if not isinstance(self.multiplier_limit, str):
            multipliers = within(multipliers, self.multiplier_limit)
        return join((v, multipliers, flat(J)) if learning_state else (v, multipliers))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        v, multipliers, *learning_state = self.state.split(x)
        J = learning_state[0] if learning_state else u["J"]
        q = u["position"]
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        xp = functions_of(x)
        pull = xp.einsum("...m,...mn->...n", multipliers, J) - self.return_gain * (q - self.home)
        demand = self.rate * (clip(pull, lower, upper) - v)
        ratio = np.zeros(1) if self._inverse_bound is None else xp.abs(demand * self._inverse_bound)
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "acceleration_demand": demand,
            "saturated": (ratio.max(axis=-1, keepdims=True) > 1.0) * np.ones((*v.shape[:-1], 1)),
        }

    def _warming_up(self, motion: Array, x: Array, u: Signals, parts: _LearningRule) -> Array:
        """Return velocities or accelerations beside multipliers at rest and what is learned."""
        # Robots may share the motion; their states have leading axes of their own.
        motion = functions_of(motion, x).broadcast_to(motion, (*x.shape[:-1], motion.shape[-1]))
        still = np.zeros(self.task_size)
        if self.jacobian == "known":
            return self.state.join(motion, still)
        J_hat = self.state.part(x, "J_hat")
        return self.state.join(motion, still, parts(J_hat, u["velocity"], u["v_WE"]))

    def _constants(self, u: Signals, J: Array) -> _Constants:
        """Return what is constant within a sample."""
        q = u["position"]
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        feedback = self.kappa * (u["p_WE_desired"] - u["p_WE"])
        if self.feedback_limit is not None:
            feedback = within(feedback, self.feedback_limit)
        pull, task_velocity = self.return_gain * (q - self.home), u["v_WE_desired"] + feedback
        return *products(J), pull, lower, upper, task_velocity, self._inverse_bound

    def _network(self, v: Array, multipliers: Array, constants: _Constants) -> tuple[Array, Array]:
        """Return the time derivatives of v and of the multipliers."""
        task, joints, pull, lower, upper, task_velocity, inverse_bound = constants
        v_dot = self.rate * (clip(joints(multipliers) - pull, lower, upper) - v)
        multipliers_dot = self.rate * (task_velocity - task(v))
        if inverse_bound is None:
            return v_dot, multipliers_dot
        return _slow(v_dot, multipliers_dot, inverse_bound)


def _slow(v_dot: Array, multipliers_dot: Array, inverse_bound: Array) -> tuple[Array, Array]:
    """Return both rates divided by the largest ratio of a joint's acceleration to its bound."""
    acceleration_ratios = v_dot * inverse_bound
    if is_one(acceleration_ratios):
        # For a handful of joints Python's max is three times as fast as NumPy's.
        ratios = acceleration_ratios.tolist()
        slowing = max(max(ratios), -min(ratios))
        if slowing <= 1.0:
            return v_dot, multipliers_dot
    else:
        xp = functions_of(acceleration_ratios)
        slowing = xp.maximum(xp.abs(acceleration_ratios).max(axis=-1, keepdims=True), 1.0)
    return v_dot / slowing, multipliers_dot / slowing
