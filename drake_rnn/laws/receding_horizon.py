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
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError, SimulationError
from ..fields import Array, Positive, validated
from ..limits import DERIVATIVE_UNITS, JointLimits
from .law import Layout, Signals

_ORDER = len(DERIVATIVE_UNITS)
#: Weights of the coefficients in the value of a quintic spline at a knot.
_KNOT = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0

# When the plan was made, before there is one [s].
_NEVER = -1.0

# Of the solver. Complementarity at which a plan is good enough, and where it starts [rad^2]; the
# least slack it starts with; how far from the position limits it stays [rad].
_GOOD, _START, _SLACK, _AWAY = 1e-8, 1e-2, 0.1, 1e-5
_MOST_ITERATIONS = 40


@validated
class RecedingHorizon:
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

    def __post_init__(self) -> None:
        for name in ("position_lower", "position_upper", *DERIVATIVE_UNITS):
            bound = self.limits.require(name, "law: receding_horizon")
            if not np.isfinite(bound).all():
                raise ValueError(
                    f"limits.{name}: must be finite for law: receding_horizon, not {bound.tolist()}"
                )

    @property
    def holds_command(self) -> bool:
        return False

    @property
    def integration_scheme(self) -> str:
        """Drake's scheme that integrates the command, a quartic in time, to rounding.

        Over a period h of 10 ms Simpson's rule, of third order, is wrong by b_5 h^5 / 2880, below
        1e-14 rad; the trapezoidal rule, of second order, by up to h^2 b_2 / 12, some 1e-6 rad.
        """
        return "runge_kutta3"

    @cached_property
    def state(self) -> Layout:
        n = self.limits.size
        return Layout(
            v=(n,),
            levels=(_ORDER - 1, n),
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

    def check_period(self, period: float) -> None:
        """Raise an InvalidInputError unless the interval is a multiple of ``period`` [s]."""
        samples = self.interval / period
        if round(samples) < 1 or abs(samples - round(samples)) > 1e-6:
            raise InvalidInputError(
                f"period: must divide law.interval, {self.interval:g} s, not {period:g}"
            )

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """At rest where the joints are.

        Raises:
            InvalidInputError: If they are outside their position limits, or known to move.
        """
        q, limits = u["position"], self.limits
        excess = limits.violation(q)
        if (excess > 0.0).any():
            joint = int(np.argmax(excess))
            lower, upper = limits.position_lower[joint], limits.position_upper[joint]
            raise InvalidInputError(
                f"start: joint {joint + 1} is at {q[joint]:.6g} rad; law: receding_horizon starts "
                f"within the position limits, {lower:.6g} to {upper:.6g}"
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
            found, solved = self._solver.improve(plan, desired)
            adopted = solved & self._within_bounds(found)
            plan = np.where(adopted, found, plan)
            fallbacks = fallbacks + ~adopted
            began = t
        levels = self._derivatives(t + period - began) @ plan[: _ORDER + 1]
        return self.state.join(levels[1], levels[2:], plan, np.array([began]), fallbacks)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        plan, since, n = self._places
        first = x[plan.start : plan.start + (_ORDER + 1) * n].reshape(_ORDER + 1, n)
        velocity: Array = self._derivatives(t - x[since.start])[1] @ first
        # Before the first sample there is no plan, and the joints rest.
        return velocity if x[since.start] != _NEVER else np.zeros(n)

    def planned_position(self, t: float | Array, x: Array) -> Array:
        """Joint positions at ``t``, within the plan's first interval, shape (..., n) [rad]."""
        plan, since = self.state.part(x, "plan"), self.state.part(x, "since")[..., 0]
        tau = np.where(since == _NEVER, 0.0, t - since)
        powers = (tau[..., np.newaxis] / self.interval) ** np.arange(_ORDER + 1)
        weights = powers @ _PIECE
        return np.asarray(np.einsum("...k,...kn->...n", weights, plan[..., : _ORDER + 1, :]))

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
    def _solver(self) -> _Solver:
        return _Solver(self, self._bounds)

    def _derivatives(self, tau: float) -> Array:
        """Rows i that make of c_0 .. c_5 the i-th derivative at tau [s], shape (6, 6)."""
        powers = _FACTORS * (tau / self.interval) ** _EXPONENTS
        return np.asarray(powers @ _PIECE / self._units)

    @cached_property
    def _units(self) -> Array:
        return np.asarray(self.interval ** np.arange(_ORDER + 1.0))[:, np.newaxis]

    def _within_bounds(self, plan: Array) -> Array:
        """Of each joint, whether a plan keeps all bounds at every instant, shape (n,)."""
        within = (plan >= self.limits.position_lower) & (plan <= self.limits.position_upper)
        kept = within.all(axis=0)
        level = np.concatenate((plan, np.repeat(plan[-1:], _ORDER, axis=0)))
        for bound in self._bounds:
            level = np.diff(level, axis=0) / self.interval
            kept &= (np.abs(level) <= bound).all(axis=0)
        return np.asarray(kept)


def _quintic() -> Array:
    """Coefficients of s^0 .. s^5 that c_0 .. c_5 make on an interval, s in [0, 1], (6, 6)."""
    # Cox and de Boor: each piece of order p from two of order p - 1.
    pieces = np.ones((1, 1))
    for p in range(1, _ORDER + 1):
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


_PIECE = _quintic()
# The i-th derivative of s^k is _FACTORS[i, k] s^_EXPONENTS[i, k].
_EXPONENTS = np.maximum(np.arange(_ORDER + 1) - np.arange(_ORDER + 1)[:, np.newaxis], 0)
_FACTORS = np.array(
    [
        [float(np.prod(np.arange(k - i + 1, k + 1))) if k >= i else 0.0 for k in range(_ORDER + 1)]
        for i in range(_ORDER + 1)
    ]
)


class _Solver:
    """The quadratic program of one law; it holds matrices and no state."""

    def __init__(self, law: RecedingHorizon, bounds: Array) -> None:
        H, h = law.horizon, law.interval
        self._lower, self._upper = law.limits.position_lower, law.limits.position_upper
        self._margin = law.margin
        # Every level in terms of c_0 .. c_H, above which they are all equal; of rows only those
        # in which something is free.
        levels = [np.eye(H + 1)]
        for _ in range(_ORDER):
            padded = np.vstack((levels[-1], levels[-1][-1:] if len(levels) == 1 else [_zero(H)]))
            levels.append((np.diff(padded, axis=0) / h)[:H])
        rows = [level[_ORDER - i :] for i, level in enumerate(levels)]
        self._rows = np.vstack(rows)
        self._free = self._rows[:, _ORDER:].copy()
        self._order = np.repeat(np.arange(_ORDER + 1), [len(row) for row in rows])
        self._scale = np.vstack((np.ones(bounds.shape[1]), 1.0 / bounds))[self._order].T
        # Values at the knots ahead.
        values = np.zeros((H, H + 1))
        for k in range(H):
            np.add.at(values[k], np.minimum(np.arange(k + 1, k + 6), H), _KNOT)
        self._values = values
        effort = 2.0 * law.effort * levels[-1].T @ levels[-1]
        self._hessian = (
            2.0 * values.T @ values + effort / bounds[-1][:, np.newaxis, np.newaxis] ** 2
        )
        # The diagonals of rows^T W rows, a linear map of W.
        N = self._free.shape[1]
        row, column = (
            np.concatenate(i) for i in zip(*map(_diagonal(N), range(_ORDER + 1)), strict=True)
        )
        self._at, self._mirrored = row * N + column, column * N + row
        self._row, self._column = row, column
        self._products = np.ascontiguousarray(self._free[:, row] * self._free[:, column])
        self._curvature = self._hessian[:, _ORDER:, _ORDER:]

    def improve(self, plan: Array, desired: Array) -> tuple[Array, Any]:
        """The best plans that begin like the given ones, which hold the bounds.

        Args:
            plan: Shape (H + 1, n) [rad].
            desired: Positions at the knots ahead, shape (H, n) [rad].

        Returns:
            Plans, shape (H + 1, n), and whether they were found, shape (n,).
        """
        desired = np.clip(desired, self._lower, self._upper)
        # Of the differences from where the joint is, fewer digits are lost.
        origin = plan[_ORDER - 1]
        known = (plan - origin).T
        rows = (known @ self._rows.T) * self._scale
        positions = self._order == 0
        top = np.where(positions, (self._upper - _AWAY - origin)[:, np.newaxis], self._margin)
        low = np.where(positions, (self._lower + _AWAY - origin)[:, np.newaxis], -self._margin)
        # What is given must be a solution, if a bad one.
        room = np.stack((np.maximum(top, rows) - rows, rows - np.minimum(low, rows)))
        error = known @ self._values.T - (desired - origin).T
        gradient = 2.0 * error @ self._values
        effort = self._hessian - 2.0 * self._values.T @ self._values
        gradient = (gradient + _times(effort, known))[:, _ORDER:]
        change, solved = self._solve(room, gradient)
        found = plan.copy()
        found[_ORDER:] += change.T
        return found, solved

    def _solve(self, room: Array, gradient: Array) -> tuple[Array, Any]:
        """The change x of the free coefficients, -room[1] <= rows x <= room[0]."""
        n, N = gradient.shape
        result, solved = np.zeros((n, N)), np.zeros(n, dtype=bool)
        joints = np.arange(n)
        scale, curvature = self._scale, self._curvature
        x = np.zeros((n, N))
        slack = np.maximum(room, _SLACK)
        force = _START / slack
        sign = np.array([1.0, -1.0])[:, np.newaxis, np.newaxis]
        count = 2 * room.shape[2]
        for _ in range(_MOST_ITERATIONS):
            missing = room - sign * ((x @ self._free.T) * scale) - slack
            mu = (slack * force).sum(axis=(0, 2)) / count
            done = (mu < _GOOD) & (np.abs(missing).max(axis=(0, 2)) < 1e-7)
            if done.any():
                result[joints[done]], solved[joints[done]] = x[done], True
                if done.all():
                    break
                left = ~done
                joints, x, mu = joints[left], x[left], mu[left]
                gradient, scale, curvature = gradient[left], scale[left], curvature[left]
                room, slack, force = room[:, left], slack[:, left], force[:, left]
                missing = missing[:, left]
            pull = gradient + _times(curvature, x)
            weights = (force / slack).sum(axis=0) * scale**2
            matrix, root = self._normal_matrix(weights @ self._products, curvature)

            def direction(
                target: Array,
                slack: Array = slack,
                force: Array = force,
                missing: Array = missing,
                pull: Array = pull,
                scale: Array = scale,
                matrix: Array = matrix,
                root: Array = root,
            ) -> tuple[Array, Array, Array]:
                """Newton's step for slack * force + target = 0."""
                pushed = force - (target + force * missing) / slack
                net = (pushed[0] - pushed[1]) * scale
                known = (pull + net @ self._free) * root
                dx = -np.linalg.solve(matrix, known[:, :, np.newaxis])[:, :, 0] * root
                ds = missing - sign * ((dx @ self._free.T) * scale)
                return dx, ds, -(target + force * ds) / slack

            product = slack * force
            try:
                _, ds, df = direction(product)
                a, b = _share(slack, ds, 1.0), _share(force, df, 1.0)
                left_over = ((slack + a * ds) * (force + b * df)).sum(axis=(0, 2)) / count
                centre = (mu * (left_over / mu) ** 3)[:, np.newaxis]
                dx, ds, df = direction(product + ds * df - centre)
            except np.linalg.LinAlgError:
                # Singular to working precision: so near the bounds is it already.
                break
            a, b = _share(slack, ds, 0.99), _share(force, df, 0.99)
            x, slack, force = x + a * dx, slack + a * ds, force + b * df
        if not solved[joints].any():
            # Short of the best, a plan is still good if it is better than the one there is.
            worth = ((gradient + 0.5 * _times(curvature, x)) * x).sum(axis=1)
            result[joints], solved[joints] = x, worth < 0.0
        return result, solved

    def _normal_matrix(self, band: Array, curvature: Array) -> tuple[Array, Array]:
        """Scaled to a diagonal of ones, of which it spans many orders; and the scale."""
        n, N = len(band), curvature.shape[-1]
        band = band + curvature[:, self._row, self._column]
        root = 1.0 / np.sqrt(band[:, :N])
        matrix = np.zeros((n, N * N))
        band = band * root[:, self._row] * root[:, self._column]
        matrix[:, self._at] = matrix[:, self._mirrored] = band
        return matrix.reshape(n, N, N), root


def _zero(size: int) -> Array:
    return np.zeros(size + 1)


def _diagonal(size: int) -> Any:
    return lambda d: (np.arange(size - d), np.arange(d, size))


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


def _share(value: Array, change: Array, most: float) -> Array:
    """How much of a change keeps a value positive, of each joint, at most 1, shape (n, 1)."""
    steepest = (-change / value).max(axis=(0, 2))
    return np.asarray(np.minimum(1.0, most / np.maximum(steepest, 1e-9)))[:, np.newaxis]
