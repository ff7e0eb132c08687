r"""Joint-drift-free motion at the acceleration level: closed paths that bring the joints back.

Source:
    Jin, Xie, Liu, Ke, Li, Yang, "Novel joint-drift-free scheme at acceleration level for robotic
    redundancy resolution with tracking error theoretically eliminated", IEEE/ASME Transactions
    on Mechatronics (2020). GALJDF is (9) with (19), NALJDF (10) with (29), MOALJDF (41) with
    (43); MAN, the minimum acceleration norm, is any of them without the drift index.

With the drift index c and the position feedback d,

.. math::
    c = (\beta_1 + \gamma_1) v + \beta_1 \gamma_1 (q - q_0), \qquad
    d = (\beta_2 + \gamma_2)(\dot p - \dot p_d) + \beta_2 \gamma_2 (p - p_d),

the network is

.. math::
    \dot v = P(-\varrho J^T (\dot p - \dot p_d) + J^T \omega - \lambda Q c), \qquad
    \dot\omega = \eta (\ddot p_d - \dot J v - J J^T \omega - \delta d),

where Q is I in GALJDF, I - J^+ J in NALJDF, and lambda = 0 in MAN. MOALJDF also weights the torque
tau = M v_dot + h, where h holds the Coriolis and gravity terms, by zeta = 1 - alpha:

.. math::
    \text{printed:} \quad & \dot v = P((I + \zeta M M)^{-1}
    (-\varrho J^T \dot e + \alpha (J^T \omega - \lambda c) - \zeta M h)) \\
    \text{corrected:} \quad & \dot v = P((\alpha I + \zeta M M)^{-1}
    (-\varrho J^T \dot e + J^T \omega - \alpha \lambda (I - J^+ J) c - \zeta M h)), \quad
    \dot\omega = \eta (\ddot p_d - \dot J v - J \dot v - \delta d).

=============  =====================  ================================================
paper          here                   meaning
=============  =====================  ================================================
q              position               joint positions
q_dot          v                      joint velocities (state)
omega          omega                  compensation of the acceleration (state)
r, r_d         p_WE, p_WE_desired     end effector's position, actual and desired
lambda         return_weight          weight of the drift index
beta1, gamma1  return_beta, .._gamma  roots of the joints' return [1/s]
beta2, gamma2  task_beta, .._gamma    roots of the position feedback [1/s]
delta          position_gain          gain of the position feedback
varrho         velocity_gain          gain of the gradient of the velocity error [1/(m^2 s)]
eta            rate                   rate of omega [1/(m^2 s)]
nu             limits.acceleration    largest joint acceleration [rad/s^2]
alpha          alpha                  weight of the kinematics; 1 - alpha of the torque
=============  =====================  ================================================

Corrected: (42) is not the optimality condition of (41): the projection is missing, the weight of
the acceleration is alpha, not 1, and omega must account for all of J v_dot, not for J J^T omega.
The text calls alpha the weight of dynamics and zeta that of kinematics; it is the other way round.
The roots of the errors are negative: e'' + delta ((beta2 + gamma2) e' + beta2 gamma2 e) = 0.

Not in the paper:
    The velocity in the equations is the law's own. The paper's physical experiment measures it;
    ``velocity: measured`` does so, and any delay makes the stiff term chatter.
    ``composite_gain`` k_p adds the position error to the velocity error,
    -varrho J^T (e_dot + k_p e): without it, contrary to Theorem 2, a position error decays only
    with 1/varrho, over minutes. The bound P is a plain clip that does not act on omega: while it
    is active, the network does not solve the quadratic program. J^+ is damped,
    J^T (J J^T + mu^2 I)^-1, so that it exists everywhere. The paper gives no initial v and omega;
    here they are zero.

A sampled reading of acceleration laws with linear fast terms, by an implicit two-step method.

The second-order backward differentiation formula,

.. math::
    (3 x_{k+1} - 4 x_k + x_{k-1}) / 2h = f(x_{k+1}),

gives v and omega at the next sample from one linear system: f is linear in them once J and Jdot_v
are extrapolated from this sample and the previous one, and the desired signals are known ahead.
The commanded velocity is the ramp from one v to the next, which makes the joint positions exact.
Its slope is the acceleration, which the bounds clip.

With the velocity held over a sample instead, the position error of NALJDF is 200 times as large;
with a one-step formula it is twice as large; without the change of J the step is unstable.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, Protocol

import numpy as np
from pydantic import Field

from ..arrays.algebra import (
    acts,
    clip,
    flat,
    functions_of,
    is_one,
    join,
    matmul,
    matvec,
    scale,
    solve,
    solved_for,
    transpose,
)
from ..errors import InvalidInputError, OldName
from ..inputs.fields import Array, Gain, GainOrZero, Positive, Vector, Weight, between, validated
from ..inputs.keys import Meaning, Only
from ..robot.limits import JointLimits
from ..signals import POSITION_OF_PATH, SIGNALS
from .law import ContinuousLaw, ContinuousReading, Layout, SampledReading, Signals

# Signals one period ahead, and those that they are then.
_AHEAD = {SIGNALS[name].ahead: name for name in POSITION_OF_PATH}

#: J and Jdot_v at the next sample, and c, b_v and b_omega with which v_dot there is c v - b_v, and
#: omega_dot likewise.
Formula = tuple[Array, Array, Any, Array, Array]

# Value of ``since`` before the first ramp [s].
_NEVER = -1.0


class LinearForm(NamedTuple):
    """Rates that are linear in the state, at one posture and time.

    Before clipping, v_dot = a_v v + a_omega omega + a_0; omega_dot is the same with b.
    """

    a_v: Array
    a_omega: Array
    a_0: Array
    b_v: Array
    b_omega: Array
    b_0: Array


class AccelerationLaw(Protocol):
    """The interface that `TwoStep` needs of a law with the state v and omega."""

    @property
    def home(self) -> Array:
        """Home posture, shape (..., n) [rad]; only its size is used."""

    @property
    def task_size(self) -> int:
        """Number m of rows of J."""

    @property
    def measured_inputs(self) -> Mapping[str, tuple[int, ...]]:
        """Shapes of the input signals that come from the arm, by name."""

    @property
    def observables(self) -> Layout:
        """Layout of the signals that `observed` returns."""

    def linear_form(self, u: Signals, q: Array, p_WE: Array, ahead: float = 0.0) -> LinearForm:
        """Return the rates at posture q + ahead v and end-effector position p_WE + ahead J v."""

    def broken_assumptions(self, metrics: Mapping[str, float]) -> list[str]:
        """Return warnings to show after a run with these metrics."""

    def bound(self, demand: Array, q: Array, v: Array, period: float) -> Array:
        """Return the allowed accelerations nearest to ``demand``, shape (..., n) [rad/s^2]."""

    def observe(self, demand: Array, v_dot: Array, v: Array, u: Signals) -> Signals:
        """Return the observables from the demanded and the allowed accelerations."""


@dataclass(frozen=True, eq=False)
class TwoStep(SampledReading):
    """The sampled reading of an acceleration law.

    It reads the desired signals one period ahead. The state holds v at the end of the present
    ramp and omega; the ramp's start ``v_from`` at time ``since``, its ``slope``, and the ``demand``
    before clipping; and signals of the previous sample. A law that measures the joint
    velocity ramps its own by what the measured one demands.

    Args:
        law: The law to run.
    """

    law: AccelerationLaw

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        n, m = self.law.home.shape[-1], self.law.task_size
        return Layout(
            v=(n,),
            omega=(m,),
            v_from=(n,),
            slope=(n,),
            demand=(n,),
            since=(1,),
            omega_before=(m,),
            J_before=(m, n),
            Jdot_v_before=(m,),
        )

    @cached_property
    def inputs(self) -> Layout:
        ahead = {name: (self.law.task_size,) for name in _AHEAD}
        return Layout(**self.law.measured_inputs, **ahead)

    @cached_property
    def observables(self) -> Layout:
        return self.law.observables

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        x = np.zeros(self.state.size)
        x[self._ramp[1]] = _NEVER
        return x

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.law.broken_assumptions(metrics)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        law, h = self.law, period
        v, omega, *before = self.state.split(x)
        q, J = u["position"], u["J"]
        present = u.get("velocity", v)
        if present is v:
            J_next, Jdot_v_next, lead, known_v, known_omega = _formula(v, omega, before, u, h)
        else:
            # The measured velocity of the previous sample is no longer known.
            J_next, Jdot_v_next, lead, known_v, known_omega = _of_one_step(present, omega, u, h)
        next_u = {**u, "J": J_next, "Jdot_v": Jdot_v_next}
        for preview, desired in _AHEAD.items():
            next_u[desired] = u[preview]
        half = h / 2.0
        p_WE = u["p_WE"] + half * matvec(J, present)
        form = law.linear_form(next_u, q + half * present, p_WE, half)
        v_next, omega_next = _solution(form, lead, known_v, known_omega)
        demand = (v_next - present) / h
        slope = law.bound(demand, q, v, h)
        ramp = (v + h * slope, omega_next, v, slope, demand, _of_each(t, v))
        return join((*ramp, omega, flat(J), u["Jdot_v"]))

    def commanded_velocity(self, t: float, x: Array) -> Array:
        v_from, since, slope = self._ramp
        if x.ndim == 1:
            return x[v_from] + (t - x[since.start]) * x[slope]
        return x[..., v_from] + (t - x[..., since]) * x[..., slope]

    @cached_property
    def _ramp(self) -> tuple[slice, slice, slice]:
        v_from, since, slope = (self.state.parts[name][0] for name in ("v_from", "since", "slope"))
        return v_from, since, slope

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        v, demand, slope = (self.state.part(x, name) for name in ("v", "demand", "slope"))
        # In a diagram it sees the desired signals one period ahead alone, like its v.
        ahead = {desired: u[name] for name, desired in _AHEAD.items() if name in u}
        return self.law.observe(demand, slope, v, {**ahead, **u})


def _formula(v: Array, omega: Array, before: list[Array], u: Signals, h: float) -> Formula:
    """Return the two-step formula; where there is no previous sample, at the first, the other."""
    v_from, _, _, since, omega_before, J_before, Jdot_v_before = before
    one = is_one(v)
    if one and since[0] == _NEVER:
        return _of_one_step(v, omega, u, h)
    of_two: Formula = (
        2.0 * u["J"] - J_before,
        2.0 * u["Jdot_v"] - Jdot_v_before,
        1.5 / h,
        (4.0 * v - v_from) / (2.0 * h),
        (4.0 * omega - omega_before) / (2.0 * h),
    )
    if one:
        return of_two
    J_next, *others = zip(of_two, _of_one_step(v, omega, u, h), strict=True)
    where, has_begun = functions_of(v, u["J"]).where, since != _NEVER
    return where(has_begun[..., np.newaxis], *J_next), *(where(has_begun, *each) for each in others)


def _of_one_step(v: Array, omega: Array, u: Signals, h: float) -> Formula:
    return u["J"], u["Jdot_v"], 1.0 / h, v / h, omega / h


def _solution(
    form: LinearForm, lead: Any, known_v: Array, known_omega: Array
) -> tuple[Array, Array]:
    """Return v and omega at the next sample, shapes (..., n) and (..., m)."""
    constants = join((form.a_0 + known_v, form.b_0 + known_omega))
    n, size = known_v.shape[-1], constants.shape[-1]
    if is_one(constants):
        A = np.empty((size, size))
        A[:n, :n], A[:n, n:] = form.a_v, form.a_omega
        A[n:, :n], A[n:, n:] = form.b_v, form.b_omega
        A.reshape(-1)[:: size + 1] -= lead
        sought = solved_for(A, -constants)
        return sought[:n], sought[n:]
    rows = join((form.a_v, form.a_omega)), join((form.b_v, form.b_omega))
    A = functions_of(*rows).concatenate(rows, axis=-2) - scale(lead, np.eye(size))
    sought = solved_for(A, -constants)
    return sought[..., :n], sought[..., n:]


def _of_each(t: Any, v: Array) -> Any:
    """Return a time as a vector of one entry, for each robot."""
    return (t,) if is_one(v) else functions_of(v, t).broadcast_to(t, (*v.shape[:-1], 1))


Scheme = Literal["man", "galjdf", "naljdf", "moaljdf_printed", "moaljdf"]


@validated
class JointDriftFree(ContinuousLaw):
    """MAN, GALJDF (19), NALJDF (29), and MOALJDF (43) as printed and corrected."""

    kind: Literal["joint_drift_free"] = "joint_drift_free"
    follows_objectives = True
    summary = (
        "Joint-drift-free motion at the acceleration level: closed paths that bring the joints "
        "back."
    )
    scheme: Annotated[Scheme, Meaning("Name of the scheme; ``moaljdf`` is the corrected one.")]
    limits: Annotated[
        JointLimits,
        Meaning(
            "Acceleration limits of the joints; with ``bounds: all`` position and velocity "
            "limits as well.",
        ),
    ]
    home: Annotated[Vector, Meaning("Posture that the joints return to, shape (n,).", unit="rad")]
    task_size: Annotated[Literal[1, 2, 3, 4, 5], Meaning("Number of rows of J.")] = 3
    return_weight: Annotated[
        GainOrZero,
        Meaning(
            "Weight of the drift index.",
            only=(Only("scheme", "galjdf", "naljdf", "moaljdf", "moaljdf_printed"),),
        ),
    ] = 3.0
    return_beta: Annotated[
        Gain,
        Meaning("Roots of the joints' return.", unit="1/s", only=(Only("return_weight"),)),
    ] = 1.0
    return_gamma: Annotated[
        Gain,
        Meaning("Roots of the joints' return.", unit="1/s", only=(Only("return_weight"),)),
    ] = 1.0
    task_beta: Annotated[Gain, Meaning("Roots of the position feedback.", unit="1/s")] = 1.0
    task_gamma: Annotated[Gain, Meaning("Roots of the position feedback.", unit="1/s")] = 1.0
    position_gain: Annotated[GainOrZero, Meaning("Gain of the position feedback.")] = 250.0
    velocity_gain: Annotated[
        Positive,
        between(0.0, 1e9),
        Meaning("Gain of the gradient of the velocity error.", unit="1/(m^2 s)"),
    ] = 1e5
    composite_gain: Annotated[
        GainOrZero,
        Meaning("Gain of the position error added to the velocity error.", unit="1/s"),
    ] = 0.0
    rate: Annotated[Gain, Meaning("Rate of omega.", unit="1/(m^2 s)")] = 1000.0
    alpha: Annotated[
        Annotated[float, Field(strict=True, gt=0, le=1)] | None,
        Meaning(
            "Weight of the kinematics in MOALJDF, 0.995 by default; the torque's is 1 - alpha.",
        ),
    ] = None
    damping: Annotated[
        Weight,
        Meaning(
            "Damping mu of the pseudoinverse.",
            unit="m",
            only=(Only("scheme", "man", "galjdf", "naljdf", "moaljdf"),),
        ),
    ] = 1e-4
    bounds: Annotated[
        Literal["acceleration", "all"],
        Meaning(
            "``acceleration``, clipped as in the paper; or ``all``, which a sampled law keeps by "
            "braking in time.",
        ),
    ] = "acceleration"
    velocity: Annotated[
        Literal["own", "measured"],
        Meaning(
            "Joint velocity in the equations: the law's ``own``, which it commands; or the "
            "arm's, ``measured``, with the paper's physical experiment, for a sampled law.",
        ),
    ] = "own"

    stays_on_path = True
    takes_many = True

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        self.limits.require("acceleration", f"scheme: {self.scheme}")
        if self.alpha is not None and not self.weighs_torque:
            raise ValueError(
                "alpha: needs a scheme that weights the torque, moaljdf or moaljdf_printed, "
                f"not {self.scheme}"
            )

    def continuous(self) -> ContinuousReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If ``bounds`` is ``all``, which only a sampled law can keep, or
                ``velocity`` is ``measured``.
        """
        if self.velocity == "measured":
            raise InvalidInputError(
                "law.velocity: measured needs a sampled law; give a period instead of an "
                "integrator, or velocity: own"
            )
        if self.bounds == "all":
            raise InvalidInputError(
                "law.bounds: all needs a sampled law; give a period instead of an integrator, or "
                "bounds: acceleration"
            )
        return super().continuous()

    def sampled(self, period: float) -> SampledReading:
        """Return a `TwoStep` of the law: implicit steps of second order, for any period."""
        return TwoStep(self)

    @cached_property
    def _kinematic_weight(self) -> float:
        return 0.995 if self.alpha is None else self.alpha

    @property
    def weighs_torque(self) -> bool:
        """Whether the scheme weights the torque and so needs the arm's dynamics."""
        return self.scheme.startswith("moaljdf")

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,), omega=(self.task_size,))

    @cached_property
    def inputs(self) -> Layout:
        m = self.task_size
        desired = {"p_WE_desired": (m,), "v_WE_desired": (m,), "a_WE_desired": (m,)}
        return Layout(**self.measured_inputs, **desired)

    @cached_property
    def measured_inputs(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the input signals that come from the arm, by name."""
        n, m = self.limits.size, self.task_size
        shapes = {"position": (n,), "p_WE": (m,), "J": (m, n), "Jdot_v": (m,)}
        if self.velocity == "measured":
            shapes |= {"velocity": (n,)}
        if self.weighs_torque:
            shapes |= {"M": (n, n), "bias": (n,), "gravity": (n,)}
        return shapes

    @cached_property
    def observables(self) -> Layout:
        n, m = self.limits.size, self.task_size
        shapes = {"acceleration_demand": (n,), "saturated": (1,)}
        own = {"torque": (n,)} if self.weighs_torque else {"velocity_error_predicted": (m,)}
        return Layout(**shapes, **own)

    def linear_form(self, u: Signals, q: Array, p_WE: Array, ahead: float = 0.0) -> LinearForm:
        """Return the network at posture q + ahead v and end-effector position p_WE + ahead J v.

        Args:
            u: J, Jdot_v, the desired signals and, for MOALJDF, M, bias and gravity, all at that
                posture and time.
            q: Joint positions, shape (..., n) [rad].
            p_WE: End effector's position, shape (..., m) [m].
            ahead: Time for which q and p_WE advance with the unknown v [s].
        """
        J = u["J"]
        J_T = transpose(J)
        gram = matmul(J, J_T)
        feedback = self.task_beta * self.task_gamma
        slip = self.task_beta + self.task_gamma
        error_0 = p_WE - u["p_WE_desired"]
        v_desired = u["v_WE_desired"]

        pull = scale(self.velocity_gain, J_T)
        composite = self.composite_gain
        a_v = matmul(pull, scale(-1.0 - composite * ahead, J))
        a_0 = matvec(pull, v_desired - composite * error_0 if acts(composite) else v_desired)
        a_omega = J_T
        if self.scheme != "man" and acts(self.return_weight):
            weight = self.return_weight
            stiffness = self.return_beta * self.return_gamma
            drift_v = weight * (self.return_beta + self.return_gamma + stiffness * ahead)
            drift_0 = weight * stiffness * (q - self.home)
            if self.weighs_torque:
                alpha = self._kinematic_weight
                drift_v, drift_0 = alpha * drift_v, alpha * drift_0
            if self.scheme in ("naljdf", "moaljdf"):
                # I - J^+ J is symmetric: J^+ J = J^T S.
                S = solve(gram + self._damping_matrix, J)
                a_v = a_v + matmul(J_T, scale(drift_v, S))
                drift_0 = drift_0 - matvec(J_T, matvec(S, drift_0))
            a_v = a_v - scale(drift_v, self._identity)
            a_0 = a_0 - drift_0
        if self.weighs_torque:
            a_v, a_omega, a_0 = self._torque_weighted(u, a_v, a_omega, a_0)

        eta, delta = self.rate, self.position_gain
        b_v = scale(-eta * delta * (slip + feedback * ahead), J)
        b_0 = eta * (
            u["a_WE_desired"] - u["Jdot_v"] - delta * (feedback * error_0 - slip * v_desired)
        )
        if self.scheme == "moaljdf":
            b_v = b_v - scale(eta, matmul(J, a_v))
            b_omega = scale(-eta, matmul(J, a_omega))
            b_0 = b_0 - eta * matvec(J, a_0)
        else:
            b_omega = scale(-eta, gram)
        return LinearForm(a_v, a_omega, a_0, b_v, b_omega, b_0)

    def _torque_weighted(
        self, u: Signals, a_v: Array, a_omega: Array, a_0: Array
    ) -> tuple[Array, Array, Array]:
        """Return a_v, a_omega and a_0 with the torque weighted: (43), printed or corrected."""
        n, m, alpha = self.limits.size, self.task_size, self._kinematic_weight
        M, zeta = u["M"], 1.0 - alpha
        weight = alpha if self.scheme == "moaljdf" else 1.0
        if self.scheme == "moaljdf_printed":
            a_omega = scale(alpha, a_omega)
        a_0 = a_0 - zeta * matvec(M, u["bias"] - u["gravity"])
        terms = join((a_v, a_omega, a_0[..., None]))
        weights = scale(weight, self._identity) + scale(zeta, matmul(M, M))
        solution = solve(weights, terms)
        return solution[..., :n], solution[..., n : n + m], solution[..., n + m]

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the right-hand side of (19), (29) or (43)."""
        demand, omega_dot = self._rates(x, u)
        return self.state.join(self.clip(demand), omega_dot)

    def _rates(self, x: Array, u: Signals) -> tuple[Array, Array]:
        """Return the demanded accelerations and the rate of omega at one instant."""
        v, omega = self.state.split(x)
        form = self.linear_form(u, u["position"], u["p_WE"])
        demand = matvec(form.a_v, v) + matvec(form.a_omega, omega) + form.a_0
        return demand, matvec(form.b_v, v) + matvec(form.b_omega, omega) + form.b_0

    def clip(self, demand: Array) -> Array:
        """Return the accelerations clipped to their bounds, shape (..., n) [rad/s^2]."""
        return clip(demand, -self._bound, self._bound)

    def bound(self, demand: Array, q: Array, v: Array, period: float) -> Array:
        """Return the accelerations clipped to what ``bounds`` allows, shape (..., n) [rad/s^2].

        Args:
            demand: Demanded accelerations, shape (..., n) [rad/s^2].
            q: Joint positions, shape (..., n) [rad].
            v: Joint velocities, shape (..., n) [rad/s].
            period: Time for which the accelerations are held [s].
        """
        if self.bounds == "acceleration":
            return self.clip(demand)
        return clip(demand, *self.limits.acceleration_box(q, v, period))

    @cached_property
    def _damping_matrix(self) -> Array:
        return scale(self.damping**2, np.eye(self.task_size))

    @cached_property
    def _identity(self) -> Array:
        return np.eye(self.limits.size)

    @cached_property
    def _bound(self) -> Array:
        return self.limits.require("acceleration", f"scheme: {self.scheme}")

    @property
    def keeps(self) -> tuple[str, ...]:
        if self.bounds == "acceleration":
            return ("acceleration",)
        return ("position", "velocity", "acceleration")

    @property
    def limits_remedy(self) -> str:
        return "a sampled law with law.bounds: all does"

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        sentences = self.broken_assumptions(metrics)
        if metrics.get("saturated_fraction", 0.0) > 0.5:
            sentences.append(
                "law: an explicit integrator with too long a step for velocity_gain has the same "
                "effect as a bound; give a period instead, or integrator.scheme: radau3"
            )
        return sentences

    def broken_assumptions(self, metrics: Mapping[str, float]) -> list[str]:
        """Return the reasons why a run with these metrics may not obey the paper's theorems."""
        assumptions = []
        fraction = metrics.get("saturated_fraction", 0.0)
        if fraction > 0.0:
            demand = metrics.get("joint_acceleration_demand_max_rad_s2", np.inf)
            assumptions.append(
                f"law: accelerations were clipped to their bounds in {100 * fraction:.3g} % of "
                f"the steps (demand up to {demand:.3g} rad/s^2); omega ignores the clipping, so "
                "the paper's theorems do not hold for this run"
            )
        singular = metrics.get("singular_value_min", np.inf)
        if singular < 0.1:
            assumptions.append(
                "law: J came close to losing rank, with a smallest singular value of "
                f"{singular:.3g}; the paper's theorems assume full rank"
            )
        error = metrics.get("position_error_max_m", 0.0)
        if error > 0.01:
            assumptions.append(f"law: the end effector was up to {error:.3g} m off its path")
        return assumptions

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        v = self.state.part(x, "v")
        demand, _ = self._rates(x, u)
        return self.observe(demand, self.clip(demand), v, u)

    def observe(self, demand: Array, v_dot: Array, v: Array, u: Signals) -> Signals:
        """Return the signals of `observables`.

        Args:
            demand: Demanded accelerations, shape (..., n) [rad/s^2].
            v_dot: Accelerations within the bounds, shape (..., n) [rad/s^2].
            v: Joint velocities, shape (..., n) [rad/s].
            u: Signals at the same instants.
        """
        xp = functions_of(demand)
        cut = (xp.abs(v_dot - demand) > 1e-9).any(axis=-1, keepdims=True)
        signals: dict[str, Array] = {"acceleration_demand": demand, "saturated": cut.astype(float)}
        if self.weighs_torque:
            effort = xp.einsum("...ij,...j->...i", u["M"], v_dot)
            return signals | {"torque": effort + u["bias"] - u["gravity"]}
        return signals | {"velocity_error_predicted": self._velocity_error(v, u)}

    def _velocity_error(self, v: Array, u: Signals) -> Array:
        """Return the limit of the velocity error by Theorem 1, shape (..., m) [m/s]."""
        J, error = u["J"], u["p_WE"] - u["p_WE_desired"]
        xp = functions_of(J)
        slip = xp.einsum("...mn,...n->...m", J, v) - u["v_WE_desired"]
        d = (self.task_beta + self.task_gamma) * slip + self.task_beta * self.task_gamma * error
        towards = self.position_gain * d
        if self.scheme == "galjdf":
            stiffness = self.return_beta * self.return_gamma
            c = (self.return_beta + self.return_gamma) * v + stiffness * (u["position"] - self.home)
            towards = towards + self.return_weight * xp.einsum("...mn,...n->...m", J, c)
        gram = J @ J.swapaxes(-1, -2) + self._damping_matrix
        sigma = xp.linalg.solve(gram, towards[..., np.newaxis])[..., 0]
        return -sigma / self.velocity_gain - self.composite_gain * error

    measured = OldName("measured_inputs")
    bounded = OldName("bound")
    observed = OldName("observe")
    clipped = OldName("clip")
