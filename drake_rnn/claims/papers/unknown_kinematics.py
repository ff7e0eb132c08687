"""Measures of the claims on unknown kinematics: network and observer as their code has them.

The network's variables are logits xi of the joint velocities, v = lower + (upper - lower) g(xi),
where the bounds of a joint shrink near its end. An observer moves J_hat along the last velocity
alone. Errors are led through the inverse of a logit, so that they stay in funnels p(t)::

    e = J_hat v - v_desired + k (p - p_desired) + k_i integral,   f(e) = p (1 - (e/p)^2) / 2 log(..)
    (J_hat (upper - lower) g') dxi/dt = ... - gamma f(e)
    dJ_hat/dt = (a - J_hat dv/dt + (e_o/p) dp/dt - gamma_o f(e_o)) v^+,   e_o = J_hat v - J v

in steps of 1 ms by the four-step formula. J_hat starts as J, rounded to 0.1 m.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...experiment import load_experiment
from ...inputs.fields import Array
from ..claims import Run

# The arm and the start are those of another network of the same authors.
_NAME = "zeroing_prescribed"
_PERIOD, _SHORT = 1e-3, 1e-6
_TILT, _DURATION, _SETTLED = 0.25 * np.pi, 10.0, 5.0


class _Case(NamedTuple):
    """A case of the code: size of the path, gains, funnels, bounds, and how far it starts off."""

    size: float
    gain: float
    funnel: tuple[float, float]
    observer: tuple[float, float, float]
    feedback: tuple[float, float]
    approach: float
    fastest: float
    farthest: float
    away: tuple[float, float, float] = (0.0, 0.0, 0.0)


_CASES = {
    "base": _Case(0.0295, 100.0, (0.2, 1e-3), (0.4, 1e-3, 100.0), (5.0, 300.0), 3.0, 0.2, 1.5),
    "offset": _Case(
        *(0.0295, 1.0, (0.1, 1e-3), (0.04, 8e-4, 100.0), (2.0, 0.0), 3.0, 0.23, 1.5),
        away=(0.04, -0.036, -0.032),
    ),
    "pos_limit": _Case(0.024, 100.0, (0.4, 1e-3), (0.4, 1e-3, 10.0), (5.0, 300.0), 1.0, 0.2, 1.3),
}


class _Course(NamedTuple):
    """What a run does, up to its end or to where a funnel is left."""

    until: float
    velocity_share: float
    position_share: float
    funnel_share: float
    observer_share: float
    error_at_end: float
    J_error: float
    J_error_at_start: float


def lasts(run: Run, case: str) -> float:
    """Time until a funnel is left, where no logarithm is, at most 10 [s]."""
    return _course(case).until


def velocity_share(run: Run, case: str) -> float:
    """Largest joint velocity, per its bound [1]."""
    return _course(case).velocity_share


def position_share(run: Run, case: str) -> float:
    """Largest joint position, per its bound [1]."""
    return _course(case).position_share


def funnel_share(run: Run, case: str) -> float:
    """Largest residual of the controller, per its funnel's half width [1]."""
    return _course(case).funnel_share


def observer_share(run: Run, case: str) -> float:
    """Largest residual of the observer, per its funnel's half width [1]."""
    return _course(case).observer_share


def error(run: Run, case: str) -> float:
    """Largest distance from the path from 5 s on [m]."""
    return _course(case).error_at_end


def jacobian_left(run: Run, case: str) -> float:
    """Error of J_hat at the end, per that at the start, both of Frobenius [1]."""
    course = _course(case)
    return course.J_error / course.J_error_at_start


def _path(size: float, start: Array, t: float) -> tuple[Array, Array, Array]:
    """Return position, velocity and acceleration on the tilted cardioid."""
    w = 0.2 * np.pi
    values = []
    for order in range(3):
        turn = 0.5 * np.pi * order
        x = 2 * w**order * np.cos(w * t + turn) - (2 * w) ** order * np.cos(2 * w * t + turn)
        y = 2 * w**order * np.sin(w * t + turn) - (2 * w) ** order * np.sin(2 * w * t + turn)
        values.append(size * np.array([x, y * np.cos(_TILT), y * np.sin(_TILT)]))
    values[0] = values[0] + start - np.array([size, 0.0, 0.0])
    return values[0], values[1], values[2]


def _led_back(e: Array, half: float) -> Array:
    share = e / half
    back: Array = half * 0.5 * (1.0 - share**2) * np.log((1.0 + share) / (1.0 - share))
    return back


def _four_steps(past: list[Array], rate: Array) -> Array:
    """Return the next value; the first three steps are Euler's."""
    if len(past) <= 3:
        return past[-1] + _PERIOD * rate
    return (8.0 * _PERIOD * rate + 3.0 * past[-1] + past[-2] + past[-3]) / 5.0


