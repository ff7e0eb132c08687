"""Measures of the varying-parameter network's claims: errors and times of its design formula.

- Under dE/dt = -g(t) phi(E) each entry of the error is alone, so that all follows from the
  integral of g, which is gamma t + t^(gamma + 1) / (gamma + 1), and from that of 1/phi.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ...inputs.fields import Array
from ...laws.zeroing_design import GrowingGain, activation
from ...signals import DESIRED_POSITION
from ..claims import Run, end_of_chain

# Times printed in Table I [s], by activation; of the power at gamma 1 it says that it cannot.
_GAMMAS = (1.0, 5.0, 10.0, 15.0)
_LINEAR_TIMES = (7.8040, 1.4690, 0.2094, 0.1341)
# Residual that they are the times of, of three entries.
_LEFT, _ENTRIES = 0.2, 3
# Period of the experiment that is sampled [s].
_PERIOD = 1e-3
# A Kinova JACO2: posture at the start [rad]; alpha [rad], a and d [m] of its links, by Denavit and
# Hartenberg; time of the lap [s]; gamma.
_JACO_START = np.array([1.675, 2.843, -3.216, 4.187, -1.71, -2.65])
_BEND = 11.0 * np.pi / 72.0
_WRIST = np.sin(_BEND) / np.sin(2.0 * _BEND) * 0.07433
_JACO_LINKS = (
    (np.pi / 2, np.pi, np.pi / 2, 2.0 * _BEND, 2.0 * _BEND, np.pi),
    (0.0, 0.41, 0.0, 0.0, 0.0, 0.0),
    (0.2755, 0.0, -0.0098, -0.2073 - _WRIST, -2.0 * _WRIST, -_WRIST - 0.1687),
)
_JACO_TIME, _JACO_GAIN = 8.0, 80.0
# Step in which network and problem (66) are integrated [s].
_STEP = 2e-3


def starts_apart(run: Run, gammas: Sequence[float] = _GAMMAS) -> float:
    """Largest ratio of the first errors that Table I's times of a linear activation imply [1].

    By (39) a residual of 0.2 after a time t began as 0.2 exp(gamma t + t^(gamma + 1)/(gamma + 1)).
    """
    times = dict(zip(_GAMMAS, _LINEAR_TIMES, strict=True))
    integrals = [_gain_integral(gamma, times[gamma]) for gamma in gammas]
    return float(np.exp(max(integrals) - min(integrals)))


def longest_time(run: Run, shape: str, gamma: float) -> float:
    """Longest time after which the residual of any first error is 0.2 [s]."""
    left = _LEFT / np.sqrt(_ENTRIES)
    return _time(gamma, _time_between(shape, left, 1e9))


def time_to_fixed(run: Run, shape: str, gamma: float = 1.0, first: float = 1.5) -> float:
    """Time to a residual of 0.2 of the varying network, per that of the fixed one [1]."""
    time = _time_between(shape, _LEFT, first)
    return _time(gamma, time) / (time / gamma)


def slower_with_gain(run: Run, shape: str, first: float = 1.5) -> float:
    """Largest ratio of the times to a residual of 0.2 of one gamma and of the next less one [1]."""
    time = _time_between(shape, _LEFT, first)
    times = [_time(gamma, time) for gamma in _GAMMAS]
    return float(max(np.divide(times[1:], times[:-1])))


def error_ratio(run: Run, shape: str, other: str, first: float, gamma: float = 1.0) -> float:
    """Largest error of one activation, per that of another at the same time [1].

    Over the time in which the other one's error falls to a millionth of its first value.
    """
    times = np.linspace(0.0, _time(gamma, np.log(1e6)), 400)
    one, two = (_course(each, gamma, first, times) for each in (shape, other))
    return float((one / two).max())


def error_ratio_above_one(run: Run, shape: str, first: float, gamma: float = 1.0) -> float:
    """Largest error per that of a linear activation, as long as the latter is 1 or more [1]."""
    times = np.linspace(0.0, _time(gamma, np.log(first)), 400)
    one, two = (_course(each, gamma, first, times) for each in (shape, "linear"))
    return float((one / two).max())


def error_ratio_to_fixed(run: Run, shape: str, gamma: float, first: float = 1.5) -> float:
    """Largest error of the varying network per that of the fixed one, over 3 s [1]."""
    times = np.linspace(0.0, 3.0, 400)
    varying = _course(shape, gamma, first, times)
    course_of_fixed = _course(shape, gamma, first, times, varies=False)
    return float(
        (varying[course_of_fixed > 1e-12] / course_of_fixed[course_of_fixed > 1e-12]).max()
    )


def formula_apart(run: Run, shape: str, gamma: float, sign: float = 1.0) -> float:
    """Largest distance of the printed solution from the error of network (23) on problem (66) [1].

    Of (39), (42) and (53), per entry and as a share of the first error, over 1.5 s from a random
    state. A logarithm of a negative number is taken as the complex number that it is.
    """
    Y = np.random.default_rng(0).uniform(-1.0, 1.0, 3)
    times, errors = _network(shape, gamma, Y, 1.5)
    first, integral = errors[0], np.array([_gain_integral(gamma, t) for t in times])[:, None]
    if shape == "linear":
        formula = first * np.exp(-integral)
    elif shape == "power":
        formula = np.sign(first) * (2.0 * integral + first**-2.0) ** -0.5
    else:
        C = (np.exp(first) + 1.0) / (np.exp(first) - 1.0)
        formula = np.log((sign * (C + np.exp(-integral)) / (C - np.exp(-integral))).astype(complex))
    return float(np.abs((formula - errors) / first).max())


def residual_left(
    run: Run, shape: str, gamma: float, duration: float, varies: bool = True
) -> float:
    """Norm of the residual of problem (66) that is left of one of order 1, in continuous time.

    The state at the start is random; the larger of two.
    """
    rng = np.random.default_rng(1)
    starts = [rng.normal(size=3) for _ in range(2)]
    return float(
        max(
            np.linalg.norm(_network(shape, gamma, start, duration, varies=varies)[1][-1])
            for start in starts
        )
    )


def higher_dimension_ratio(run: Run, size: int, gamma: float = 1.0) -> float:
    """Largest residual of the varying network per that of the fixed one, on (70), (71) [1]."""
    Y = np.random.default_rng(2).uniform(-1.0, 1.0, size)
    varying, constant_gain = (
        np.linalg.norm(_network("linear", gamma, Y, 3.0, _toeplitz, varies)[1], axis=1)
        for varies in (True, False)
    )
    return float((varying / constant_gain)[1:].max())


def time_over_bound(
    run: Run, gamma: float, first: float, exponent: float, bound: str = "varying"
) -> float:
    """Time in which the tunable activation makes an error vanish, per the bound for it [1].

    Args:
        run: Not needed.
        gamma: The number gamma.
        first: The error at first.
        exponent: The number r, between 0 and 1.
        bound: ``varying`` for (63), ``fixed`` for (64) and the network with a fixed gain.
    """
    # With e = s^2 the integrand is finite at 0.
    roots = np.linspace(1e-9, np.sqrt(first), 100001)
    time = float(np.trapezoid(2.0 * roots / _tunable(exponent)(roots * roots), roots))
    share = first ** (1.0 - exponent) / (1.0 - exponent)
    if bound == "fixed":
        return float(time / share)
    return _time(gamma, time) / _time(gamma, 2.0 * share / 3.0)


def noise_left(run: Run, gamma: float, at: float) -> float:
    """Error that a constant noise leaves of the varying network, per the fixed one's [1]."""
    return float(gamma / GrowingGain(gamma, "power_of_gain", 1.0).at(at))


