"""Measures of the claims of a zeroing planner for an arm on a floating base.

The authors' planner, recomputed from their equations: with J of the pose of the sample,

    F = [[I, J^T, C^T], [J, 0, 0], [-C, 0, I]],  s = (-phi, b, sqrt(x^2 + zeta^2 + nu) - d),

x = d - C v and C = (I, -I), the state q = (v, xi, zeta) follows F q = s by Euler's method, with
F' and s' by differences. The base slides along one axis, of which the planner knows where it is,
but not its velocity. The arm is a ViperX 300, whose lengths are read from the authors' model.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ..claims import Run

# Joints: axis and where it is in the link before [m]; the tip in the last link [m].
_AXES = ("z", "y", "y", "x", "y", "x")
_PLACES = np.array(
    [
        [0.0, 0.0, 0.079],
        [0.0, 0.0, 0.04805],
        [0.05955, 0.0, 0.3],
        [0.2, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.069744, 0.0, 0.0],
    ]
)
_TIP = np.array([0.13, 0.0, -0.003])
# Where the base is [m], turned by pi about z, and the axis along which it slides, in its own frame.
_BASE, _SLIDE = np.array([0.0, 0.0, 0.35]), np.ones(3) / np.sqrt(3.0)
# Posture at first and the one to come back to [rad], limits [rad] and bound [rad/s].
_START = np.array(
    [-4.81809265e-06, -0.340180323, 0.640422295, -3.66864295e-07, 1.47054028, -8.49525403e-06]
)
_HOME = np.array(
    [1.88869226e-08, -1.17356586, 1.07977379, -3.27183860e-08, 0.762041335, -3.02992341e-08]
)
_LIMITS, _FASTEST = np.array([2.8973, 1.8, 1.6057, 3.0718, 2.23402, 3.1]), 0.6
# Period [s], samples, feedback [1/s], gain of the network, of the way back [1/s], and nu.
_STEP, _COUNT, _FEEDBACK, _GAIN, _RETURN, _SMOOTH = 1e-3, 10000, 50.0, 0.7, 0.6, 1e-6
_RADIUS = 0.1


def error(run: Run, axis: int) -> float:
    """Largest component of the position error along an axis, from 1 s on [m]."""
    return float(np.abs(_plan("adaptive").error[1000:, axis]).max())


def rms_error(run: Run, kind: str) -> float:
    """Root mean square of the norm of the position error from 1 s on [m].

    Args:
        run: Not needed.
        kind: Activation: ``linear``, ``power_sum``, ``two_powers``, ``sign_bi_power``,
            ``predefined`` or ``adaptive``.
    """
    course = _plan(kind).error[1000:]
    return float(np.sqrt((course**2).sum(axis=1).mean()))


def fastest(run: Run, start: float = 0.0) -> float:
    """Largest joint velocity from a time on [rad/s]."""
    return float(np.abs(_plan("adaptive").velocity[round(start / _STEP) :]).max())


def limit_share(run: Run) -> float:
    """Largest joint position, per its limit [1]."""
    return float((np.abs(_plan("adaptive").position) / _LIMITS).max())


def displacement(run: Run, joint: int) -> float:
    """Way of a joint from the start to the end of the lap [rad], of joints 1 to 6."""
    q = _plan("adaptive").position
    return float(q[-1, joint - 1] - q[0, joint - 1])


class _Course(NamedTuple):
    """Errors, shape (k, 3), joint positions and velocities, shape (k + 1, 6)."""

    error: Array
    position: Array
    velocity: Array


class _Adaptive:
    """The sign-bi-power activation with a factor for each entry, which the planner uses."""

    def __init__(self) -> None:
        self._factors = np.full(24, 0.5)

    def __call__(self, e: Array) -> Array:
        size, turn = np.abs(e), 0.8
        change = np.where(size <= turn, turn * size, (turn - 1.0) * size) * _STEP
        self._factors = np.where(size < 1e-6, 0.0, np.maximum(self._factors + change, 0.0))
        return self._factors * (size**turn + size ** (1.0 / turn)) * np.sign(e)


def _predefined(e: Array) -> Array:
    size, near, far = np.abs(e), np.sqrt(0.5) * 2.0 / 3.0, 0.5**1.5 * np.sqrt(3.0) * 2.0 / 3.0
    return (6.0 * size + near * np.sqrt(size) + far * size**1.5) * np.sign(e)


def _powers(*exponents: float, factor: float = 1.0) -> Callable[[Array], Array]:
    def phi(e: Array) -> Array:
        return factor * sum(np.abs(e) ** each for each in exponents) * np.sign(e)

    return phi


def _activation(kind: str) -> Callable[[Array], Array]:
    """Return one of the six activations of the authors' code."""
    if kind == "adaptive":
        return _Adaptive()
    return {
        "linear": _powers(1.0),
        "power_sum": _powers(1.0, 0.8),
        "two_powers": _powers(1.0, 2.0 / 3.0, 1.5),
        "sign_bi_power": _powers(0.65, 1.0 / 0.65, factor=0.5),
        "predefined": _predefined,
    }[kind]


