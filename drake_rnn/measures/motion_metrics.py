"""Computation of the metrics from every step of a motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..laws.law import Signals
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .metrics import violation_metric
from .motion import Motion, Pressing

_HIGHER = tuple(DERIVATIVE_UNITS)[2:]
# Time between the velocities that these derivatives are differences of [s].
_DIFFERENCE = 0.01

# A gap in the contact that is longer than this counts as its loss [s].
_LOST = 0.05

# Share of the desired force at which it has risen.
_RISEN = 0.95

# Share of a bound at which a joint is said to be at it: laws approach their bounds smoothly.
_AT_BOUND = 0.99

# Joint error below which the arm has arrived at its target [rad].
ARRIVED = 0.01


def motion_metrics(
    motion: Motion,
    limits: JointLimits,
    window: tuple[float, float] | None,
    settling_tolerance: float,
) -> dict[str, float]:
    """Return the metrics that apply to a motion, by name.

    Errors, drift and Jacobian errors are taken over ``window``; velocities, accelerations,
    margins and violations always over the whole run.

    Args:
        motion: Motion of the arm.
        limits: Limits of the experiment.
        window: Start and end of the window [s]; None for the whole run.
        settling_tolerance: Position error below which the arm has settled [m].
    """
    if motion.time.size == 0:
        return {}
    # In a run that diverged, squares may overflow: metrics that are not finite are left out.
    with np.errstate(over="ignore", invalid="ignore"):
        metrics = _errors(motion, window, settling_tolerance)
        metrics |= _drift(motion, window)
        metrics |= _joints(motion, limits)
        metrics |= _posture(motion, window)
        metrics |= _following(motion)
        if motion.pressing is not None:
            metrics |= _contact(motion, motion.pressing, window)
        if motion.J_hat is not None:
            metrics |= _jacobian(motion, motion.J_hat, window)
    return {name: float(value) for name, value in metrics.items() if np.isfinite(value)}


def law_metrics(motion: Motion, observed: Signals) -> dict[str, float]:
    """Return the metrics of a law's observables over the whole run, by name.

    Args:
        motion: Motion as the law saw it.
        observed: Observables of the law at every step.
    """
    if motion.time.size == 0:
        return {}
    metrics = {}
    if "saturated" in observed:
        metrics["saturated_fraction"] = np.mean(observed["saturated"])
    if "acceleration_demand" in observed:
        demand = np.abs(observed["acceleration_demand"])
        metrics["joint_acceleration_demand_max_rad_s2"] = demand.max()
    if "orientation_rank" in observed:
        metrics["orientation_rank_min"] = observed["orientation_rank"].min()
    if "contact_lost" in observed and observed["contact_lost"].any():
        # A loss that the law detects counts even if some contact is left.
        metrics["contact_lost_time_s"] = motion.time[np.argmax(observed["contact_lost"][:, 0])]
    if "displacement" in observed:
        with np.errstate(over="ignore", invalid="ignore"):
            moved = motion.p_WE - motion.p_WE[0]
            told = observed["displacement"] - observed["displacement"][0]
            metrics["invariant_error_max_m"] = np.linalg.norm(moved - told, axis=1).max()
    return {name: float(value) for name, value in metrics.items() if np.isfinite(value)}


def _within(motion: Motion, window: tuple[float, float] | None) -> NDArray[np.bool_]:
    if window is None:
        return np.ones(motion.time.size, dtype=bool)
    # Step times carry rounding errors.
    return (motion.time >= window[0] - 1e-9) & (motion.time <= window[1] + 1e-9)


def _errors(
    motion: Motion, window: tuple[float, float] | None, tolerance: float
) -> dict[str, float]:
    metrics = {}
    within = _within(motion, window)
    error = motion.aside(motion.p_WE - motion.p_WE_desired)
    norm = np.linalg.norm(error, axis=1)
    if within.any():
        slip = motion.aside(motion.v_WE - motion.v_WE_desired)
        metrics = {
            "position_error_max_m": norm[within].max(),
            "position_error_component_max_m": np.abs(error[within]).max(),
            "position_error_rms_m": np.sqrt(np.mean(norm[within] ** 2)),
            "velocity_error_max_m_s": np.linalg.norm(slip[within], axis=1).max(),
            "velocity_error_component_max_m_s": np.abs(slip[within]).max(),
        }
    settled = _settled(motion.time, norm, tolerance)
    if settled is not None:
        metrics["settling_time_s"] = settled
    return metrics


def _drift(motion: Motion, window: tuple[float, float] | None) -> dict[str, float]:
    metrics = {}
    within = np.flatnonzero(_within(motion, window))
    # Joints that move to a target posture, or along an open path, do not drift.
    if within.size > 1 and motion.target is None and motion.returns:
        drift = np.abs(motion.position[within[-1]] - motion.position[within[0]])
        metrics = {"joint_drift_max_rad": drift.max(), "joint_drift_mean_rad": drift.mean()}
    if motion.lap_start is not None and motion.target is None:
        began = int(np.searchsorted(motion.time, motion.lap_start - 1e-9))
        metrics["lap_drift_max_rad"] = np.abs(motion.position[-1] - motion.position[began]).max()
    moved = np.linalg.norm(motion.p_WE - motion.p_WE[0], axis=1)
    return metrics | {
        "end_effector_drift_max_m": moved.max(),
        "end_effector_drift_end_m": moved[-1],
    }


def _following(motion: Motion) -> dict[str, float]:
    metrics = {}
    if motion.position_commanded is not None:
        off = np.abs(motion.position - motion.position_commanded)
        metrics["command_error_max_rad"] = off.max()
    if motion.p_WE_commanded is not None:
        away = np.linalg.norm(motion.p_WE - motion.p_WE_commanded, axis=1)
        metrics["command_error_max_m"] = away.max()
    return metrics


def _posture(motion: Motion, window: tuple[float, float] | None) -> dict[str, float]:
    metrics = {}
    if motion.orientation_error is not None and (within := _within(motion, window)).any():
        angle = motion.orientation_error[within]
        metrics["orientation_error_max_rad"] = angle.max()
        metrics["orientation_error_rms_rad"] = np.sqrt(np.mean(angle**2))
    if motion.target is None:
        return metrics
    error = np.abs(motion.position - motion.target).max(axis=1)
    metrics["joint_error_max_rad"] = error[-1]
    settled = _settled(motion.time, error, ARRIVED)
    if settled is not None:
        metrics["joint_settling_time_s"] = settled
    return metrics


def _contact(
    motion: Motion, pressing: Pressing, window: tuple[float, float] | None
) -> dict[str, float]:
    metrics = {"normal_force_peak_N": pressing.force.max()}
    risen = pressing.force >= _RISEN * pressing.desired[-1]
    if risen.any():
        metrics["force_rise_time_s"] = motion.time[int(np.argmax(risen))]
    touching = pressing.force > 0.0
    if (within := _within(motion, window)).any():
        error = (pressing.force - pressing.desired)[within]
        lateral = motion.aside(motion.p_WE - motion.p_WE_desired)[within]
        metrics |= {
            "force_error_mean_N": error.mean(),
            "force_error_rms_N": np.sqrt(np.mean(error**2)),
            "force_error_max_N": np.abs(error).max(),
            "lateral_error_max_m": np.linalg.norm(lateral, axis=1).max(),
            "contact_lost_fraction": np.mean(~touching[within]),
        }
    made = int(np.argmax(touching))
    if touching.any():
        # Time since the last contact, from the first contact on.
        time = motion.time[made:]
        last = np.maximum.accumulate(np.where(touching[made:], time, -np.inf))
        gap = time - last
        if (gap > _LOST).any():
            metrics["contact_lost_time_s"] = last[int(np.argmax(gap > _LOST))]
    return metrics


def _settled(time: Array, error: Array, tolerance: float) -> float | None:
    """Return the time after which ``error`` stays below ``tolerance``; None if it does not."""
    late = np.flatnonzero(~(error < tolerance))
    if late.size == 0:
        return float(time[0])
    return float(time[late[-1] + 1]) if late[-1] + 1 < error.size else None


def _joints(motion: Motion, limits: JointLimits) -> dict[str, float]:
    speed = np.abs(motion.velocity)
    margin = np.minimum(
        motion.position - limits.position_lower, limits.position_upper - motion.position
    )
    gram = motion.J @ np.swapaxes(motion.J, 1, 2)
    metrics = {
        "joint_velocity_max_rad_s": speed.max(),
        "joint_limit_margin_min_rad": margin.min(),
        "singular_value_min": np.sqrt(np.maximum(0.0, np.linalg.eigvalsh(gram)[:, 0].min())),
    }
    derivatives = [("velocity", speed)]
    if motion.time.size > 1:
        acceleration = np.abs(motion.joint_acceleration())
        derivatives.append(("acceleration", acceleration))
        metrics |= {
            "joint_acceleration_max_rad_s2": acceleration.max(),
            "joint_velocity_initial_rad_s": speed[1].max(),
            "joint_acceleration_initial_rad_s2": acceleration[0].max(),
        }
        # A ramp ends at its law's velocity except for rounding.
        if not np.allclose(motion.network_velocity, motion.velocity, rtol=1e-9, atol=1e-12):
            network = np.abs(motion.network_acceleration())
            metrics["network_acceleration_max_rad_s2"] = network.max()
    higher = _higher_derivatives(motion, limits)
    if "jerk" in higher:
        jerk = higher["jerk"]
        metrics["joint_jerk_max_rad_s3"] = jerk.max()
        metrics["joint_jerk_rms_rad_s3"] = np.sqrt(np.mean(jerk**2))
    derivatives += [*higher.items()]
    if np.isfinite(margin).any():
        metrics[violation_metric("position")] = np.maximum(0.0, -margin.min())
    for name, values in derivatives:
        order = 1 + list(DERIVATIVE_UNITS).index(name)
        bound = limits.bounds[name]
        if bound is not None and np.isfinite(bound).any():
            metrics[f"limit_ratio_{order}_max"] = (values / bound).max()
            metrics[violation_metric(name)] = np.maximum(0.0, (values - bound).max())
            if name in ("velocity", "acceleration"):
                metrics |= _at_bound(name, values, bound)
    return metrics


def _at_bound(name: str, values: Array, bound: Array) -> dict[str, float]:
    """Return how often some joint is at its bound, and which one of them is most often."""
    at = values >= _AT_BOUND * bound
    metrics = {f"{name}_bound_fraction": float(np.mean(at.any(axis=1)))}
    if at.any():
        metrics[f"{name}_bound_joint"] = 1 + int(np.argmax(at.sum(axis=0)))
    return metrics


def _higher_derivatives(motion: Motion, limits: JointLimits) -> dict[str, Array]:
    """Return the magnitudes of the jerk, and of snap and crackle where they are bounded, by name.

    They are differences of the velocity over 10 ms: over 1 ms, the rounding of positions would
    dominate the fifth derivative.
    """
    wanted = [name for name in _HIGHER if name == "jerk" or limits.bounds[name] is not None]
    if motion.time[-1] - motion.time[0] < 6 * _DIFFERENCE:
        return {}
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, _DIFFERENCE)
    # For each time the step that ends there, or the first one after it.
    at = np.minimum(np.searchsorted(motion.time, time - 1e-9), motion.time.size - 1)
    velocity = motion.velocity[at]
    return {
        name: np.abs(np.diff(velocity, n=order, axis=0)) / _DIFFERENCE**order
        for order, name in enumerate(_HIGHER, start=2)
        if name in wanted
    }


def _jacobian(motion: Motion, J_hat: Array, window: tuple[float, float] | None) -> dict[str, float]:
    within = _within(motion, window)
    difference = (motion.J - J_hat)[within]
    if difference.size == 0:
        return {}
    v = motion.network_velocity[within]
    speed = np.linalg.norm(v, axis=1)
    moving = speed > 1e-6
    size = np.linalg.norm(difference, axis=(1, 2))
    metrics = {"jacobian_error_median": np.median(size), "jacobian_error_max": size.max()}
    if moving.any():
        along = np.linalg.norm(np.einsum("kmn,kn->km", difference, v), axis=1)
        metrics["jacobian_error_excited_median"] = np.median(along[moving] / speed[moving])
    return metrics
