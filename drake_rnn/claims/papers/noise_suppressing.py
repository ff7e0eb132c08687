"""Measures of the claims of noise-suppressing neural dynamics, of their code for a UR5.

The authors' network, recomputed from their equations. The program is to minimise |v|^2 / 2 where
J v = p_d' and C v <= d, with C = (I, -I). With x = d - C v and multipliers lambda and mu,

    E = (v + J^T lambda + C^T mu, J v - p_d', x + mu - sqrt(x^2 + mu^2 + nu)),
    E' = -eta s(E) - gamma s(E + eta s(Y)) + n,  Y' = E,

is solved for (v, lambda, mu)'; s cuts each entry at 1, and n is the disturbance. Joint positions
are the integral of v: no error of the position is fed back. The dual network, to which the authors
compare theirs, is

    u' = gamma (g(K K^T u - u) - K K^T u + n),  v = K^T u,  K = (J, I),

where g cuts to (p_d', d). Both are solved by Runge and Kutta's method of fourth order, the first in
finer steps at the start, where it settles, and at the end, so that what is left is none of theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from ...inputs.fields import Array
from ..claims import Run, end_of_chain

# A UR5: twists [rad], lengths and offsets [m], by Denavit and Hartenberg.
_LINKS = (
    (np.pi / 2.0, 0.0, 0.0, np.pi / 2.0, -np.pi / 2.0, 0.0),
    (0.0, -0.425, -0.39225, 0.0, 0.0, 0.0),
    (0.089459, 0.0, 0.0, 0.10915, 0.09465, 0.0823),
)
# Gains gamma and eta [1/s], bound of velocities [rad/s], disturbance, smoothing, multipliers first.
_GAIN, _FASTEST, _DISTURBANCE, _SMOOTH, _FIRST = 1e3, 0.5, 5.0, np.finfo(float).eps, 1e-3
# Period of the solver [s], and into how many it is divided in the first and the last [s] of a run.
_STEP, _FINER, _FINE = 1e-3, 8, 0.05
_N, _M, _BOUNDS = 6, 3, 12
_U = _N + _M + _BOUNDS
_C = np.vstack((np.eye(_N), -np.eye(_N)))


class _Setting(NamedTuple):
    """Joint positions at first [rad], size of the path [1] and duration [s]."""

    start: tuple[float, ...]
    size: float
    duration: float


_SETTINGS = {
    "code": _Setting((0.0, np.pi / 4.0, 0.0, np.pi / 2.0, -np.pi / 4.0, 0.0), 0.3, 20.0),
    "data": _Setting(
        (
            3.06147011763390,
            4.91919437438584,
            1.15856762876936,
            -1.76838518750552,
            1.865185438670004,
            2.65270000000000,
        ),
        1.0,
        10.0,
    ),
}


class _Course(NamedTuple):
    """Joint positions, shape (k, 6), velocities, (k, 6), and the residual at the end, (21,)."""

    position: Array
    velocity: Array
    residual: Array


def residual(run: Run) -> float:
    """Norm of the residual at the end of the code's run [1]."""
    return float(np.linalg.norm(_simulate("code", _DISTURBANCE).residual))


def position_error(run: Run, disturbance: float = _DISTURBANCE, axis: int | None = None) -> float:
    """Distance of the tip from its place on the path, at the end of the code's run [m].

    Args:
        run: Not needed.
        disturbance: What is added to each equation.
        axis: 0 to 2 for how far it is beyond its place along an axis; None for the norm.
    """
    e = _apart("code", _simulate("code", disturbance).position[-1])
    return float(np.linalg.norm(e) if axis is None else e[axis])


def displacement(run: Run, joint: int, setting: str = "code", time: float = 10.0) -> float:
    """Way of a joint from the start to a time [rad], of joints 1 to 6.

    Args:
        run: Not needed.
        joint: Number of the joint.
        setting: ``code`` or ``data``.
        time: The time [s].
    """
    q = _simulate(setting, _DISTURBANCE).position
    return float(q[round(time / _STEP), joint - 1] - q[0, joint - 1])


def reach(run: Run, joint: int, setting: str = "code") -> float:
    """Farthest that a joint is from its start, within 10 s [rad]."""
    q = _simulate(setting, _DISTURBANCE).position[: round(10.0 / _STEP) + 1, joint - 1]
    return float(np.abs(q - q[0]).max())


def fastest(run: Run, setting: str = "code") -> float:
    """Largest joint velocity [rad/s]."""
    return float(np.abs(_simulate(setting, _DISTURBANCE).velocity).max())


