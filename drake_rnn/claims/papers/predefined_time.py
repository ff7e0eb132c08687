"""Measures of the claims of predefined-time-synchronized control of mobile manipulators.

- The time in which the design formula makes an error vanish, in continuous time.
- The authors' simulation, recomputed from their equations: a JACO2 of three joints on a holonomic
  base, whose joint velocities are J_hat^+ (p_d' + lambda phi(e)). After each sample J_hat is moved
  towards the reading by N steps of a gradient, whose sum is known in closed form.

In their loop a command acts one sample after the one for which it is computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ..claims import Run, end_of_chain

# A JACO2 on a base: twists [rad], lengths and offsets [m] of four links, by Denavit and
# Hartenberg, the first of which turns with the base; the posture at first.
_BEND = np.pi / 6.0
_HAND = 0.2073 + np.sin(_BEND) / np.sin(2.0 * _BEND) * 0.0741
_LINKS = (
    (np.pi / 2, np.pi, np.pi / 2, 2.0 * _BEND),
    (0.0, 0.41, 0.0, 0.0),
    (0.2755, 0.0, -0.0098, -_HAND),
)
_START = np.array([0.0, 0.0, 0.0, 3.041, 3.045, -2.498])
# Size of the path [m], time of the lap [s], gain of the gradient [1/rad^2] and first error [m].
_SIZE, _LAP, _LEARNING = 0.2, 60.0, 1e4
_FIRST = (-0.1, 0.15, 0.05)
# Weight of the third term of the activation, and the norm below which all of it counts as zero.
_THIRD, _NOTHING = 1e-5, 1e-10


def time_over_predefined(run: Run, rho: float, kind: str = "ts_ptc", first: float = 0.0) -> float:
    """Time in which the error vanishes in continuous time, per the predefined one [1].

    Args:
        run: Not needed.
        rho: The number rho.
        kind: ``ts_ptc``, whose gain follows from the error at first, or ``ptc``.
        first: The error at first [m]; 0 for the one of the authors' code, or its largest entry.
    """
    largest = np.abs(_FIRST).max() if kind == "ptc" else np.linalg.norm(_FIRST)
    return _vanishing(kind, rho, first or float(largest), float(np.linalg.norm(_FIRST)))


def rate_aside(run: Run, rho: float = 0.6) -> float:
    """Largest share of the activation that is not along the error, of 1000 random errors [1].

    Their norms are between 1e-6 and 1000 m. Without it all components vanish at one time.
    """
    rng = np.random.default_rng(0)
    worst = 0.0
    for size in np.logspace(-6.0, 3.0, 1000):
        e = rng.normal(size=3)
        e *= size / np.linalg.norm(e)
        phi = _together(e, rho)
        worst = max(worst, float(np.linalg.norm(np.cross(phi, e / size)) / np.linalg.norm(phi)))
    return worst


def rms_error(
    run: Run,
    t_p: float = 10.0,
    rho: float = 0.6,
    step: float = 0.01,
    iterations: int = 1000,
    first: Sequence[float] = _FIRST,
    start: str = "exact",
    delayed: bool = True,
) -> float:
    """Root mean square of the norm of the error from the predefined time on [m].

    Args:
        run: Not needed.
        t_p: The predefined time [s].
        rho: The number rho.
        step: The period [s].
        iterations: Number N of the gradient's steps in a sample.
        first: The error at first [m].
        start: J_hat at first: ``exact``, J itself; ``longer``, that of an arm whose links are a
            tenth longer; ``uniform`` in [0, 1].
        delayed: Whether a command acts a sample later, as in the authors' loop.
    """
    course = _simulate(t_p, rho, step, iterations, tuple(first), start, delayed)
    errors = course.error[round(t_p / step) :]
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def largest_error(run: Run, t_p: float, start: str = "exact") -> float:
    """Largest norm of the error from the predefined time on [m]."""
    course = _simulate(t_p, 0.6, 0.01, 1000, _FIRST, start, True)
    return float(np.linalg.norm(course.error[round(t_p / 0.01) :], axis=1).max())


def error_y(run: Run, rho: float) -> float:
    """Error along y at half of a predefined time of 10 s [m]."""
    return float(_simulate(10.0, rho, 0.01, 1000, _FIRST, "exact", True).error[500, 1])


def thousandths_apart(run: Run, t_p: float, first: Sequence[float] = _FIRST) -> float:
    """Longest less shortest time until a component is a thousandth of what it began with [s]."""
    error = np.abs(_simulate(t_p, 0.6, 0.01, 1000, tuple(first), "exact", True).error)
    return float(np.ptp((error <= 1e-3 * error[0]).argmax(axis=0)) * 0.01)


def direction_turned(run: Run, t_p: float, iterations: int = 1000) -> float:
    """Angle by which the error's direction has turned at half the predefined time [rad]."""
    error = _simulate(t_p, 0.6, 0.01, iterations, _FIRST, "exact", True).error
    first, half = error[0], error[round(0.5 * t_p / 0.01)]
    return float(np.arccos(first @ half / (np.linalg.norm(first) * np.linalg.norm(half))))


