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

The quadratic program of a receding horizon, for all joints at once.

It fits quintic splines to desired values at the knots by least squares, with bounds on the
coefficients of the splines and of their derivatives. The solver is a primal-dual method with
Mehrotra's corrector. The normal matrix has five diagonals on each side, and its entries are linear
in the weights.

Quintic splines with equally spaced knots; six coefficients determine each piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import Array, Positive, Weight, between, validated
from ..inputs.keys import Meaning
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .law import JointPreview, Layout, SampledLaw, SampledReading, Signals

#: Degree of the splines, and the order of their highest derivative.
ORDER = 5
#: Weights of the coefficients in a spline's value at a knot.
KNOT = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0


def _quintic() -> Array:
    """Return the matrix from c_0 .. c_5 to the coefficients of s^0 .. s^5, shape (6, 6).

    s runs from 0 to 1 on the interval.
    """
    # Cox-de Boor recursion: each piece of order p follows from two of order p - 1.
    pieces = np.ones((1, 1))
    for p in range(1, ORDER + 1):
        up = np.zeros((p + 1, p + 1))
        for j in range(p):
            rising = np.concatenate(([0.0], pieces[:, j])) + (p - 1 - j) * np.append(
                pieces[:, j], 0.0
            )
            full = p * np.append(pieces[:, j], 0.0)
            up[:, j + 1] += rising / p
            up[:, j] += (full - rising) / p
        pieces = up
    return pieces


#: Matrix from c_0 .. c_5 to the coefficients of s^0 .. s^5 on an interval, s in [0, 1].
PIECE = _quintic()
#: The i-th derivative of s^k is FACTORS[i, k] s^EXPONENTS[i, k].
EXPONENTS = np.maximum(np.arange(ORDER + 1) - np.arange(ORDER + 1)[:, np.newaxis], 0)
#: See EXPONENTS.
FACTORS = np.array(
    [
        [float(np.prod(np.arange(k - i + 1, k + 1))) if k >= i else 0.0 for k in range(ORDER + 1)]
        for i in range(ORDER + 1)
    ]
)


Flags = NDArray[np.bool_]

# Complementarity at convergence and at the start [rad^2]; smallest initial slack; distance that
# plans keep from the position limits [rad].
_GOOD, _START, _SLACK, _AWAY = 1e-8, 1e-2, 0.1, 1e-5
_MOST_ITERATIONS = 40
# Signs of the two sets of bounds: upper, lower.
_SIGN = np.array([1.0, -1.0])[:, np.newaxis, np.newaxis]