def off_optimum(run: Run, setting: str = "code") -> float:
    """Largest distance of a joint velocity from the program's optimum [rad/s].

    At 20 times from 1 s on.
    """
    course, worst = _simulate(setting, _DISTURBANCE), 0.0
    duration, size = _SETTINGS[setting].duration, _SETTINGS[setting].size
    for k in np.linspace(round(1.0 / _STEP), round(duration / _STEP), 20).astype(int):
        J, onward = _tip(course.position[k])[1], _path(float(k * _STEP), size)[1]
        worst = max(worst, float(np.abs(course.velocity[k] - _optimum(J, onward)).max()))
    return worst


def dual_position_error(run: Run, amplified: bool = True) -> float:
    """Distance of the tip from its place after the code's run of the dual network [m].

    Args:
        run: Not needed.
        amplified: Whether the disturbance is within the gain, as in the code.
    """
    start, size, duration = _SETTINGS["code"]
    within = _DISTURBANCE if amplified else _DISTURBANCE / _GAIN

    def rates(t: float, y: Array) -> Array:
        J, onward = _jacobian(y[:_N], np.zeros(_N))[0], _path(t, size)[1]
        K, u = np.vstack((J, np.eye(_N))), y[_N:]
        v = K.T @ u
        most = np.append(onward, np.full(_N, _FASTEST))
        least = np.append(onward, np.full(_N, -_FASTEST))
        return np.append(v, _GAIN * (np.clip(K @ v - u, least, most) - K @ v + within))

    y = np.append(start, np.zeros(_M + _N))
    for k in range(round(duration / _STEP)):
        # A period is too long for the fastest of its modes.
        y = _onward(rates, k * _STEP, y, 2)
    return float(np.linalg.norm(_apart("code", y[:_N])))


def residual_from_anywhere(run: Run, what: str) -> float:
    """Largest residual after 5 s, of three random starts; infinite if one diverges [1].

    Args:
        run: Not needed.
        what: What is random: ``velocities and multipliers``, or ``all`` of the state.
    """
    worst = 0.0
    for seed in range(3):
        y = np.random.default_rng(seed).normal(size=_N + 2 * _U)
        if what != "all":
            y[:_N], y[_N + _U :] = _SETTINGS["code"].start, 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            course = _solve(y, _SETTINGS["code"].size, 5.0, _DISTURBANCE)
        if not np.isfinite(course.residual).all():
            return np.inf
        worst = max(worst, float(np.linalg.norm(course.residual)))
    return worst


@cache
def _simulate(setting: str, disturbance: float) -> _Course:
    """Return the course of the network."""
    start, size, duration = _SETTINGS[setting]
    first = np.concatenate((np.zeros(_N), np.full(_M + _BOUNDS, _FIRST), np.zeros(_U)))
    return _solve(np.append(start, first), size, duration, disturbance)


def _solve(y: Array, size: float, duration: float, disturbance: float) -> _Course:
    """Return the course from a state: joint positions, (v, lambda, mu), and Y.

    Where it diverges it ends, with a residual that is not finite.
    """

    def rates(t: float, y: Array) -> Array:
        return _network(t, y, size, disturbance)[0]

    count = round(duration / _STEP)
    states = np.zeros((count + 1, 2 * _N))
    for k in range(count):
        states[k] = y[: 2 * _N]
        near_an_end = min(k, count - 1 - k) * _STEP < _FINE
        y = _onward(rates, k * _STEP, y, _FINER if near_an_end else 1)
        if not np.isfinite(y).all():
            return _Course(states[:k, :_N], states[:k, _N:], np.full(_U, np.inf))
    states[count] = y[: 2 * _N]
    return _Course(states[:, :_N], states[:, _N:], _network(duration, y, size, disturbance)[1])


def _network(t: float, y: Array, size: float, disturbance: float) -> tuple[Array, Array]:
    """Return the rates of the network's state, and its residual E."""
    q, u, total = y[:_N], y[_N : _N + _U], y[_N + _U :]
    v, multipliers, mu = u[:_N], u[_N : _N + _M], u[_N + _M :]
    _, onward, change = _path(t, size)
    J, J_dot = _jacobian(q, v)
    x = _FASTEST - _C @ v
    length = np.sqrt(x * x + mu * mu + _SMOOTH)
    E = np.concatenate((v + J.T @ multipliers + _C.T @ mu, J @ v - onward, x + mu - length))
    M = np.zeros((_U, _U))
    M[:_N, :_N], M[:_N, _N : _N + _M], M[:_N, _N + _M :] = np.eye(_N), J.T, _C.T
    M[_N : _N + _M, :_N] = J
    M[_N + _M :, :_N] = (x / length - 1.0)[:, np.newaxis] * _C
    M[_N + _M :, _N + _M :] = np.diag(1.0 - mu / length)
    known = np.concatenate((J_dot.T @ multipliers, J_dot @ v - change, np.zeros(_BOUNDS)))
    wanted = -_GAIN * (_cut(E) + _cut(E + _GAIN * _cut(total))) + disturbance
    return np.concatenate((v, np.linalg.solve(M, wanted - known), E)), E