def error_left(run: Run, gamma: float, at: float) -> float:
    """Error of the varying network per that of the fixed one at a time, linear activation [1]."""
    return float(np.exp(gamma * at - _gain_integral(gamma, at)))


def butterfly_error(run: Run, side: str, spread: float = 0.0) -> float:
    """Largest or smallest component of a JACO2's error on a butterfly, in continuous time [m].

    Lengths, start, path, time, gain and feedback are those of the authors' code. Each entry of the
    network's own error is known in closed form, (39), and its velocity follows from it.

    Args:
        run: Not needed.
        side: ``largest`` or ``smallest``.
        spread: Largest size of the velocities that the network begins with, at random [rad/s].
    """
    q, h = _JACO_START, 2e-2
    corner = _tip(q)[0] - _butterfly(0.0)[0]
    J, n = _tip(q)[1], q.size
    start_state = np.append(np.random.default_rng(0).uniform(-spread, spread, n), np.zeros(3))
    first = np.append(start_state[:n], J @ start_state[:n])

    def velocity(t: float, q: Array) -> Array:
        (p, J), (wanted, rate) = _tip(q), _butterfly(t)
        left = first * np.exp(-_gain_integral(_JACO_GAIN, t)) if t < 1.0 else 0.0 * first
        told = np.append(_JACO_START - q, rate + corner + wanted - p) + left
        KKT = np.block([[np.eye(n), J.T], [J, np.zeros((3, 3))]])
        return np.asarray(np.linalg.solve(KKT, told))[:n]

    errors = []
    for t in np.arange(0.0, _JACO_TIME, h):
        errors.append(_tip(q)[0] - corner - _butterfly(t)[0])
        q = _runge_kutta(velocity, t, q, h)
    return float(np.max(errors) if side == "largest" else np.min(errors))


