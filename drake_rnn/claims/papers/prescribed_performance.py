"""Measures of the prescribed-performance network's claims: its algorithm as its code has it.

The network's variables are the joint velocities and three multipliers. Velocities are within their
bounds by the logits chi_1, residuals within the funnel by chi_2, and what should vanish is

h = [d(chi_1^2/2)/dv + (dg/dv)^T lambda; g],   g = chi_2^2/2,   dy/dt = -(dh/dy)^+ (gamma h + dh/dt)

in steps of 1 ms by the four-step formula, the joints' positions too.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...experiment import load_experiment
from ...inputs.fields import Array
from ...laws.zeroing import Funnel
from ...laws.zeroing_design import FORMULAS
from ..claims import Run

_NAME = "zeroing_prescribed"
# Period of the code [s], and the least time along J that its rate is a difference over [s].
_PERIOD, _SHORT = 1e-3, 1e-6
_GAIN = 100.0


class _Course(NamedTuple):
    """What a run of the printed network does, up to its end or to where a logit is none."""

    velocity_share: float
    funnel_share: float
    q: Array
    v: Array


def velocity_share(run: Run, feedback: float, duration: float) -> float:
    """Largest joint velocity of the printed network, per its bound [1]."""
    return _course(feedback, duration).velocity_share


def funnel_share(run: Run, feedback: float, duration: float) -> float:
    """Largest residual of the printed network, per the funnel's half width [1]."""
    return _course(feedback, duration).funnel_share


def travel(run: Run, joint: int, duration: float) -> float:
    """Largest way of a joint from its start, counted from 1, of the printed network [rad]."""
    q = _course(2.0, duration).q[:, joint - 1]
    return float(np.abs(q - q[0]).max())


def apart_from_optimum(run: Run, duration: float) -> float:
    """Largest distance of the printed velocities at the end from the program's optimum [rad/s].

    The optimum of the barriers with J v = b, by Newton's method in the posture of that time.
    """
    experiment, course = load_experiment(_NAME), _course(2.0, duration)
    kinematics, q = experiment.arm.kinematics(), course.q[-1]
    J, fastest = kinematics.J(q), experiment.limits.require("velocity", "a barrier")
    p, v, _ = experiment.desired.position(duration)
    b = v + 2.0 * (p - kinematics.p_WE(q))
    y = np.append(course.v[-1], np.zeros(3))
    for _ in range(50):
        _, slope, curvature = _logits(y[:7], -fastest, fastest)
        short = np.append(slope + J.T @ y[7:], J @ y[:7] - b)
        y = y - np.linalg.solve(np.block([[np.diag(curvature), J.T], [J, np.zeros((3, 3))]]), short)
    return float(np.abs(y[:7] - course.v[-1]).max())


def _logits(x: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
    """Return logits of values within bounds, and half their squares' two derivatives."""
    width = upper - lower
    share = (x - lower) / width
    inner = share * (1.0 - share)
    chi = np.log(share / (1.0 - share))
    curvature = (1.0 + (2.0 * share - 1.0) * chi) / (width * inner) ** 2
    return chi, chi / (width * inner), curvature


@cache
def _course(feedback: float, duration: float) -> _Course:
    experiment = load_experiment(_NAME)
    law: Any = experiment.law
    kinematics, funnel = experiment.arm.kinematics(), law.prescribed
    fastest = experiment.limits.require("velocity", "a barrier")
    formula = FORMULAS["four_step"]
    q, y = experiment.start, np.append(np.zeros(7), np.ones(3))
    before = np.zeros((2, 17))
    places, speeds, shares = [q], [y[:7]], []
    for k in range(round(duration / _PERIOD)):
        t, v = k * _PERIOD, y[:7]
        J = kinematics.J(q)
        J_dot = (kinematics.J(q + _SHORT * v) - J) / _SHORT
        p, p_dot, p_ddot = experiment.desired.position(t)
        residual = J @ v - p_dot + feedback * (kinematics.p_WE(q) - p)
        moving = J_dot @ v - p_ddot + feedback * (J @ v - p_dot)
        half = funnel.width(t)[0]
        shares.append((np.abs(v / fastest).max(), np.abs(residual).max() / half))
        if max(shares[-1]) >= 1.0:
            break
        rate = _rate(y, J, J_dot, residual, moving, fastest, funnel, t)
        state, rates = np.append(y, q), np.append(rate, v)
        count = np.array([float(k >= 3) * 2.0])
        after = formula.after(state, before, rates, count, _PERIOD)
        before = np.array([state, before[0]])
        y, q = after[:10], after[10:]
        places.append(q)
        speeds.append(y[:7])
    largest = np.array(shares).max(axis=0)
    return _Course(float(largest[0]), float(largest[1]), np.array(places), np.array(speeds))


def _rate(
    y: Array,
    J: Array,
    J_dot: Array,
    residual: Array,
    moving: Array,
    fastest: Array,
    funnel: Funnel,
    t: float,
) -> Array:
    """Return dy/dt of the printed network."""
    v, multipliers = y[:7], y[7:]
    half, narrowing = funnel.width(t)
    _, pull, own = _logits(v, -fastest, fastest)
    ends = np.full(3, half)
    chi, slope, curvature = _logits(residual, -ends, ends)
    # Of chi^2/2 by the residual and by the funnel's width; the logit is one of their ratio alone.
    by_width = -residual * slope / half
    slope_by_width = -(slope + residual * curvature) / half
    rows = slope[:, None] * J
    h = np.concatenate((pull + rows.T @ multipliers, 0.5 * chi * chi))
    changing = curvature * moving + slope_by_width * narrowing
    rows_dot = changing[:, None] * J + slope[:, None] * J_dot
    h_dot = np.concatenate((rows_dot.T @ multipliers, slope * moving + by_width * narrowing))
    M = np.block(
        [
            [np.diag(own) + J.T @ ((multipliers * curvature)[:, None] * J), rows.T],
            [rows, np.zeros((3, 3))],
        ]
    )
    return np.asarray(-np.linalg.pinv(M) @ (_GAIN * h + h_dot))
