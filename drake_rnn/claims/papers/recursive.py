"""Measures of the recursive network's claims: ratios to bounds, roots, and levels at their targets.

Each takes ``run(name, changes)``, which returns the result of a shipped experiment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...experiment import load_experiment
from ...inputs.fields import Array
from ...laws.call_checks import without_checks
from ...robot.limits import DERIVATIVE_UNITS
from ...runs.result import Result
from ..claims import (
    Run,
    time_ratio,
)

_ORDERS = (1, 2, 3, 4, 5)


def largest_ratio(
    run: Run,
    name: str,
    orders: Sequence[int] = _ORDERS,
    changes: Mapping[str, Any] | None = None,
) -> float:
    """Largest ratio of the arm's true derivatives to their bounds, of these orders [1]."""
    return max(_ratios(run(name, changes), orders))


def smallest_ratio(run: Run, name: str, orders: Sequence[int] = _ORDERS) -> float:
    """Of the orders' largest ratios of derivatives to their bounds, the smallest [1]."""
    return min(_ratios(run(name, None), orders))


def displayed_ratio(run: Run, name: str, changes: Mapping[str, Any] | None = None) -> float:
    """Largest ratio of the filters' signals, which stand for derivatives 2 to n, to the bounds [1].

    They are filtered from clipped targets, and are no derivatives of the joint angles.
    """
    result = run(name, changes)
    largest = np.abs(result.series["levels"]).max(axis=0)
    limits = result.experiment.limits
    bounds = [limits.require(order, "a level") for order in list(DERIVATIVE_UNITS)[1:]]
    return float((largest / np.array(bounds[: len(largest)])).max())


def posture_apart(run: Run, name: str, changes: Mapping[str, Any]) -> float:
    """Largest difference that changes of an experiment make to its joint positions [rad]."""
    apart = run(name, {"accept": None, **changes}).series["position"] - run(name).series["position"]
    return float(np.abs(apart).max())


def step_cost(run: Run, name: str) -> float:
    """Median time of one sample of the run's law alone [us]."""
    return run(name).timings["control_step_us"]


def growth_rate(run: Run, name: str, third_gain: float | None = None) -> float:
    """Largest real part of the roots of the printed chain while nothing saturates [1/s].

    The chain of five levels is linear there, with the polynomial
    s^4 + k5 s^3 + k5 k4 s^2 + k5 k4 k3 s + k5 k4 k3 k2.
    """
    gains = np.array(load_experiment(name).document.law["gains"], dtype=float)
    if third_gain is not None:
        gains[2] = third_gain
    # In units of 1e4 / s, or the coefficients would be of sizes from 1 to 1e21.
    scale = 1e4
    coefficients = np.cumprod(np.append(1.0, gains[:0:-1] / scale))
    return float(scale * np.roots(coefficients).real.max())


def scaled_projection_apart(run: Run) -> float:
    """Largest difference of the two sides of (13), at random levels, targets and boxes [1].

    P clips -k (x - w) to a box; the other side is k times -(x - w) clipped to a box of 1 / k.
    """
    rng, apart = np.random.default_rng(0), 0.0
    for _ in range(1000):
        k, off = 10.0 ** rng.uniform(0, 5), rng.normal(size=7)
        upper = rng.uniform(0.1, 1.0, 7) * 10.0 ** rng.uniform(-3, 3)
        one, other = np.clip(-k * off, -upper, upper), k * np.clip(-off, -upper / k, upper / k)
        apart = max(apart, float((np.abs(one - other) / upper).max()))
    return apart


def cost_of_levels(run: Run, name: str) -> float:
    """Time that a sample of the law takes with all its levels, per time with one level [1]."""
    all_levels = len(load_experiment(name).document.law["gains"])
    return time_ratio(_sample(name, all_levels), _sample(name, 1))


def first_level_off_target(
    run: Run, name: str, levels: int, period: float, duration: float
) -> float:
    """Distance |x_1 - w_1| late, in units of rho / (4 k_2) of (41), posture and path at rest [1].

    The posture is the experiment's start, 0.1 mm off its target along each axis. It is the largest
    distance of a joint over the second half of the time. rho is the bound of the second level: the
    norm of (29) reaches it.
    """
    law, u = _at_rest(name, levels)
    target = law.targets(np.zeros(law.state.size), u)[0]
    x, off, steps = np.zeros(law.state.size), 0.0, round(duration / period)
    for k in range(steps):
        x = law.step(k * period, x, u, period)
        if k >= steps / 2:
            off = max(off, float(np.abs(x[: target.size] - target).max()))
    rho = float(law.limits.require("acceleration", "the second level").max())
    return off / (rho / (4 * law.gains[1]))


def _at_rest(name: str, levels: int) -> tuple[Any, dict[str, Array]]:
    """Return the printed law with fewer levels, and the signals of the start, 0.1 mm off."""
    gains = list(load_experiment(name).document.law["gains"])
    experiment = load_experiment(name, {"law.gains": gains[:levels], "accept": None})
    kinematics, q = experiment.arm.kinematics(), experiment.start
    p_WE = kinematics.p_WE(q)
    u = {"position": q, "p_WE": p_WE, "p_WE_desired": p_WE + 1e-4, "J": kinematics.J(q)}
    return experiment.law, u


def _sample(name: str, levels: int) -> Callable[[], object]:
    law, u = _at_rest(name, levels)
    x = np.zeros(law.state.size)
    step = without_checks(law.step)
    return lambda: step(0.0, x, u, 1e-3)


def _ratios(result: Result, orders: Sequence[int]) -> list[float]:
    return [result.metrics[f"limit_ratio_{order}_max"] for order in orders]
