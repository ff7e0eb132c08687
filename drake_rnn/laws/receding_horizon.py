r"""A receding horizon for a chain of five integrators: six bounds held at every instant.

For each joint, every ``interval`` h anew, over the next H intervals,

.. math::
    \min \sum_{k=1}^H (q(t + k h) - q_d(t + k h))^2
        + w \sum_{k=0}^{H-1} (u_k / b_5)^2, \qquad |q^{(i)}| \le b_i, \quad
    q_- \le q \le q_+, \quad \text{at rest from } t + H h \text{ on},

where the fifth derivative, u_k, is constant over each interval. Beyond the paper, whose recursive
network bounds only its highest level.

A joint that moves so is a quintic spline with equal knots, and the unknowns are its coefficients
c_0 .. c_H. With D the differences of neighbours, the coefficients of the i-th derivative are
D^i c / h^i, and a spline lies between the least and the largest of its coefficients. Hence bounds
on these hold at every instant, not at samples only. They are stricter than need be by no more than
h^2 b_{i+2} / 4 or so. c_0 .. c_4 are where the joint is now; from c_H on they are all equal, for
there it rests. A plan that is shifted by one interval is a plan again, made of the same numbers:
there is always one that holds all bounds, and where the solver finds none, that one is followed.

The program is solved by a primal-dual method with Mehrotra's corrector, for all joints at once,
from the shifted plan. The normal matrix has five diagonals on each side, and its entries are linear
in the weights. Some ten iterations do; OSQP did not converge in 20000. PIQP would be as fast, at
the price of a dependency; Drake's Clarabel takes some four times as long.

Not modelled: the plan is followed from the instant at which it is made, and where the joints are
measured to be is not fed back. ``slip`` tells how far they are from the plan.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import Array, Positive, validated
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .law import JointPreview, Layout, SampledLaw, SampledReading, Signals
from .parts.horizon_program import HorizonProgram
from .parts.quintic_spline import EXPONENTS, FACTORS, ORDER, PIECE

# When the plan was made, before there is one [s].
_NEVER = -1.0


@validated
class RecedingHorizon(SampledLaw):
    """A sampled law that follows ``position_preview`` as closely as six bounds let it.

    Its state is v and the ``levels`` above, acceleration to crackle, at the end of the present
    sample; the ``plan``, coefficients of the spline that began at the time ``since``; and, of each
    joint, in how many intervals the plan before was kept, as ``fallbacks``.

    ``position_preview`` holds the desired joint positions at the ends of the next ``horizon``
    intervals, shape (horizon, n) [rad]; what of it lies beyond the position limits counts as
    at the limit.

    Args:
        limits: Of the joint positions and of all five derivatives; all finite.
        interval: Between two plans [s]; a multiple of the period.
        horizon: Intervals a plan looks ahead.
        effort: Weight of crackle, as a share of its bound [rad^2].
        margin: Share of the bounds of the derivatives that a plan may use.
    """

    kind: Literal["receding_horizon"] = "receding_horizon"
    limits: JointLimits
    interval: Positive = 0.1
    horizon: Annotated[int, Field(strict=True, ge=10, le=200)] = 80
    effort: Positive = 1e-6
    margin: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.998

    # The command is a quartic in time. Over a period h of 10 ms Simpson's rule, of third order, is
    # wrong by b_5 h^5 / 2880, below 1e-14 rad; the trapezoidal rule, of second order, by up to
    # h^2 b_2 / 12, some 1e-6 rad.
    integration_scheme = "runge_kutta3"

    def __post_init__(self) -> None:
        for name in ("position_lower", "position_upper", *DERIVATIVE_UNITS):
            bound = self.limits.require(name, "law: receding_horizon")
            if not np.isfinite(bound).all():
                raise ValueError(
                    f"limits.{name}: must be finite for law: receding_horizon, not {bound.tolist()}"
                )

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
            InvalidInputError: Unless the interval is a multiple of ``period`` [s].
        """
        samples = self.interval / period
        if round(samples) < 1 or abs(samples - round(samples)) > 1e-6:
            raise InvalidInputError(
                f"period: must divide law.interval, {self.interval:g} s, not {period:g}"
            )
        return super().sampled(period)

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """At rest where the joints are.

        Raises:
            InvalidInputError: If they are outside their position limits, or known to move.
        """
        q = u["position"]
        if (self.limits.violation(q) > 0.0).any():
            raise InvalidInputError(
                f"start: {self.limits.complaint(q)}, where law: receding_horizon starts"
            )
        if "velocity" in u and u["velocity"].any():
            raise InvalidInputError(
                "start: law: receding_horizon starts at rest, not with velocity "
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
        # Before the first sample there is no plan, and the joints rest.
        return velocity if x[since.start] != _NEVER else np.zeros(n)

    def planned_position(self, t: float | Array, x: Array) -> Array:
        """Joint positions at ``t``, within the plan's first interval, shape (..., n) [rad]."""
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
        """Of the five derivatives, shape (5, n)."""
        return np.array([self.limits.require(name, "its level") for name in DERIVATIVE_UNITS])

    @cached_property
    def _program(self) -> HorizonProgram:
        return HorizonProgram(
            self.limits, self._bounds, self.interval, self.horizon, self.effort, self.margin
        )

    def _derivatives(self, tau: float) -> Array:
        """Rows i that make of c_0 .. c_5 the i-th derivative at tau [s], shape (6, 6)."""
        powers = FACTORS * (tau / self.interval) ** EXPONENTS
        return np.asarray(powers @ PIECE / self._units)

    @cached_property
    def _units(self) -> Array:
        return np.asarray(self.interval ** np.arange(ORDER + 1.0))[:, np.newaxis]

    def _within_bounds(self, plan: Array) -> NDArray[np.bool_]:
        """Of each joint, whether a plan keeps all bounds at every instant, shape (n,)."""
        within = (plan >= self.limits.position_lower) & (plan <= self.limits.position_upper)
        kept = within.all(axis=0)
        level = np.concatenate((plan, np.repeat(plan[-1:], ORDER, axis=0)))
        for bound in self._bounds:
            level = np.diff(level, axis=0) / self.interval
            kept &= (np.abs(level) <= bound).all(axis=0)
        return np.asarray(kept)