def reading_left(run: Run, t_p: float, iterations: int) -> float:
    """Largest norm of what J_hat leaves of a reading, Delta p - J_hat Delta q [m]."""
    return float(_simulate(t_p, 0.6, 0.01, iterations, _FIRST, "exact", True).left.max())


def displacement(run: Run, joint: int) -> float:
    """Way of a joint from the start to the end of the lap, for a predefined time of 10 s [m, rad].

    Args:
        run: Not needed.
        joint: 0 and 1 for x and y of the base, 2 for its turning, 3 to 5 for the arm.
    """
    q = _simulate(10.0, 0.6, 0.01, 1000, _FIRST, "exact", True).position
    return float(q[-1, joint] - q[0, joint])


class _Course(NamedTuple):
    """Errors, shape (k, 3), joint positions, (k, 6), and what is left of readings, (k,)."""

    error: Array
    position: Array
    left: Array


@cache
@np.errstate(over="ignore")  # steps of the gradient may grow: the arm stands still then
def _simulate(
    t_p: float,
    rho: float,
    step: float,
    iterations: int,
    first: tuple[float, ...],
    start: str,
    delayed: bool,
) -> _Course:
    """Return the course of a lap."""
    size = float(np.linalg.norm(first))
    gain = float(np.arctan(size**rho)) / (rho * t_p)
    q, count = _START.copy(), round(_LAP / step) + 1
    p, J = _tip(q)
    J_hat = _first_estimate(start, J)
    centre, p_last, q_last = p + first, p, q
    waiting = np.zeros(q.size)
    errors, positions, left = np.zeros((count, 3)), np.zeros((count, q.size)), np.zeros(count)
    for k in range(count):
        p = _tip(q)[0]
        went, moved = p - p_last, q - q_last
        J_hat = J_hat + np.outer(went - J_hat @ moved, _learning(moved, iterations))
        wanted, onward = _path(k * step)
        errors[k], positions[k] = centre + wanted - p, q
        left[k] = np.linalg.norm(went - J_hat @ moved)
        v = np.linalg.pinv(J_hat) @ (onward + gain * _together(errors[k], rho))
        p_last, q_last = p, q
        q = q + step * (waiting if delayed else v)
        waiting = v
    return _Course(errors, positions, left)


def _tip(q: Array) -> tuple[Array, Array]:
    """Return the tip's position and its Jacobian, of base and arm."""
    p, J = end_of_chain(q[2:], *_LINKS)
    return p + np.append(q[:2], 0.0), np.hstack((np.eye(3)[:, :2], J))


def _first_estimate(start: str, J: Array) -> Array:
    if start == "uniform":
        return np.random.default_rng(0).uniform(size=J.shape)
    # What a base adds is independent of lengths.
    return J if start == "exact" else J * np.array([1.0, 1.0, 1.1, 1.1, 1.1, 1.1])


def _learning(moved: Array, iterations: int) -> Array:
    """Return the sum of the gradient's steps along a motion, shape (6,).

    Each leaves 1 - gamma |Delta q|^2 of the residual; all of them are a share of Broyden's step.
    """
    square = moved @ moved
    if square == 0.0:
        return moved
    return moved * (1.0 - (1.0 - _LEARNING * square) ** iterations) / square


def _path(t: float) -> tuple[Array, Array]:
    """Return how far the path has gone, and its velocity."""
    phase = 2.0 * np.pi * np.sin(0.5 * np.pi * t / _LAP) ** 2
    rate = np.pi**2 / _LAP * np.sin(np.pi * t / _LAP)
    c, s = np.cos(phase), np.sin(phase)
    return _SIZE * np.array([c - 1.0, s, 0.5 * s]), _SIZE * rate * np.array([-s, c, 0.5 * c])


def _together(e: Array, rho: float) -> Array:
    """Return the activation whose entries vanish at one time."""
    norm = float(np.linalg.norm(e))
    if norm < _NOTHING:
        return 0.0 * e
    return e * (norm**-rho + norm**rho + _THIRD / norm)


def _vanishing(kind: str, rho: float, first: float, of: float) -> float:
    """Return when an error is zero, per the predefined time.

    Args:
        kind: ``ts_ptc`` or ``ptc``.
        rho: The number rho.
        first: The error at first, a norm or an entry [m].
        of: The norm that the gain of ``ts_ptc`` follows from [m].
    """
    # With the power rho, or half of it, in place of the error the integrand is finite at 0.
    power = rho if kind == "ts_ptc" else 0.5 * rho
    gain = np.arctan(of**rho) / rho if kind == "ts_ptc" else np.pi / rho
    third = _THIRD if kind == "ts_ptc" else 0.0
    angle = np.linspace(0.0, np.arctan(first**power), 200001)
    s = np.tan(angle)
    share = (1.0 + s * s) * s ** (1.0 / power - 1.0)
    parts = share / (share + third) if third else np.ones_like(share)
    return float(np.trapezoid(parts, angle) / (power * gain))