class HorizonProgram:
    """The quadratic program of one law; it holds matrices and no state.

    Args:
        limits: Limits of the joint positions.
        bounds: Bounds of the five derivatives, shape (5, n) [rad/s .. rad/s^5].
        interval: Time between two knots [s].
        horizon: Number H of knots ahead.
        effort: Weight of the crackle relative to its bound [rad^2].
        margin: Fraction of the derivatives' bounds that a plan may use.
    """

    def __init__(
        self,
        limits: JointLimits,
        bounds: Array,
        interval: float,
        horizon: int,
        effort: float,
        margin: float,
    ) -> None:
        H, h = horizon, interval
        self._lower, self._upper = limits.position_lower, limits.position_upper
        self._margin = margin
        # Each derivative's coefficients in terms of c_0 .. c_H, beyond which all c are equal; rows
        # without a free coefficient are left out.
        levels = [np.eye(H + 1), np.diff(np.eye(H + 1), axis=0) / h]
        for _ in range(ORDER - 1):
            levels.append(np.diff(levels[-1], axis=0, append=np.zeros((1, H + 1))) / h)
        rows = [level[ORDER - i :] for i, level in enumerate(levels)]
        self._rows = np.vstack(rows)
        self._free = self._rows[:, ORDER:].copy()
        self._order = np.repeat(np.arange(ORDER + 1), [len(row) for row in rows])
        self._scale = np.vstack((np.ones(bounds.shape[1]), 1.0 / bounds))[self._order].T
        # Values at the knots ahead in terms of c_0 .. c_H.
        values = np.zeros((H, H + 1))
        for k in range(H):
            np.add.at(values[k], np.minimum(np.arange(k + 1, k + 6), H), KNOT)
        self._values = values
        crackle = 2.0 * effort * levels[-1].T @ levels[-1]
        self._hessian = (
            2.0 * values.T @ values + crackle / bounds[-1][:, np.newaxis, np.newaxis] ** 2
        )
        # The map from W to the diagonals of rows^T W rows, which is linear.
        N = self._free.shape[1]
        row = np.concatenate([np.arange(N - d) for d in range(ORDER + 1)])
        column = np.concatenate([np.arange(d, N) for d in range(ORDER + 1)])
        self._at, self._mirrored = row * N + column, column * N + row
        self._row, self._column = row, column
        self._products = np.ascontiguousarray(self._free[:, row] * self._free[:, column])
        self._curvature = self._hessian[:, ORDER:, ORDER:]

    def improve(self, plan: Array, desired: Array) -> tuple[Array, Flags]:
        """Return the best plans that begin like the given ones.

        Args:
            plan: Coefficients of plans that hold the bounds, shape (H + 1, n) [rad].
            desired: Desired positions at the knots ahead, shape (H, n) [rad].

        Returns:
            Coefficients of the plans, shape (H + 1, n) [rad], and for each joint whether one was
            found, shape (n,).
        """
        desired = np.clip(desired, self._lower, self._upper)
        # Differences from the present position lose fewer digits.
        origin = plan[ORDER - 1]
        offsets = (plan - origin).T
        rows = (offsets @ self._rows.T) * self._scale
        positions = self._order == 0
        top = np.where(positions, (self._upper - _AWAY - origin)[:, np.newaxis], self._margin)
        low = np.where(positions, (self._lower + _AWAY - origin)[:, np.newaxis], -self._margin)
        # Widen the bounds where needed, so that the given plan is feasible.
        room = np.stack((np.maximum(top, rows) - rows, rows - np.minimum(low, rows)))
        error = offsets @ self._values.T - (desired - origin).T
        gradient = 2.0 * error @ self._values
        effort = self._hessian - 2.0 * self._values.T @ self._values
        gradient = (gradient + _times(effort, offsets))[:, ORDER:]
        change, is_solved = self._solve(room, gradient)
        better = plan.copy()
        better[ORDER:] += change.T
        return better, is_solved

    def _solve(self, room: Array, gradient: Array) -> tuple[Array, Flags]:
        """Return the change of the free coefficients, and for each joint whether it was found.

        Args:
            room: Distances to the upper and lower bounds: -room[1] <= rows x <= room[0] for the
                change x, shape (2, n, number of rows).
            gradient: Gradient of the cost at the given plan, shape (n, number of coefficients).
        """
        n, N = gradient.shape
        result, is_solved = np.zeros((n, N)), np.zeros(n, dtype=bool)
        # Joints not yet solved; the arrays in the loop hold only these.
        joints = np.arange(n)
        scale, curvature = self._scale, self._curvature
        x = np.zeros((n, N))
        slack = np.maximum(room, _SLACK)
        force = _START / slack
        count = 2 * room.shape[2]
        for _ in range(_MOST_ITERATIONS):
            missing = room - _SIGN * ((x @ self._free.T) * scale) - slack
            mu = (slack * force).sum(axis=(0, 2)) / count
            is_done = (mu < _GOOD) & (np.abs(missing).max(axis=(0, 2)) < 1e-7)
            if is_done.any():
                result[joints[is_done]], is_solved[joints[is_done]] = x[is_done], True
                left = ~is_done
                joints, x, mu = joints[left], x[left], mu[left]
                gradient, scale, curvature = gradient[left], scale[left], curvature[left]
                room, slack, force = room[:, left], slack[:, left], force[:, left]
                missing = missing[:, left]
            if not joints.size:
                break
            weights = (force / slack).sum(axis=0) * scale**2
            matrix, root = self._normal_matrix(weights @ self._products, curvature)
            pull = gradient + _times(curvature, x)
            newton = _Newton(self._free, scale, slack, force, missing, pull, matrix, root)
            product = slack * force
            try:
                _, ds, df = newton.direction(product)
                a, b = _share(slack, ds, 1.0), _share(force, df, 1.0)
                left_over = ((slack + a * ds) * (force + b * df)).sum(axis=(0, 2)) / count
                centre = (mu * (left_over / mu) ** 3)[:, np.newaxis]
                dx, ds, df = newton.direction(product + ds * df - centre)
            except np.linalg.LinAlgError:
                # Singular to working precision, because the iterate is so close to its bounds.
                break
            a, b = _share(slack, ds, 0.99), _share(force, df, 0.99)
            x, slack, force = x + a * dx, slack + a * ds, force + b * df
        # A plan that is not optimal is still used if it is better than the given one.
        worth = ((gradient + 0.5 * _times(curvature, x)) * x).sum(axis=1)
        result[joints], is_solved[joints] = x, worth < 0.0
        return result, is_solved

    def _normal_matrix(self, band: Array, curvature: Array) -> tuple[Array, Array]:
        """Return the normal matrix, scaled to a diagonal of ones, and the scale.

        Unscaled, the diagonal spans many orders of magnitude.
        """
        n, N = len(band), curvature.shape[-1]
        band = band + curvature[:, self._row, self._column]
        root = 1.0 / np.sqrt(band[:, :N])
        matrix = np.zeros((n, N * N))
        band = band * root[:, self._row] * root[:, self._column]
        matrix[:, self._at] = matrix[:, self._mirrored] = band
        return matrix.reshape(n, N, N), root