@cache
def _plan(kind: str) -> _Course:
    """Return the course of the planner on its circle."""
    n, m, phi = 6, 6, _activation(kind)
    C = np.vstack((np.eye(n), -np.eye(n)))
    q, v, network = _START.copy(), np.zeros(n), np.zeros(3 * n + m)
    F, s = np.zeros((3 * n + m, 3 * n + m)), np.zeros(3 * n + m)
    F[:n, :n], F[:n, n + m :] = np.eye(n), C.T
    F[n + m :, :n], F[n + m :, n + m :] = -C, np.eye(2 * n)
    F_last = np.zeros_like(F)
    path = _circle()
    errors = np.zeros((_COUNT - 1, 3))
    positions, velocities = np.zeros((_COUNT, n)), np.zeros((_COUNT, n))
    positions[0], slide = q, 0.0
    for k in range(_COUNT - 1):
        # The pose of the sample has the base where it was a sample before.
        p, J = _tip(q, slide)
        slide = _sliding(k * _STEP)
        b = np.append((path[k + 1] - path[k]) / _STEP + _FEEDBACK * (path[k] - p), np.zeros(3))
        upper, lower = _box(q)
        d = np.append(upper, -lower)
        F[:n, n : n + m], F[n : n + m, :n] = J.T, J
        zeta = network[n + m :]
        length = np.sqrt((d - C @ v) ** 2 + zeta**2 + _SMOOTH)
        s_last, s = s, np.concatenate((-_RETURN * (q - _HOME), b, length - d))
        F_dot, s_dot = (F - F_last) / _STEP, (s - s_last) / _STEP
        told = s_dot - F_dot @ network - _GAIN * phi(F @ network - s)
        network = network + _STEP * np.linalg.solve(F, told)
        F_last, v = F.copy(), network[:n]
        q = q + _STEP * v
        positions[k + 1], velocities[k + 1] = q, v
        errors[k] = _tip(q, slide)[0] - path[k]
    return _Course(errors, positions, velocities)


def _circle() -> Array:
    """Return the path's points, shape (k, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _COUNT)
    x, y = -0.3 + _RADIUS * np.cos(angle), _RADIUS * np.sin(angle)
    return np.column_stack((x, y, np.full(_COUNT, 0.5)))


def _sliding(t: float) -> float:
    """Return how far the base has slid [m]."""
    return float(0.05 * np.sin(2.0 * t) + 0.02 * np.cos(6.0 * t) + 0.01 * np.exp(-3.0 * t))


def _box(q: Array) -> tuple[Array, Array]:
    """Return the bounds of the velocities, which vanish towards the limits."""
    near, below = 0.9 * _LIMITS, -0.8 * _LIMITS

    def remainder(start: Array, end: Array) -> Array:
        share = np.sin(0.5 * np.pi * (q - start) / (end - start))
        return np.asarray(1.0 - np.sin(0.5 * np.pi * share) ** 4)

    upper = np.where(q <= near, 1.0, np.where(q <= _LIMITS, remainder(near, _LIMITS), 0.0))
    lower = np.where(q >= below, 1.0, np.where(q >= -_LIMITS, remainder(below, -_LIMITS), 0.0))
    return _FASTEST * upper, -_FASTEST * lower


def _tip(q: Array, slide: float) -> tuple[Array, Array]:
    """Return the tip's position, and the Jacobian of position and rotation, shape (6, 6)."""
    R = np.diag([-1.0, -1.0, 1.0])
    p = _BASE + R @ (slide * _SLIDE)
    axes, origins = [], []
    for name, place, angle in zip(_AXES, _PLACES, q, strict=True):
        p = p + R @ place
        k = "xyz".index(name)
        axes.append(R[:, k])
        origins.append(p)
        c, s, i, j = np.cos(angle), np.sin(angle), (k + 1) % 3, (k + 2) % 3
        turn = np.eye(3)
        turn[i, i], turn[j, j], turn[j, i], turn[i, j] = c, c, s, -s
        R = R @ turn
    p = p + R @ _TIP
    stack = np.array(axes)
    return p, np.vstack((np.cross(stack, p - np.array(origins)).T, stack.T))
