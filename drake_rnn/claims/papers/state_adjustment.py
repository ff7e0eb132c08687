"""Measures of state adjustment's claims: curves of the joints' errors, speeds, and the optimum.

Each takes ``run(name, changes)``, which returns the result of a shipped experiment.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.solvers import MathematicalProgram, Solve

from ...experiment import load_experiment
from ...inputs.fields import Array
from ...laws.state_adjustment import StateAdjustment
from ...robot.postures import SelfMotion
from ...runs.result import Result
from ..claims import Run

# |q - q_d| of Tables 1 and 2 [rad], by case.
_TABLES = {
    1: (1.289461e-5, 1.177066e-5, 4.891301e-6, 1.499467e-5, 4.350270e-5, 3.934844e-5, 4.115238e-5),
    2: (5.007557e-8, 9.679112e-8, 3.814844e-8, 2.349258e-7, 9.339705e-9, 1.783016e-7, 1.185032e-8),
}


def factor_to_table(run: Run, name: str, case: int) -> float:
    """Largest factor, either way, between a joint's error at the end and that of the table [1]."""
    factors = np.abs(run(name, None).series["joint_error"][-1]) / _TABLES[case]
    return float(max(factors.max(), 1.0 / factors.min()))


def speed_at(run: Run, name: str, time: float) -> float:
    """Speed of the fastest joint at a time of the run [rad/s]."""
    result = run(name, None)
    k = int(np.searchsorted(result.time, time - 1e-9))
    return float(np.abs(result.series["velocity"][k]).max())


def joint_error(run: Run, name: str, joint: int) -> float:
    """Distance of a joint, counted from 1, from its target at the end of the run [rad]."""
    return float(abs(run(name, None).series["joint_error"][-1, joint - 1]))


def exponential_curve_error(run: Run, name: str) -> float:
    """Largest distance of the errors from e(0) exp(-r t) over the whole run, per |e(0)| [1]."""
    result = run(name, None)
    error = result.series["joint_error"]
    curve = error[0] * np.exp(-_law(result).rate * result.time)[:, np.newaxis]
    return float(np.linalg.norm(error - curve, axis=1).max() / np.linalg.norm(error[0]))


def rate_of_decay(run: Run, name: str, begin: float, end: float) -> float:
    """Rate at which the norm of the joints' errors falls between two times [1/s]."""
    result = run(name, None)
    first, last = np.searchsorted(result.time, [begin - 1e-9, end - 1e-9])
    error = np.linalg.norm(result.series["joint_error"], axis=1)
    return float(np.log(error[first] / error[last]) / (result.time[last] - result.time[first]))


def mean_speed(run: Run, name: str, begin: float, end: float) -> float:
    """Mean norm of the joint velocities between two times [rad/s]."""
    result = run(name, None)
    during = (result.time >= begin) & (result.time <= end)
    return float(np.linalg.norm(result.series["velocity"][during], axis=1).mean())


def time_until_slow(run: Run, name: str, share: float) -> float:
    """Time after which no joint is faster than a share of the run's largest joint speed [s].

    It is infinite if one is to the end.
    """
    result = run(name, None)
    fastest = np.abs(result.series["velocity"]).max(axis=1)
    above = np.flatnonzero(fastest > share * result.metrics["joint_velocity_max_rad_s"])
    return float(np.append(result.time, np.inf)[above[-1] + 1])


def time_at_speed_limit(run: Run, name: str, joint: int) -> float:
    """Time that a joint, counted from 1, is at its speed limit, to within a thousandth [s]."""
    result = run(name, None)
    limit = result.experiment.limits.require("velocity", "the claim")[joint - 1]
    at_limit = np.abs(result.series["velocity"][:, joint - 1]) > limit * (1 - 1e-3)
    return float(np.diff(result.time, prepend=0.0)[at_limit].sum())


def printed_opening(run: Run, rise_times: float) -> float:
    """The printed factor sin(pi t / 2 T) of the velocity bounds, after so many rise times T [1]."""
    return float(np.sin(np.pi * rise_times / 2))


def off_the_optimum(run: Run, name: str) -> float:
    """Largest distance of a joint's velocity from the optimum of the run's instants [rad/s].

    From 0.1 s on, every tenth of a second; the optimum is that of a solver of quadratic programs.
    """
    result = run(name, None)
    law = _law(result)
    return max(float(np.abs(v - _optimum(law, t, q, J)).max()) for t, q, J, v in _instants(result))


def off_the_optimum_at_rest(run: Run, name: str) -> float:
    """Distance of a joint's velocity from the optimum once the network has settled [rad/s].

    The largest at five of the instants of `off_the_optimum`, posture and time standing still, after
    two thousand time constants.
    """
    result = run(name, None)
    law = _law(result)
    return max(
        float(np.abs(_settle(law, t, q, J) - _optimum(law, t, q, J)).max())
        for t, q, J, _ in _instants(result)[::6]
    )


def beyond_target(run: Run, limited: bool) -> float:
    """How far a UR5's fourth joint goes beyond its target on the way [rad].

    The target is somewhere on the start's self-motion where that joint goes farther and returns.
    If ``limited``, its upper limit is 0.05 rad beyond the target.
    """
    name = "modified_state_adjustment_ur5"
    experiment = load_experiment(name)
    target = SelfMotion(experiment.arm, experiment.start).somewhere(1.2, seed=9)
    changes: dict[str, Any] = {"law.target": target.tolist(), "accept": None}
    if limited:
        upper = experiment.limits.position_upper.copy()
        upper[3] = target[3] + 0.05
        changes["limits.position_upper"] = upper.tolist()
    result = run(name, changes)
    margin = result.metrics["joint_limit_margin_min_rad"] if limited else np.inf
    return float(max(result.series["position"][:, 3].max() - target[3], 0.05 - margin))


def _law(result: Result) -> StateAdjustment:
    law = result.experiment.law
    assert isinstance(law, StateAdjustment)
    return law


def _instants(result: Result) -> list[tuple[float, Array, Array, Array]]:
    """Return time, posture, Jacobian and velocity every 0.1 s."""
    series = result.series
    indices = np.searchsorted(result.time, np.arange(0.1, result.time[-1], 0.1) - 1e-9)
    return [
        (float(result.time[k]), series["position"][k], series["J"][k], series["velocity"][k])
        for k in indices
    ]


def _optimum(law: StateAdjustment, t: float, q: Array, J: Array) -> Array:
    """Return the solution of (9) or (10)."""
    program = MathematicalProgram()
    v = program.NewContinuousVariables(q.size)
    lower, upper = law.velocity_box(t, q)
    program.AddQuadraticCost(np.eye(q.size), law.rate * (q - law.target), v)
    program.AddBoundingBoxConstraint(lower, upper, v)
    program.AddLinearEqualityConstraint(J, np.zeros(len(J)), v)
    return np.asarray(Solve(program).GetSolution(v))


def _settle(law: StateAdjustment, t: float, q: Array, J: Array) -> Array:
    """Return the network's velocities after two thousand time constants at one instant."""
    u, x, h = {"position": q, "J": J}, np.zeros(law.state.size), 0.4 * law.time_constant
    for _ in range(5000):
        k1 = law.derivatives(t, x, u)
        x = x + h * law.derivatives(t, x + h / 2 * k1, u)
    return law.commanded_velocity(t, x)