@dataclass(frozen=True)
class _Newton:
    """The Newton equations at one iterate, for the joints not yet solved.

    ``missing`` is the residual of the bounds: the room less the slack and less the signed rows of
    ``free`` times ``scale``. ``pull`` is the gradient, ``matrix`` the normal matrix, scaled by
    ``root``.
    """

    free: Array
    scale: Array
    slack: Array
    force: Array
    missing: Array
    pull: Array
    matrix: Array
    root: Array

    def direction(self, target: Array) -> tuple[Array, Array, Array]:
        """Return the steps of x, slack and force, with slack df + force ds = -target."""
        gradient = self.force - (target + self.force * self.missing) / self.slack
        net = (gradient[0] - gradient[1]) * self.scale
        pulls = (self.pull + net @ self.free) * self.root
        dx = -np.linalg.solve(self.matrix, pulls[:, :, np.newaxis])[:, :, 0] * self.root
        ds = self.missing - _SIGN * ((dx @ self.free.T) * self.scale)
        return dx, ds, -(target + self.force * ds) / self.slack


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


def _share(value: Array, change: Array, most: float) -> Array:
    """Return for each joint the fraction of a change that keeps a value positive, shape (n, 1).

    Args:
        value: Positive values, shape (2, n, number of rows).
        change: Changes of the same shape.
        most: Fraction of the way to zero that may be used; the result is at most 1.
    """
    steepest = (-change / value).max(axis=(0, 2))
    return np.asarray(np.minimum(1.0, most / np.maximum(steepest, 1e-9)))[:, np.newaxis]


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
    def returns_inside(self) -> bool:
        """See `Law.returns_inside`; a horizon begins within the limits."""
        return False

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
            best, is_solved = self._program.improve(plan, desired)
            is_adopted = is_solved & self._within_bounds(best)
            plan = np.where(is_adopted, best, plan)
            fallbacks = fallbacks + ~is_adopted
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
        is_within = within.all(axis=0)
        level = np.concatenate((plan, np.repeat(plan[-1:], ORDER, axis=0)))
        for bound in self._bounds:
            level = np.diff(level, axis=0) / self.interval
            is_within &= (np.abs(level) <= bound).all(axis=0)
        return np.asarray(is_within)
