"""The quadratic program of a receding horizon, for all joints at once.

It fits quintic splines to desired values at the knots by least squares, with bounds on the
coefficients of the splines and of their derivatives. The solver is a primal-dual method with
Mehrotra's corrector. The normal matrix has five diagonals on each side, and its entries are linear
in the weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from ...robot.limits import JointLimits
from .quintic_spline import KNOT, ORDER

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
        known = (plan - origin).T
        rows = (known @ self._rows.T) * self._scale
        positions = self._order == 0
        top = np.where(positions, (self._upper - _AWAY - origin)[:, np.newaxis], self._margin)
        low = np.where(positions, (self._lower + _AWAY - origin)[:, np.newaxis], -self._margin)
        # Widen the bounds where needed, so that the given plan is feasible.
        room = np.stack((np.maximum(top, rows) - rows, rows - np.minimum(low, rows)))
        error = known @ self._values.T - (desired - origin).T
        gradient = 2.0 * error @ self._values
        effort = self._hessian - 2.0 * self._values.T @ self._values
        gradient = (gradient + _times(effort, known))[:, ORDER:]
        change, solved = self._solve(room, gradient)
        found = plan.copy()
        found[ORDER:] += change.T
        return found, solved

    def _solve(self, room: Array, gradient: Array) -> tuple[Array, Flags]:
        """Return the change of the free coefficients, and for each joint whether it was found.

        Args:
            room: Distances to the upper and lower bounds: -room[1] <= rows x <= room[0] for the
                change x, shape (2, n, number of rows).
            gradient: Gradient of the cost at the given plan, shape (n, number of coefficients).
        """
        n, N = gradient.shape
        result, solved = np.zeros((n, N)), np.zeros(n, dtype=bool)
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
            done = (mu < _GOOD) & (np.abs(missing).max(axis=(0, 2)) < 1e-7)
            if done.any():
                result[joints[done]], solved[joints[done]] = x[done], True
                left = ~done
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
        result[joints], solved[joints] = x, worth < 0.0
        return result, solved

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
        pushed = self.force - (target + self.force * self.missing) / self.slack
        net = (pushed[0] - pushed[1]) * self.scale
        known = (self.pull + net @ self.free) * self.root
        dx = -np.linalg.solve(self.matrix, known[:, :, np.newaxis])[:, :, 0] * self.root
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
