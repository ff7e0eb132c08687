"""Measures of the claims about joint-drift-free motion that no metric gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, cast

import numpy as np

from ...experiment import load_experiment
from ...inputs.fields import Array
from ...laws import JointDriftFree
from ...laws.joint_drift_free import LinearForm
from ...signals import DESIRED_POSITION
from ..claims import Run

# The paper's Table I: MPE [m], MVE [m/s] and JD [rad], by scheme and lambda.
_TABLE_1 = {
    "galjdf": {
        0.1: (5.14e-5, 1.68e-4, 5.37e-2),
        0.5: (2.77e-4, 2.45e-4, 9.10e-3),
        1.0: (5.59e-4, 4.54e-4, 2.80e-3),
        2.0: (1.10e-3, 9.44e-4, 1.60e-3),
        3.0: (1.70e-3, 1.30e-3, 6.84e-4),
        5.0: (2.80e-3, 2.20e-3, 3.74e-4),
        10.0: (5.50e-3, 4.40e-3, 6.37e-4),
        50.0: (2.46e-2, 1.91e-2, 2.80e-3),
        100.0: (4.42e-2, 3.27e-2, 5.20e-3),
    },
    "naljdf": {
        0.1: (4.06e-5, 1.06e-4, 5.37e-2),
        0.5: (4.46e-5, 1.70e-4, 9.10e-3),
        1.0: (4.43e-5, 1.09e-4, 2.90e-3),
        2.0: (4.41e-5, 1.62e-4, 1.62e-3),
        3.0: (4.41e-5, 1.01e-4, 7.26e-4),
        5.0: (4.41e-5, 1.05e-4, 1.38e-4),
        10.0: (4.42e-5, 1.10e-4, 1.03e-4),
        50.0: (4.41e-5, 1.31e-4, 2.57e-4),
        100.0: (4.42e-5, 1.27e-4, 2.75e-4),
    },
}
_COLUMNS = (
    "position_error_component_max_m",
    "velocity_error_component_max_m_s",
    "joint_drift_mean_rad",
)
# Error of the first position, as one typed to four digits may have [m].
_OFFSET = 44e-6
# Time of a lap of the clovers [s].
_LAP = 10.0
# Time after which a motion from rest has settled [s].
_SETTLING_TIME = 1.0


def ratio_to_table_1(run: Run, experiment: str) -> float:
    """Largest factor, either way, between Table I and an experiment, in all rows and columns.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment, which begins with the scheme's.
    """
    factors = []
    for weight, printed_value in _TABLE_1[experiment.partition("_")[0]].items():
        metrics = run(experiment, {"law.return_weight": weight}).metrics
        factors += [
            metrics[name] / figure for name, figure in zip(_COLUMNS, printed_value, strict=True)
        ]
    return float(max(np.max(factors), 1.0 / np.min(factors)))


def joint_speed_at_end(
    run: Run, experiment: str, changes: Mapping[str, Any] | None = None
) -> float:
    """Largest speed of a joint at the end of a run [rad/s]."""
    return float(np.abs(run(experiment, changes).series["velocity"][-1]).max())


def error_at_end(run: Run, experiment: str, changes: Mapping[str, Any] | None = None) -> float:
    """Position error at the end of a run over the largest one; 1 if it never stops growing."""
    error = run(experiment, changes).position_error
    return float(error[-1] / error.max())


def sigma_misfit(run: Run, experiment: str, changes: Mapping[str, Any] | None = None) -> float:
    """Difference of the velocity error from Theorem 1's, over that error, from 1 s on.

    Norms over all samples and axes.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment.
        changes: Its changes, by dotted key.
    """
    result = run(experiment, changes)
    late = result.time >= _SETTLING_TIME
    error = (result.series["v_WE"] - result.series["v_WE_desired"])[late]
    sigma = result.series["velocity_error_predicted"][late]
    return float(np.linalg.norm(error - sigma) / np.linalg.norm(error))


def frozen_misfit(run: Run, experiment: str) -> float:
    """Difference of the velocity error from Theorem 1's, over that error, at rest [1].

    With J, posture and path standing still as they are half-way through a run, and without the
    bounds: where the network comes to rest.
    """
    law, form, u = _frozen(run, experiment)
    A = np.block([[form.a_v, form.a_omega], [form.b_v, form.b_omega]])
    n = form.a_v.shape[0]
    x = -np.linalg.solve(A, np.concatenate((form.a_0, form.b_0)))
    v, omega = x[:n], x[n:]
    error = u["J"] @ v - u["v_WE_desired"]
    sigma = law.diagnostics(0.0, law.state.join(v, omega), u)["velocity_error_predicted"]
    return float(np.linalg.norm(error - sigma) / np.linalg.norm(error))


def frozen_rate(run: Run, experiment: str) -> float:
    """Largest real part of the roots of velocity and omega, all else standing still [1/s].

    As half-way through a run; less than 0 if the velocity error converges from anywhere.
    """
    form = _frozen(run, experiment)[1]
    A = np.block([[form.a_v, form.a_omega], [form.b_v, form.b_omega]])
    return float(np.linalg.eigvals(A).real.max())


def _frozen(run: Run, experiment: str) -> tuple[JointDriftFree, LinearForm, dict[str, Array]]:
    """Return law, linear form and signals, held as they are half-way through a run."""
    result = run(experiment, None)
    law, k = _law(result.experiment), result.time.size // 2
    names = ("position", "p_WE", "p_WE_desired", "v_WE_desired", "J")
    u = {name: result.series[name][k] for name in names}
    u |= {name: np.zeros(law.task_size) for name in ("Jdot_v", "a_WE_desired")}
    return law, law.linear_form(u, u["position"], u["p_WE"]), u


def proof_misfit(run: Run, experiment: str, equation: Literal[36, 37]) -> float:
    """Largest part of Theorem 2's (36), d = -e'', or (37), e' = -beta2 e, that is missing [1].

    The difference of both sides over the right one, from 1 s on; norms over all samples and axes.
    """
    result = run(experiment, None)
    law, series = _law(result.experiment), result.series
    e = series["p_WE"] - series[DESIRED_POSITION]
    e_dot = series["v_WE"] - series["v_WE_desired"]
    left, right = e_dot, -law.task_beta * e
    if equation == 36:
        left = (law.task_beta + law.task_gamma) * e_dot + law.task_beta * law.task_gamma * e
        right = -np.gradient(e_dot, result.time, axis=0)
    late = result.time >= _SETTLING_TIME
    return float(np.linalg.norm((left - right)[late]) / np.linalg.norm(right[late]))


def omega_misfit(run: Run, experiment: str) -> float:
    """Difference of omega from (J J^T)^-1 (r_a - delta d), over omega, from 1 s on [1].

    Norms over all samples that are kept, and axes.
    """
    result = run(experiment, None)
    law, arm, series = _law(result.experiment), result.experiment.arm.kinematics(), result.series
    off, all_omega = [], []
    for k in np.flatnonzero(result.time >= _SETTLING_TIME):
        p, v, a = result.experiment.desired.position(float(result.time[k]))
        velocity, J = series["velocity"][k], series["J"][k]
        d = (law.task_beta + law.task_gamma) * (J @ velocity - v)
        d = d + law.task_beta * law.task_gamma * (series["p_WE"][k] - p)
        a_task = a - arm.Jdot_v(series["position"][k], velocity) - law.position_gain * d
        off.append(series["omega"][k] - np.linalg.solve(J @ J.T, a_task))
        all_omega.append(series["omega"][k])
    return float(np.linalg.norm(off) / np.linalg.norm(all_omega))


def growth_rate(run: Run, scheme: Literal["moaljdf", "moaljdf_printed"]) -> float:
    """Largest real part of the roots of velocity and omega, all else standing still [1/s].

    At the start of the parallelogram, without the bounds; less than 0 if both converge from
    anywhere.

    Args:
        run: Not needed.
        scheme: The scheme.
    """
    form = _parallelogram(scheme)[1]
    roots = np.linalg.eigvals(np.block([[form.a_v, form.a_omega], [form.b_v, form.b_omega]]))
    return float(roots.real.max())


def lasting_error(run: Run, experiment: str, laps: int, velocity: bool = False) -> float:
    """Largest error of the last lap over that of the first; 0 if errors converge to zero.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment, of 10 s a lap, which starts on its path.
        laps: Number of laps.
        velocity: Whether the error is that of the velocity, and not of the position.
    """
    result = run(experiment, _laps(laps))
    error = result.position_error
    if velocity:
        error = np.linalg.norm(result.series["v_WE"] - result.series["v_WE_desired"], axis=1)
    first, last = result.time <= _LAP, result.time >= _LAP * (laps - 1)
    return float(error[last].max() / error[first].max())


def offset_part_left(run: Run, experiment: str, laps: int) -> float:
    """Share that is left after laps of what an error of the first position, of 44 um, adds.

    The difference between a run with this error and one without it.
    """
    without, with_it = (
        run(experiment, _laps(laps, *offset)) for offset in ((), ([_OFFSET, 0.0, 0.0],))
    )
    error, own = (r.series["p_WE"][-1] - r.series[DESIRED_POSITION][-1] for r in (with_it, without))
    return float(np.linalg.norm(error - own) / _OFFSET)


def offset_left(run: Run, experiment: str, laps: int = 1, composite_gain: float = 0.0) -> float:
    """Share of an error of the first position, of 44 um, that is left after laps of a path.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment.
        laps: Number of laps.
        composite_gain: The law's k_p, ours [1/s].
    """
    changes = _laps(laps, [_OFFSET, 0.0, 0.0]) | {"law.composite_gain": composite_gain}
    error = run(experiment, changes).position_error
    return float(error[-1] / error[0])


def torque(run: Run, experiment: str, which: Literal["smallest", "largest", "initial"]) -> float:
    """Smallest or largest torque of a run, or the largest at its start [Nm]."""
    torques = run(experiment, None).series["torque"]
    if which == "initial":
        return float(torques[0].max())
    return float(torques.max() if which == "largest" else torques.min())


def velocity_error_left(run: Run, experiment: str) -> float:
    """Largest velocity error from 1 s on over the largest in the first 0.1 s."""
    result = run(experiment, None)
    error = np.linalg.norm(result.series["v_WE"] - result.series["v_WE_desired"], axis=1)
    return float(error[result.time >= _SETTLING_TIME].max() / error[result.time <= 0.1].max())


def root_mismatch(run: Run, position_gain: float) -> float:
    """Largest distance of a root of the position error from -beta2 and -gamma2 [1/s].

    With omega at rest, e'' + delta ((beta2 + gamma2) e' + beta2 gamma2 e) = 0.

    Args:
        run: Not needed.
        position_gain: delta.
    """
    law = _law(load_experiment("naljdf_clover"))
    slip, feedback = law.task_beta + law.task_gamma, law.task_beta * law.task_gamma
    roots = np.sort_complex(np.roots([1.0, position_gain * slip, position_gain * feedback]))
    law_roots = np.sort_complex(np.array([-law.task_beta, -law.task_gamma]))
    return float(np.abs(roots - law_roots).max())


def projection_residual(run: Run) -> float:
    """Largest entry of J (I - J^+ J) at the start of the UR5's clover [m]."""
    J = _jacobian("naljdf_clover")
    return float(np.abs(J @ _projector(J)).max())


def block_mismatch(run: Run, basis: Literal["joints", "singular"]) -> float:
    """Largest entry of I - J^+ J less diag(0, I), at the start of the UR5's clover.

    Args:
        run: Not needed.
        basis: Basis in which the projector is written: that of the joints, or J's right singular
            vectors.
    """
    J = _jacobian("naljdf_clover")
    m, n = J.shape
    projector = _projector(J)
    if basis == "singular":
        right = np.linalg.svd(J)[2]
        projector = right @ projector @ right.T
    return float(np.abs(projector - np.diag([0.0] * m + [1.0] * (n - m))).max())


def posture_apart(run: Run, experiment: str, other: str) -> float:
    """Largest difference of the joint positions of two experiments, the first at lambda 0 [rad]."""
    without = run(experiment, {"law.return_weight": 0.0})
    apart = without.series["position"] - run(other, None).series["position"]
    return float(np.abs(apart).max())


def optimality_gap(run: Run, scheme: Literal["moaljdf", "moaljdf_printed"]) -> float:
    """Distance of the accelerations from the optimum of (41), over the optimum.

    At the start of the parallelogram, with omega at rest; without the bounds.

    Args:
        run: Not needed.
        scheme: The scheme.
    """
    law, form, u, p_WE = _parallelogram(scheme)
    n, m = form.a_omega.shape
    p, p_dot, p_ddot = (u[f"{name}_WE_desired"] for name in ("p", "v", "a"))
    omega = -np.linalg.solve(form.b_omega, form.b_0)
    a = form.a_omega @ omega + form.a_0

    # At rest, c and the pull home are zero; the task determines what J v_dot has to be.
    zeta = 1.0 - cast(float, law.alpha)
    torques = u["bias"] - u["gravity"]
    slip, feedback = law.task_beta + law.task_gamma, law.task_beta * law.task_gamma
    d = feedback * (p_WE - p) - slip * p_dot
    conditions = np.zeros((n + m, n + m))
    conditions[:n, :n] = (1.0 - zeta) * np.eye(n) + zeta * u["M"] @ u["M"]
    conditions[:n, n:], conditions[n:, :n] = -u["J"].T, u["J"]
    p_ddot_task = p_ddot - law.position_gain * d
    best = np.linalg.solve(conditions, np.concatenate((-zeta * u["M"] @ torques, p_ddot_task)))[:n]
    return float(np.linalg.norm(a - best) / np.linalg.norm(best))


def _laps(laps: int, offset: list[float] | None = None) -> dict[str, Any]:
    """Return the changes of a clover to laps without the gain of ours, which start off the path."""
    changes: dict[str, Any] = {"path.laps": laps, "duration": _LAP * laps}
    return changes if offset is None else changes | {"path.offset": offset}


def _parallelogram(scheme: str) -> tuple[JointDriftFree, LinearForm, dict[str, Array], Array]:
    """Return law, its linear form, signals and position at rest at the parallelogram's start.

    The desired signals are those of 0.5 s later.
    """
    experiment = load_experiment("moaljdf_parallelogram", {"law.scheme": scheme})
    law = _law(experiment)
    m, n = law.task_size, experiment.arm.n
    arm, q, v = experiment.arm.kinematics(), experiment.start, np.zeros(n)
    p, p_dot, p_ddot = (part[:m] for part in experiment.desired.position(0.5))
    u = {"J": arm.J(q)[:m], "Jdot_v": np.zeros(m), "M": arm.M(q)}
    u |= {"bias": arm.bias(q, v), "gravity": arm.gravity(q)}
    u |= {"p_WE_desired": p, "v_WE_desired": p_dot, "a_WE_desired": p_ddot}
    p_WE = arm.p_WE(q)[:m]
    return law, law.linear_form(u, q, p_WE), u, p_WE


def _law(experiment: Any) -> JointDriftFree:
    return cast(JointDriftFree, experiment.law)


def _jacobian(name: str) -> Array:
    experiment = load_experiment(name)
    return experiment.arm.kinematics().J(experiment.start)


def _projector(J: Array) -> Array:
    return np.asarray(np.eye(J.shape[1]) - np.linalg.pinv(J) @ J)
