r"""A receding horizon for a chain of five integrators, with six bounds held at every instant.

For each joint, once per ``interval`` h, it solves over the next H intervals

.. math::
    \min \sum_{k=1}^H (q(t + k h) - q_d(t + k h))^2
        + w \sum_{k=0}^{H-1} (u_k / b_5)^2, \qquad |q^{(i)}| \le b_i, \quad
    q_- \le q \le q_+, \quad \text{at rest from } t + H h \text{ on},

where the fifth derivative, u_k, is constant over each interval. This goes beyond the paper of the
`recursive` network, which bounds only its highest level.

Such a motion is a quintic spline with equally spaced knots; the unknowns are its coefficients
c_0 .. c_H. With D the difference of neighbours, the coefficients of the i-th derivative are
D^i c / h^i. A spline lies between its smallest and its largest coefficient, so bounds on the
coefficients hold at every instant, not only at samples. They are stricter than necessary by at most
about h^2 b_{i+2} / 4. c_0 .. c_4 give the present state of the joint; from c_H on all coefficients
are equal, because the joint is at rest there. A plan shifted by one interval is again a plan, with
the same coefficients. So there is always a plan that holds all bounds, and it is kept where the
solver finds no other.

The program is solved by a primal-dual method with Mehrotra's corrector, for all joints at once,
from the shifted plan. The normal matrix has five diagonals on each side, and its entries are linear
in the weights. About ten iterations suffice; OSQP did not converge in 20000. PIQP would be as fast
but add a dependency; Drake's Clarabel takes about four times as long.

The time to compute a plan is not modelled, and the measured joint positions are not fed back;
``slip`` is their deviation from the plan.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import Array, Positive, Weight, between, validated
from ..inputs.keys import Meaning
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .law import JointPreview, SampledLaw, SampledReading
from .layout import Layout, Signals
from .parts.horizon_program import HorizonProgram
from .parts.quintic_spline import EXPONENTS, FACTORS, ORDER, PIECE

# Value of ``since`` before the first plan [s].
_NEVER = -1.0


@validated
class RecedingHorizon(SampledLaw):
    """A sampled law that follows ``position_preview`` as closely as six bounds allow.

    The state holds v and the ``levels`` above it, acceleration to crackle, at the end of the
    present sample; the ``plan``, coefficients of the spline that began at time ``since``; and
    ``fallbacks``, for each joint the number of intervals in which the previous plan was kept.

    ``position_preview`` holds the desired joint positions at the ends of the next ``horizon``
    intervals, shape (horizon, n) [rad]; they are clipped to the position limits.
    """

    kind: Literal["receding_horizon"] = "receding_horizon"
    summary = (
        "A receding horizon for a chain of five integrators, with six bounds held at every instant."
    )
    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joint positions and of all five derivatives; all finite."),
    ]
    interval: Annotated[
        Positive,
        between(1e-3, 1.0),
        Meaning("Time between two plans; a multiple of the sampling period.", unit="s"),
    ] = 0.1
    horizon: Annotated[
        int,
        Field(strict=True, ge=10, le=200),
        Meaning("Number of intervals that a plan covers."),
    ] = 80
    effort: Annotated[
        Weight,
        Meaning("Weight w of the crackle relative to its bound.", unit="rad^2"),
    ] = 1e-6
    margin: Annotated[
        float,
        Field(strict=True, gt=0, le=1),
        Meaning("Fraction of the derivatives' bounds that a plan may use."),
    ] = 0.998

    # The command is a quartic in time. Over a period h of 10 ms the error of Simpson's rule (third
    # order) is b_5 h^5 / 2880, below 1e-14 rad; that of the trapezoidal rule (second order) is up
    # to h^2 b_2 / 12, about 1e-6 rad.
    integration_scheme = "runge_kutta3"

    def __post_init__(self) -> None:
        for name in ("position_lower", "position_upper", *DERIVATIVE_UNITS):
            bound = self.limits.require(name, "law: receding_horizon")
            if not np.isfinite(bound).all():
                raise ValueError(
                    f"limits.{name}: must be finite for law: receding_horizon, not {bound.tolist()}"
                )

    @property
    def keeps(self) -> tuple[str, ...]:
        return ("position", *DERIVATIVE_UNITS)

    @property
    def joint_preview(self) -> JointPreview:
        return JointPreview(self.interval, self.horizon)

    @cached_property
    def state(self) -> Layout:
        n = self.limits.size
        return Layout(
            v=(n,),
            levels=(ORDER - 1, n),
            plan=(self.horizon + 1, n),
            since=(1,),
            fallbacks=(n,),
        )

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        return Layout(position=(n,), position_preview=(self.horizon, n))

    @cached_property
    def observables(self) -> Layout:
        return Layout(slip=(self.limits.size,))

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If ``interval`` is not a multiple of the period.
        """
        samples = self.interval / period
        if round(samples) < 1 or abs(samples - round(samples)) > 1e-6:
            raise InvalidInputError(
                f"period: must divide law.interval, {self.interval:g} s, not {period:g}"
            )
        return super().sampled(period)

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """Return the state at rest at the present joint positions.

        Raises:
            InvalidInputError: If the joints are outside their position limits, or known to move.
        """
        q = u["position"]
        if (self.limits.violation(q) > 0.0).any():
            raise InvalidInputError(f"start: {self.limits.complaint(q)} for law: receding_horizon")
        if "velocity" in u and u["velocity"].any():
            raise InvalidInputError(
                "start: law: receding_horizon must start at rest, not with velocity "
                f"{u['velocity'].tolist()}"
            )
        x = np.zeros(self.state.size)
        self.state.part(x, "plan")[:] = q
        self.state.part(x, "since")[:] = _NEVER
        return x

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        _, _, plan, since, fallbacks = self.state.split(x)
        began = float(since[0])
        if began == _NEVER or t - began > self.interval - 0.5 * period:
            desired = u["position_preview"]
            if not np.isfinite(desired).all():
                raise SimulationError("law: position_preview is not finite", t)
            if began != _NEVER:
                plan = np.concatenate((plan[1:], plan[-1:]))
            found, solved = self._program.improve(plan, desired)
            adopted = solved & self._within_bounds(found)
            plan = np.where(adopted, found, plan)
            fallbacks = fallbacks + ~adopted
            began = t
        levels = self._derivatives(t + period - began) @ plan[: ORDER + 1]
        return self.state.join(levels[1], levels[2:], plan, np.array([began]), fallbacks)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        plan, since, n = self._places
        first = x[plan.start : plan.start + (ORDER + 1) * n].reshape(ORDER + 1, n)
        velocity: Array = self._derivatives(t - x[since.start])[1] @ first
        # Before the first sample there is no plan, and the joints are at rest.
        return velocity if x[since.start] != _NEVER else np.zeros(n)

    def planned_position(self, t: float | Array, x: Array) -> Array:
        """Return the planned joint positions, shape (..., n) [rad].

        Args:
            t: Time within the plan's first interval [s].
            x: State, shape (..., state.size).
        """
        plan, since = self.state.part(x, "plan"), self.state.part(x, "since")[..., 0]
        tau = np.where(since == _NEVER, 0.0, t - since)
        powers = (tau[..., np.newaxis] / self.interval) ** np.arange(ORDER + 1)
        weights = powers @ PIECE
        return np.asarray(np.einsum("...k,...kn->...n", weights, plan[..., : ORDER + 1, :]))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {"slip": u["position"] - self.planned_position(t, x)}

    @cached_property
    def _places(self) -> tuple[slice, slice, int]:
        at = self.state.parts
        return at["plan"][0], at["since"][0], self.limits.size

    @cached_property
    def _bounds(self) -> Array:
        """Bounds of the five derivatives, shape (5, n) [rad/s .. rad/s^5]."""
        return np.array([self.limits.require(name, "its level") for name in DERIVATIVE_UNITS])

    @cached_property
    def _program(self) -> HorizonProgram:
        return HorizonProgram(
            self.limits, self._bounds, self.interval, self.horizon, self.effort, self.margin
        )

    def _derivatives(self, tau: float) -> Array:
        """Return the weights of c_0 .. c_5 in the i-th derivative at tau [s] as row i, (6, 6)."""
        powers = FACTORS * (tau / self.interval) ** EXPONENTS
        return np.asarray(powers @ PIECE / self._units)

    @cached_property
    def _units(self) -> Array:
        return np.asarray(self.interval ** np.arange(ORDER + 1.0))[:, np.newaxis]

    def _within_bounds(self, plan: Array) -> NDArray[np.bool_]:
        """Return for each joint whether a plan keeps all bounds at every instant, shape (n,)."""
        within = (plan >= self.limits.position_lower) & (plan <= self.limits.position_upper)
        kept = within.all(axis=0)
        level = np.concatenate((plan, np.repeat(plan[-1:], ORDER, axis=0)))
        for bound in self._bounds:
            level = np.diff(level, axis=0) / self.interval
            kept &= (np.abs(level) <= bound).all(axis=0)
        return np.asarray(kept)
