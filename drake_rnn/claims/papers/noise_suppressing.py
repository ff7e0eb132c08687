"""Measures of the noise-suppressing neural dynamics' claims: the equations as their code has them.

Of a UR5: least |v| with J v = b and |v| at most 0.5 rad/s on each joint. With U = (v, multipliers
lambda of J v = b, mu of the bounds) and e = d - C v, what should vanish is::

    E = [v + J^T lambda + C^T mu; J v - b; d - C v + mu - sqrt(e^2 + mu^2 + eps)]
    M dU/dt = -N U - dh/dt - eta A(E) - gamma A(E + eta A(integral of E)) + noise

with A the clip to -1 and 1. Its rival is a dual neural network of the same program,
du/dt = gamma (P(K u - u) - K u + noise) with v = R^T u, R the rows of J and of the joints, and
K = R R^T. The same noise, 5, is added to each.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ...inputs.fields import Array
from ...robot.load_arm import load_arm
from ..claims import Run

_GAIN, _FASTEST, _SHORT, _STEP, _N = 1e3, 0.5, 1e-6, 1e-3, 6
_START = np.array([0.0, 0.25 * np.pi, 0.0, 0.5 * np.pi, -0.25 * np.pi, 0.0])
_C = np.vstack((np.eye(_N), -np.eye(_N)))
# The base of the code's UR5 is turned by half a turn against that of the model.
_SIZE = np.array([-0.3, -0.3, 0.0])
_BOUND = np.full(2 * _N, _FASTEST)
_EPS = float(np.finfo(float).eps)


def error(run: Run, network: str, noise: float, duration: float) -> float:
    """Largest distance from the path [m]."""
    time, q, _, _ = _course(network, noise, duration, 1e-3)
    kinematics = load_arm("ur5").kinematics()
    p = np.array([kinematics.p_WE(each) for each in q])
    off = p - p[0] - np.array([_path(t)[0] for t in time])
    return float(np.linalg.norm(off, axis=1).max())


def speed_share(run: Run, network: str, noise: float, duration: float) -> float:
    """Largest joint velocity, per its bound [1]."""
    return float(np.abs(_course(network, noise, duration, 1e-3)[2]).max() / _FASTEST)


def residual_at_end(run: Run, start: float, duration: float) -> float:
    """Norm of E at the end with the noise, from multipliers of this size and random signs [1]."""
    return _course("noise_suppressing", 5.0, duration, start)[3]


def _path(t: float) -> tuple[Array, Array, Array]:
    """Return place, velocity and acceleration along the path of the code [m]."""
    two, four = np.array([2.0, 2.0, 0.0]) * t, np.array([4.0, 4.0, 0.0]) * t / 3.0
    turn = np.array([0.5 * np.pi, 0.0, 0.0])
    small, wide = np.array([0.04, 0.04, 0.0]), np.array([0.1, -0.06, 0.0])
    p = small * np.sin(two + turn) + wide * np.sin(four + turn) - np.array([0.14, 0.0, 0.0])
    v = 2.0 * small * np.cos(two + turn) + 4.0 / 3.0 * wide * np.cos(four + turn)
    a = -4.0 * small * np.sin(two + turn) - 16.0 / 9.0 * wide * np.sin(four + turn)
    return _SIZE * p, _SIZE * v, _SIZE * a


def _clip(x: Array) -> Array:
    return np.clip(x, -1.0, 1.0)


def _residual(kinematics: Any, t: float, q: Array, U: Array) -> Array:
    v, multipliers, mu = U[:_N], U[_N : _N + 3], U[_N + 3 :]
    J, gap = kinematics.J(q), _BOUND - _C @ v
    root = np.sqrt(gap * gap + mu * mu + _EPS)
    stationary = v + J.T @ multipliers + _C.T @ mu
    return np.concatenate((stationary, J @ v - _path(t)[1], gap + mu - root))


def _network(t: float, y: Array, noise: float, kinematics: Any) -> Array:
    q, U, integral = y[:_N], y[_N : _N + 21], y[_N + 21 :]
    v, multipliers, mu = U[:_N], U[_N : _N + 3], U[_N + 3 :]
    J = kinematics.J(q).copy()
    J_dot = (kinematics.J(q + _SHORT * v) - J) / _SHORT
    E, gap = _residual(kinematics, t, q, U), _BOUND - _C @ v
    root = np.sqrt(gap * gap + mu * mu + _EPS)
    share, share_mu = gap / root, mu / root
    M = np.block(
        [
            [np.eye(_N), J.T, _C.T],
            [J, np.zeros((3, 15))],
            [(share - 1.0)[:, None] * _C, np.zeros((12, 3)), np.diag(1.0 - share_mu)],
        ]
    )
    moving = np.concatenate((J_dot.T @ multipliers, J_dot @ v - _path(t)[2], np.zeros(12)))
    push = _GAIN * (_clip(E) + _clip(E + _GAIN * _clip(integral)))
    return np.concatenate((v, np.linalg.solve(M, noise - moving - push), E))


def _dual(t: float, y: Array, noise: float, kinematics: Any) -> Array:
    q, u = y[:_N], y[_N:]
    R, v_desired = np.vstack((kinematics.J(q), np.eye(_N))), _path(t)[1]
    image = R @ (R.T @ u)
    lower = np.concatenate((v_desired, -_BOUND[:_N]))
    upper = np.concatenate((v_desired, _BOUND[:_N]))
    return np.concatenate((R.T @ u, _GAIN * (np.clip(image - u, lower, upper) - image + noise)))


@cache
def _course(
    network: str, noise: float, duration: float, start: float
) -> tuple[Any, Any, Any, float]:
    """Return times, joint positions and velocities, and the norm of E at the end."""
    kinematics: Any = load_arm("ur5").kinematics()
    signs = np.random.default_rng(1).choice([-1.0, 1.0], 15) if start > 1e-3 else np.ones(15)
    rate, y = _network, np.concatenate((_START, np.zeros(_N), start * signs, np.zeros(21)))
    if network == "dual":
        rate, y = _dual, np.concatenate((_START, np.zeros(9)))
    time, values = np.arange(round(duration / _STEP) + 1) * _STEP, [y]
    # Runge and Kutta's method; the eigenvalues are some -1e3 to -2.5e3 per second.
    for t in time[:-1].tolist():
        a = rate(t, y, noise, kinematics)
        b = rate(t + 0.5 * _STEP, y + 0.5 * _STEP * a, noise, kinematics)
        c = rate(t + 0.5 * _STEP, y + 0.5 * _STEP * b, noise, kinematics)
        y = y + _STEP / 6.0 * (
            a + 2.0 * b + 2.0 * c + rate(t + _STEP, y + _STEP * c, noise, kinematics)
        )
        values.append(y)
    every = np.array(values)
    q = every[:, :_N]
    if network == "dual":
        pairs = zip(q, every[:, _N:], strict=True)
        v = np.array([kinematics.J(each).T @ u[:3] + u[3:] for each, u in pairs])
        return time, q, v, float("nan")
    E = _residual(kinematics, duration, q[-1], y[_N : _N + 21])
    return time, q, every[:, _N : 2 * _N], float(np.linalg.norm(E))