def _butterfly(t: float) -> tuple[Array, Array]:
    """Return position and velocity on the butterfly of the authors' code."""

    def at(t: float) -> Array:
        phase = 2.0 * np.pi * np.sin(0.5 * np.pi * t / _JACO_TIME) ** 2
        radius = np.exp(np.cos(phase)) - 2.0 * np.cos(4.0 * phase) - np.sin(phase / 12.0) ** 5
        return 0.05 * radius * np.array([np.sin(phase), np.cos(phase), 0.0])

    d = 1e-5
    return at(t), (at(t + d) - at(t - d)) / (2.0 * d)


def _tip(q: Array) -> tuple[Array, Array]:
    """Return the position of a JACO2's finger tip, and its Jacobian."""
    return end_of_chain(q, *_JACO_LINKS)


def broken_over_stable(run: Run, name: str, gain: float, duration: float) -> float:
    """When a run by Euler's method is 1 mm off its path, per the time that it is stable [1].

    It is stable while gamma + t^gamma is less than 2 over the period; infinite if it is never off.

    Args:
        run: Function that returns the result of a shipped experiment.
        name: The experiment.
        gain: The number gamma.
        duration: How long to run; until the network is no longer finite [s].
    """
    grows = {"law.gain": gain, "law.growth": "power_of_gain", "law.discretization": "euler"}
    changes = {"law.noise": None, "law.integral_gain": 0.0, "duration": duration, **grows}
    result = run(name, {"accept": None, "log_period": 0.01, **changes})
    away = result.series["p_WE"] - result.series[DESIRED_POSITION]
    off = np.linalg.norm(away, axis=1) > 1e-3
    if not off.any():
        return np.inf
    stable = GrowingGain(gain, "power_of_gain", 1.0).reaches(2.0 / _PERIOD)
    return float(result.time[off.argmax()] / stable)


def _phi(shape: str) -> Callable[[Any], Any]:
    """Return the paper's activation: its power is 3, mu is 2 and r is 0.5."""
    if shape == "tanh":
        return np.tanh
    if shape == "tunable":
        return _tunable(0.5)
    steepness = {"hyperbolic_sine": 1.0}.get(shape)
    function = activation(shape, None, steepness)  # type: ignore[arg-type]
    return lambda e: function(np.asarray(e))


def _tunable(exponent: float) -> Callable[[Any], Any]:
    function = activation("fixed_time", exponent, None)
    return lambda e: function(np.asarray(e))