def _onward(rates: Callable[[float, Array], Array], t: float, y: Array, parts: int) -> Array:
    """Return a state one period later, in a number of steps."""
    dt = _STEP / parts
    for k in range(parts):
        now = t + k * dt
        a = rates(now, y)
        b = rates(now + 0.5 * dt, y + 0.5 * dt * a)
        c = rates(now + 0.5 * dt, y + 0.5 * dt * b)
        d = rates(now + dt, y + dt * c)
        y = np.asarray(y + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d))
    return y


def _cut(e: Array) -> Array:
    """Return the bounded activation."""
    return np.clip(e, -1.0, 1.0)


def _tip(q: Array) -> tuple[Array, Array]:
    """Return the tip's position and its Jacobian."""
    return end_of_chain(q, *_LINKS)


def _jacobian(q: Array, v: Array) -> tuple[Array, Array]:
    """Return the Jacobian of the tip and its rate along a motion.

    As those of `_tip`, from the axes and links of this arm: a run asks for them 10^5 times.
    """
    s, c, along = np.sin(q[0]), np.cos(q[0]), np.cumsum(q[1:4])
    up, out, aside = np.array([0.0, 0.0, 1.0]), np.array([c, s, 0.0]), np.array([s, -c, 0.0])
    beams = np.cos(along)[:, np.newaxis] * out + np.sin(along)[:, np.newaxis] * up
    wrist = np.sin(along[2]) * out - np.cos(along[2]) * up
    hand = np.cos(q[4]) * aside - np.sin(q[4]) * beams[2]
    axes = np.array([up, aside, aside, aside, wrist, hand]).T
    _, a, d = _LINKS
    links = np.array(
        [d[0] * up, a[1] * beams[0], a[2] * beams[1], d[3] * aside, d[4] * wrist, d[5] * hand]
    ).T
    J = _cross(axes, np.cumsum(links[:, ::-1], axis=1)[:, ::-1])
    after = np.cumsum((v * J)[:, ::-1], axis=1)[:, ::-1] - v * J
    return J, _cross(np.cumsum(v * axes, axis=1), J) + _cross(axes, after)


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of columns."""
    one, two = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[one] * b[two] - a[two] * b[one])


def _path(t: float, size: float) -> tuple[Array, Array, Array]:
    """Return how far the path has gone, its velocity and its acceleration."""
    c, s, c4, s4 = np.cos(2.0 * t), np.sin(2.0 * t), np.cos(4.0 * t / 3.0), np.sin(4.0 * t / 3.0)
    way = np.array([c / 25.0 + c4 / 10.0 - 0.14, s / 25.0 - 3.0 * s4 / 50.0, 0.0])
    velocity = np.array([-2.0 * s / 25.0 - 2.0 * s4 / 15.0, 2.0 * (c - c4) / 25.0, 0.0])
    acceleration = np.array(
        [-4.0 * c / 25.0 - 8.0 * c4 / 45.0, 8.0 * s4 / 75.0 - 4.0 * s / 25.0, 0.0]
    )
    return size * way, size * velocity, size * acceleration


def _apart(setting: str, q: Array) -> Array:
    """Return how far the tip is beyond its place at the end of a run, shape (3,)."""
    start, size, duration = _SETTINGS[setting]
    return _tip(q)[0] - _tip(np.array(start))[0] - _path(duration, size)[0]


def _optimum(J: Array, onward: Array) -> Array:
    """Return the least-norm velocities within the bounds, as Drake's Clarabel finds them."""
    problem = MathematicalProgram()
    v = problem.NewContinuousVariables(_N)
    problem.AddQuadraticCost(np.eye(_N), np.zeros(_N), v, is_convex=True)
    problem.AddLinearEqualityConstraint(J, onward, v)
    problem.AddBoundingBoxConstraint(-_FASTEST, _FASTEST, v)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-12)
    return np.asarray(ClarabelSolver().Solve(problem, None, options).GetSolution(v))
