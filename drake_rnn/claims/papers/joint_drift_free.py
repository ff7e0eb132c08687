"""Measures of the claims about joint-drift-free motion that no metric gives."""

from __future__ import annotations

from typing import Any, Literal, cast

import numpy as np

from ...experiment import load_experiment
from ...inputs.fields import Array
from ...laws import JointDriftFree
from ..measuring import Run

# The paper's Table I: MPE [m], MVE [m/s] and JD [rad], by scheme and lambda.
_TABLE_1 = {
    "galjdf": {
        1.0: (5.59e-4, 4.54e-4, 2.80e-3),
        10.0: (5.50e-3, 4.40e-3, 6.37e-4),
        100.0: (4.42e-2, 3.27e-2, 5.20e-3),
    },
    "naljdf": {
        1.0: (4.43e-5, 1.09e-4, 2.90e-3),
        10.0: (4.42e-5, 1.10e-4, 1.03e-4),
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
# Time after which a motion from rest has settled [s].
_SETTLED = 1.0


def ratio_to_table_1(run: Run, experiment: str) -> float:
    """Largest factor, either way, between Table I and an experiment, at lambda 1, 10 and 100.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment, which begins with the scheme's.
    """
    factors = []
    for weight, printed in _TABLE_1[experiment.partition("_")[0]].items():
        found = run(experiment, {"law.return_weight": weight}).metrics
        factors += [found[name] / figure for name, figure in zip(_COLUMNS, printed, strict=True)]
    return float(max(np.max(factors), 1.0 / np.min(factors)))


def joint_speed_at_end(run: Run, experiment: str) -> float:
    """Largest speed of a joint at the end of a run [rad/s]."""
    return float(np.abs(run(experiment, None).series["velocity"][-1]).max())


def error_at_end(run: Run, experiment: str) -> float:
    """Position error at the end of a run over the largest one; 1 if it never stops growing."""
    error = run(experiment, None).position_error
    return float(error[-1] / error.max())


def sigma_misfit(run: Run, experiment: str, return_weight: float | None = None) -> float:
    """Difference of the velocity error from Theorem 1's, over that error, from 1 s on.

    Norms over all samples and axes.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment.
        return_weight: The law's lambda; by default the experiment's own.
    """
    changes = None
    if return_weight is not None:
        changes = {"law.return_weight": return_weight}
    result = run(experiment, changes)
    late = result.time >= _SETTLED
    error = (result.series["v_WE"] - result.series["v_WE_desired"])[late]
    sigma = result.series["velocity_error_predicted"][late]
    return float(np.linalg.norm(error - sigma) / np.linalg.norm(error))


def offset_left(run: Run, experiment: str, laps: int = 1, composite_gain: float = 0.0) -> float:
    """Share of an error of the first position, of 44 um, that is left after laps of a path.

    Args:
        run: Returns the result of an experiment with changes.
        experiment: Name of the experiment.
        laps: Number of laps.
        composite_gain: The law's k_p, ours [1/s].
    """
    changes = {"path.laps": laps, "law.composite_gain": composite_gain}
    changes["duration"] = 10.0 * laps
    error = run(experiment, {**changes, "path.offset": [_OFFSET, 0.0, 0.0]}).position_error
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
    return float(error[result.time >= _SETTLED].max() / error[result.time <= 0.1].max())


def root_mismatch(run: Run, position_gain: float) -> float:
    """Largest distance of a root of the position error from -beta2 and -gamma2 [1/s].

    With omega at rest, e'' + delta ((beta2 + gamma2) e' + beta2 gamma2 e) = 0.

    Args:
        run: Not needed.
        position_gain: delta.
    """
    law = _law(load_experiment("naljdf_clover"))
    slip, feedback = law.task_beta + law.task_gamma, law.task_beta * law.task_gamma
    found = np.sort_complex(np.roots([1.0, position_gain * slip, position_gain * feedback]))
    named = np.sort_complex(np.array([-law.task_beta, -law.task_gamma]))
    return float(np.abs(found - named).max())


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
    experiment = load_experiment("moaljdf_parallelogram", {"law.scheme": scheme})
    law = _law(experiment)
    m, n = law.task_size, experiment.arm.n
    arm, q, v = experiment.arm.kinematics(), experiment.start, np.zeros(n)
    p, p_dot, p_ddot = (part[:m] for part in experiment.desired.position(0.5))
    u = {"J": arm.J(q)[:m], "Jdot_v": np.zeros(m), "M": arm.M(q)}
    u |= {"bias": arm.bias(q, v), "gravity": arm.gravity(q)}
    u |= {"p_WE_desired": p, "v_WE_desired": p_dot, "a_WE_desired": p_ddot}
    form = law.linear_form(u, q, arm.p_WE(q)[:m])
    omega = -np.linalg.solve(form.b_omega, form.b_0)
    found = form.a_omega @ omega + form.a_0

    # At rest, c and the pull home are zero; the task determines what J v_dot has to be.
    zeta = 1.0 - cast(float, law.alpha)
    torques = u["bias"] - u["gravity"]
    slip, feedback = law.task_beta + law.task_gamma, law.task_beta * law.task_gamma
    d = feedback * (arm.p_WE(q)[:m] - p) - slip * p_dot
    conditions = np.zeros((n + m, n + m))
    conditions[:n, :n] = (1.0 - zeta) * np.eye(n) + zeta * u["M"] @ u["M"]
    conditions[:n, n:], conditions[n:, :n] = -u["J"].T, u["J"]
    wanted = p_ddot - law.position_gain * d
    best = np.linalg.solve(conditions, np.concatenate((-zeta * u["M"] @ torques, wanted)))[:n]
    return float(np.linalg.norm(found - best) / np.linalg.norm(best))


def _law(experiment: Any) -> JointDriftFree:
    return cast(JointDriftFree, experiment.law)


def _jacobian(name: str) -> Array:
    experiment = load_experiment(name)
    return experiment.arm.kinematics().J(experiment.start)


def _projector(J: Array) -> Array:
    return np.asarray(np.eye(J.shape[1]) - np.linalg.pinv(J) @ J)