def _bounds(case: _Case, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
    """Return the least and largest velocities, and their rates."""
    above, below = case.approach * (case.farthest - q), case.approach * (-case.farthest - q)
    near_upper, near_lower = case.fastest > above, -case.fastest < below
    return (
        np.where(near_lower, below, -case.fastest),
        np.where(near_upper, above, case.fastest),
        np.where(near_lower, -case.approach * v, 0.0),
        np.where(near_upper, -case.approach * v, 0.0),
    )


def _funnels(case: _Case, t: float) -> list[tuple[float, float]]:
    """Return half widths of both funnels, and their rates."""
    funnels = []
    for first, last, decay in ((*case.funnel, 100.0), case.observer):
        left = (first - last) * float(np.exp(-decay * t))
        funnels.append((left + last, -decay * left))
    return funnels


def _share(xi: Array) -> Array:
    """Return the share of the way between bounds, of a logit."""
    return np.asarray(np.exp(xi) / (1.0 + np.exp(xi)))


def _summary(shares: list[tuple[Any, ...]], errors: list[float], J_errors: list[float]) -> _Course:
    """Return what a run does, of its numbers in each step."""
    of_bounds, of_positions, of_funnel, of_observer = np.array(shares).max(axis=0).tolist()
    late = errors[round(_SETTLED / _PERIOD) :] or errors[-1:]
    return _Course(
        until=(len(shares) - 1) * _PERIOD,
        velocity_share=of_bounds,
        position_share=of_positions,
        funnel_share=of_funnel,
        observer_share=of_observer,
        error_at_end=max(late),
        J_error=J_errors[-1],
        J_error_at_start=J_errors[0],
    )


@cache
def _course(name: str) -> _Course:
    case, experiment = _CASES[name], load_experiment(_NAME)
    kinematics: Any = experiment.arm.kinematics()
    J, q, v = kinematics.J(experiment.start).copy(), [np.array(experiment.start)], np.zeros(7)
    lower, upper, _, _ = _bounds(case, q[0], v)
    xi = [np.log((upper - v) / (v - lower))]
    g = _share(xi[0])
    J_hat, J_hat_rate = [np.round(J, 1)], np.zeros((3, 7))
    start = kinematics.p_WE(q[0]) + np.array(case.away)
    integral, shares, errors, J_errors = np.zeros(3), [], [], []
    for k in range(round(_DURATION / _PERIOD) + 1):
        t, here, p = k * _PERIOD, q[-1], kinematics.p_WE(q[-1])
        J = kinematics.J(here).copy()
        J_dot = (kinematics.J(here + _SHORT * v) - J) / _SHORT
        p_desired, v_desired, a_desired = _path(case.size, start, t)
        lower, upper, lower_rate, upper_rate = _bounds(case, here, v)
        width = upper - lower
        (half, half_rate), (half_o, half_o_rate) = _funnels(case, t)
        gain, gain_i = case.feedback
        off = p - p_desired
        e = J_hat[-1] @ v - v_desired + gain * off + gain_i * integral
        e_o = J_hat[-1] @ v - J @ v
        integral = integral + _PERIOD * off
        of_bounds = np.abs(v).max() / case.fastest, np.abs(here).max() / case.farthest
        shares.append((*of_bounds, np.abs(e / half).max(), np.abs(e_o / half_o).max()))
        errors.append(float(np.linalg.norm(off)))
        J_errors.append(float(np.linalg.norm(J - J_hat[-1])))
        if max(shares[-1][2:]) >= 1.0:
            break
        a_share = width * g * (1.0 - g)
        wanted = (
            -J_hat[-1] @ (lower_rate + (upper_rate - lower_rate) * g)
            - J_hat_rate @ v
            + a_desired
            - gain * (J_hat[-1] @ v - v_desired)
            - gain_i * off
            + e / half * half_rate
            - case.gain * _led_back(e, half)
        )
        xi_rate = np.linalg.pinv(J_hat[-1] * a_share) @ wanted
        a = a_share * xi_rate
        push = (
            -J_hat[-1] @ a
            + J_dot @ v
            + J @ a
            + e_o / half_o * half_o_rate
            - 100.0 * _led_back(e_o, half_o)
        )
        J_hat_rate = push[:, None] * np.linalg.pinv(v[:, None])
        J_hat.append(_four_steps(J_hat, J_hat_rate))
        xi.append(_four_steps(xi, xi_rate))
        g = _share(xi[-1])
        before, v = v, lower + width * g
        # The first three steps take the new velocity, as in the code.
        q.append(_four_steps(q, v if len(q) <= 3 else before))
    return _summary(shares, errors, J_errors)