def _gain_integral(gamma: float, t: float) -> float:
    """Return the integral of gamma + t^gamma."""
    return gamma * t + t ** (gamma + 1.0) / (gamma + 1.0)


def _time(gamma: float, end: float) -> float:
    """Return when that integral is so much [s], by bisection."""
    low, high = 0.0, end / gamma
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _gain_integral(gamma, middle) > end else (middle, high)
    return high


def _time_between(shape: str, low: float, high: float) -> float:
    """Return the integral of 1/phi from one error to another."""
    return float(_integrals(shape, low, high)[1][-1])


def _integrals(shape: str, low: float, high: float) -> tuple[Array, Array]:
    """Return logarithms of errors, from a high one to a low one, and the integrals up to them."""
    logs = np.linspace(np.log(high), np.log(low), 200001)
    e = np.exp(logs)
    parts = e / _phi(shape)(e)
    steps = 0.5 * (parts[1:] + parts[:-1]) * (logs[:-1] - logs[1:])
    return logs, np.append(0.0, np.cumsum(steps))


def _course(shape: str, gamma: float, first: float, times: Array, varies: bool = True) -> Array:
    """Return the error of the design formula at times, in continuous time."""
    logs, integrals = _integrals(shape, 1e-12 * first, first)
    gain_integrals = [_gain_integral(gamma, t) if varies else gamma * t for t in times]
    return np.exp(np.interp(gain_integrals, integrals, logs))


_Problem = Callable[[float], tuple[Array, Array]]


def _planar(t: float) -> tuple[Array, Array]:
    """Return W and G of problem (66) with (67)."""
    s, c = np.sin(2.0 * t), np.cos(2.0 * t)
    a, b = np.sin(4.0 * t), np.cos(4.0 * t)
    W = np.array([[s + 2.0, c, a], [c, s + 2.0, b], [a, b, 0.0]])
    return W, np.array([-np.sin(3.0 * t), -np.cos(3.0 * t), np.cos(5.0 * t)])


def _toeplitz(size: int) -> _Problem:
    """Return the problem of (70) and (71)."""

    def problem(t: float) -> tuple[Array, Array]:
        k = np.arange(size)
        column = np.where(k == 0, np.sin(t) + 5.0, np.cos(t) / np.maximum(k, 1))
        W = column[np.abs(k[:, None] - k[None, :])]
        return W, np.sin(4.0 * t + k * np.pi / 2.0)

    return problem


def _network(
    shape: str,
    gamma: float,
    start: Array,
    duration: float,
    problem: Callable[[int], _Problem] | None = None,
    varies: bool = True,
) -> tuple[Array, Array]:
    """Return times and errors W Y - G of network (23), or of (27), integrated from a state."""
    terms, h = _planar if problem is None else problem(start.size), 1e-6
    phi = _phi(shape)

    def rate(t: float, Y: Array) -> Array:
        (W, G), (W_next, G_next), (W_last, G_last) = (terms(t + d) for d in (0.0, h, -h))
        gain = gamma + t**gamma if varies else gamma
        moving = (G_next - G_last - (W_next - W_last) @ Y) / (2.0 * h)
        return np.asarray(np.linalg.solve(W, moving - gain * phi(W @ Y - G)))

    times = np.linspace(0.0, duration, round(duration / _STEP) + 1)
    Y, states = start, [start]
    for t, after in pairwise(times):
        Y = _runge_kutta(rate, t, Y, after - t)
        states.append(Y)
    errors = [W @ Y - G for (W, G), Y in zip(map(terms, times), states, strict=True)]
    return times, np.array(errors)


def _runge_kutta(rate: Callable[[float, Array], Array], t: float, Y: Array, d: float) -> Array:
    """Return the state after a step, by the classical formula of Runge and Kutta."""
    k1 = rate(t, Y)
    k2 = rate(t + d / 2, Y + d / 2 * k1)
    k3 = rate(t + d / 2, Y + d / 2 * k2)
    k4 = rate(t + d, Y + d * k3)
    return Y + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
