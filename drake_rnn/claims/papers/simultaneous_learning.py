"""Measures of the claims about simultaneous learning and control that no metric gives.

A measure takes ``run(name, changes)``, which returns the result of a shipped experiment, and the
arguments that its criterion gives; it returns one number. Algebra is tried at random points, of a
fixed seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...inputs.fields import Array
from ...laws import SimultaneousLearning
from ...laws.call_checks import without_checks
from ...runs.result import Result
from ..claims import (
    Run,
    signals_of_structure,
    time_ratio,
)

_SEED = 0
# Joints in the examples for algebra.
_JOINTS = 7
# Share of a bound from which on it counts as reached.
_NEAR_BOUND = 0.999
# Shortest time between two visits to a bound [s].
_APART = 0.1


def structure_inputs(run: Run, name: str) -> float:
    """Number of signals that an experiment's law sees of the arm's structure [1]."""
    return signals_of_structure(name)


def joint_speed(run: Run, name: str, joint: int) -> float:
    """Largest speed that the law gives to a joint, from 1 on, per its bound [1]."""
    result = run(name, None)
    bound = result.experiment.limits.require("velocity", "the speed bound")
    largest = np.abs(result.series["network_velocity"]).max(axis=0)
    return float(largest[joint - 1] / bound[joint - 1])


def visits_to_acceleration_bound(run: Run, name: str) -> float:
    """How often the largest joint acceleration of the law comes to its bound [1]."""
    result = run(name, None)
    bound = result.experiment.limits.require("acceleration", "the acceleration bound").min()
    largest = np.abs(result.series["network_acceleration"]).max(axis=1)
    times = result.time[largest >= _NEAR_BOUND * bound]
    return float(0 if times.size == 0 else 1 + np.count_nonzero(np.diff(times) > _APART))


def learning_time(run: Run, name: str, changes: Mapping[str, Any], level: float) -> float:
    """When the largest entry of J - J_hat first is below a level in metres [s]."""
    result = run(name, changes)
    error = np.abs(result.series["J"] - result.series["J_hat"]).max(axis=(1, 2))
    below = result.time[error < level]
    return float(below[0]) if below.size else np.inf


def jacobian_mismatch(run: Run, name: str, start: float) -> float:
    """Largest |J - J_hat| after a time, per the largest change of J from then on [1]."""
    result = run(name, None)
    late = result.time >= start
    J, J_hat = result.series["J"][late], result.series["J_hat"][late]
    return float(np.abs(J - J_hat).max() / np.ptp(J, axis=0).max())


def step_cost(run: Run, name: str) -> float:
    """Median time of one sample of the run's law alone [us]."""
    return run(name, None).timings["control_step_us"]


def cost_ratio(run: Run, name: str, other: str) -> float:
    """Time of one sample of a run's law, per that of another run's [1]."""
    return time_ratio(_sample(run(name, None)), _sample(run(other, None)))


def projection_product(run: Run, *, nearest: bool) -> float:
    """Least (m - P(m))^T (P(m) - w) for m outside a box and w in it [1].

    Args:
        run: Not needed.
        nearest: Whether w may also be P(m) itself, besides points inside.
    """
    least = np.inf
    for m, P_m, w in _outside():
        least = min(least, float((m - P_m) @ (P_m - w)))
        if nearest:
            least = min(least, float((m - P_m) @ (P_m - P_m)))
    return least


def projection_excess(run: Run) -> float:
    """Least of (m - P(m))^T (m - w) / |m - P(m)|^2 for m outside a box, w in it [1]."""
    return min(
        float((m - P_m) @ (m - point) / ((m - P_m) @ (m - P_m)))
        for m, P_m, w in _outside()
        for point in (w, P_m)
    )


def acceleration_ratio(run: Run, samples: int = 2000) -> float:
    """Largest joint acceleration at random states of the network, per its bound [1]."""
    result = run("slc_nephroid_known", None)
    law = result.experiment.law
    assert isinstance(law, SimultaneousLearning)
    bound = result.experiment.limits.require("acceleration", "the acceleration bound").min()
    rng, largest = np.random.default_rng(_SEED), 0.0
    for _ in range(samples):
        row = int(rng.integers(result.time.size))
        u = {name: result.series[name][row] for name in law.inputs.parts}
        x = rng.normal(size=law.state.size) * 10.0 ** rng.uniform(-3, 1)
        v_dot = law.state.part(law.derivatives(0.0, x, u), "v")
        largest = max(largest, float(np.abs(v_dot).max()))
    return largest / bound


def convexity(run: Run, samples: int = 2000) -> float:
    """How far the learning's cost, half |v_WE - J_hat v|^2, lies below its chords [m^2/s^2].

    The least over random pairs of J_hat, halfway between them; at least 0 if the cost is convex.
    """
    rng, least = np.random.default_rng(_SEED), np.inf
    for _ in range(samples):
        one, other = rng.normal(size=(2, 3, _JOINTS))
        v, v_WE = rng.normal(size=_JOINTS), rng.normal(size=3)

        def cost(J_hat: Array, v: Array = v, v_WE: Array = v_WE) -> float:
            return 0.5 * float(np.sum((v_WE - J_hat @ v) ** 2))

        least = min(least, 0.5 * (cost(one) + cost(other)) - cost(0.5 * (one + other)))
    return least


def _sample(result: Result) -> Callable[[], object]:
    """Return the calculation of one sample of a law, with the signals of the middle of its run."""
    law = result.experiment.law
    assert isinstance(law, SimultaneousLearning)
    row = result.time.size // 2
    u = {name: result.series[name][row] for name in law.inputs.parts}
    v, multipliers = result.series["network_velocity"][row], result.series["multipliers"][row]
    x, period = law.state.join(v, multipliers), float(result.experiment.document.period or 0.0)
    step = without_checks(law.step)
    return lambda: step(0.0, x, u, period)


def _outside(samples: int = 2000) -> list[tuple[Array, Array, Array]]:
    """Return points m outside a box, their projections, and points w in the box."""
    rng, ratios = np.random.default_rng(_SEED), []
    for _ in range(samples):
        upper = rng.uniform(0.1, 1.0, _JOINTS)
        m, w = rng.normal(size=_JOINTS), rng.uniform(-upper, upper)
        P_m = np.clip(m, -upper, upper)
        if (P_m != m).any():
            ratios.append((m, P_m, w))
    return ratios
