"""What a run comes to: from recorded steps to series and metrics."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram

from .experiment import Experiment
from .fields import Array
from .laws.law import Law, Signals
from .laws.rotation_error import rotation_error
from .metrics import Motion, Pressing, law_metrics, motion_metrics
from .recorder import Recorder
from .result import Result
from .systems.plant import PlantSettings
from .task import TASKS


def evaluate(
    experiment: Experiment,
    recorder: Recorder,
    warnings: list[str],
    diagram: Diagram,
    law: Law,
) -> Result:
    """The result of a run, complete or not.

    Args:
        experiment: What was run.
        recorder: What it recorded.
        warnings: What the user should know already.
        diagram: What was simulated.
        law: Of its controller.
    """
    motion = _motion(experiment, recorder, law)
    delay = experiment.setup.path_delay
    evaluation = (experiment.setup.limits, experiment.window, experiment.settling_tolerance_m)
    metrics = motion_metrics(motion, *evaluation)
    seen = motion
    if delay > 0.0:
        metrics["path_delay_s"] = delay
        seen = _seen(experiment, recorder, law, motion)
    if experiment.feedback == "unfiltered" and seen.J_hat is not None:
        # What was learned is the Jacobian of the arm that the law saw.
        metrics |= {
            name: value
            for name, value in motion_metrics(seen, *evaluation).items()
            if name.startswith("jacobian_")
        }
    observed = _diagnostics(experiment, seen, recorder.series("state"), law)
    metrics |= law_metrics(seen, observed)
    caveats = getattr(experiment.setup.law, "caveats", None)
    if caveats is not None:
        warnings = [*warnings, *caveats(metrics)]
    if motion.pressing is not None and not motion.pressing.force.any():
        warnings = [*warnings, "contact: never made"]
    if "contact_lost_time_s" in metrics:
        lost = metrics["contact_lost_time_s"]
        warnings = [*warnings, f"contact: lost at t = {lost:.4g} s{_reaction(law)}"]

    at = _samples(motion.time, experiment.log_period)
    names = ("position", "velocity", "network_velocity", "p_WE", "v_WE", "p_WE_desired")
    series = {name: getattr(motion, name)[at] for name in (*names, "v_WE_desired", "J")}
    for name, values in (
        ("acceleration", motion.joint_acceleration()),
        ("network_acceleration", motion.network_acceleration()),
    ):
        # The step that ends at a sample; before the first there is none.
        series[name] = np.concatenate((np.zeros((1, values.shape[1])), values))[at]
        series[f"{name}_peak"] = _peaks(np.abs(values), at)
    if motion.target is not None:
        series["joint_error"] = (motion.position - motion.target)[at]
    if motion.pressing is not None:
        series["normal_force"] = motion.pressing.force[at]
        series["normal_force_desired"] = motion.pressing.desired[at]
        series["normal_force_measured"] = recorder.series("normal_force")[at, 0]
        series["contact_force"] = recorder.series("contact_force")[at]
    if motion.orientation_error is not None:
        series["orientation_error"] = motion.orientation_error[at]
    state = recorder.series("state")[at]
    for name in law.state.parts:
        if name != "v":
            series[name] = law.state.part(state, name)
    return Result(
        experiment=experiment,
        time=motion.time[at],
        series=series | {name: values[at] for name, values in observed.items()},
        metrics=metrics,
        warnings=warnings,
        graphviz=diagram.GetGraphvizString(max_depth=1),
    )


def _samples(time: Array, period: float) -> NDArray[np.intp]:
    """Numbers of the steps to keep: the first in each period, and the last, shape (j,)."""
    number = np.floor(time / period + 1e-6)
    kept = np.diff(number, prepend=-1.0) != 0
    # One that ends a rounding error late has been kept as the period's first.
    if time.size and time[-1] - time[kept][-1] > 1e-6 * period:
        kept[-1] = True
    return np.flatnonzero(kept)


def _diagnostics(experiment: Experiment, motion: Motion, states: Array, law: Law) -> Signals:
    """What the law tells of itself, at every step; computed now, not while running."""
    u = {
        "position": motion.position,
        "p_WE": motion.p_WE,
        "p_WE_desired": motion.p_WE_desired,
        "v_WE_desired": motion.v_WE_desired,
        "J": motion.J,
    }
    u |= _further(experiment, motion, [name for name in law.inputs.parts if name not in u])
    return law.diagnostics(motion.time, states, u)


def _further(experiment: Experiment, motion: Motion, names: Iterable[str]) -> Signals:
    """Those of the signals that posture, velocity and time determine, at every step."""
    setup = experiment.setup
    arm = setup.arm.kinematics()
    axes = list(TASKS[experiment.task].axes)
    of_step: dict[str, Callable[[float, Array, Array], Array]] = {
        "a_WE_desired": lambda t, q, v: setup.path.evaluate(t)[2][axes],
        "Jdot_v": lambda t, q, v: arm.Jdot_v(q, v)[axes],
        "M": lambda t, q, v: arm.M(q),
        "bias": lambda t, q, v: arm.bias(q, v),
        "gravity": lambda t, q, v: arm.gravity(q),
        "R_WE": lambda t, q, v: arm.R_WE(q),
        "J_omega": lambda t, q, v: arm.J_omega(q),
    }
    if setup.contact is not None:
        normal = setup.contact.surface.believed_normal_W
        of_step["normal_WE"] = lambda t, q, v: normal
    steps = list(zip(motion.time.tolist(), motion.position, motion.velocity, strict=True))
    return {
        name: np.array([of_step[name](*step) for step in steps])
        for name in names
        if name in of_step
    }


def _seen(experiment: Experiment, recorder: Recorder, law: Law, motion: Motion) -> Motion:
    """The motion as the law saw it, where a path is followed with a delay."""
    if experiment.feedback == "unfiltered":
        return _motion(experiment, recorder, law, virtual=True)
    axes = list(TASKS[experiment.task].axes)
    evaluate = experiment.setup.path.evaluate
    v_WE_desired = np.array([evaluate(t)[1][axes] for t in recorder.time.tolist()])
    return replace(motion, v_WE_desired=v_WE_desired)


def _motion(
    experiment: Experiment, recorder: Recorder, law: Law, *, virtual: bool = False
) -> Motion:
    """The recorded steps, and what follows from them: path and kinematics are functions.

    Asking their ports while running would cost more than the law itself.

    Args:
        experiment: What has run.
        recorder: What it recorded.
        law: Its law.
        virtual: Whether of the virtual arm, which the path's delay does not concern.
    """
    setup = experiment.setup
    task = TASKS[experiment.task]
    axes = list(task.axes)
    kinematics = setup.arm.kinematics()
    origin = setup.path.start_point(setup.p_WE_start)
    prefix, delay = ("virtual_", 0.0) if virtual else ("", setup.path_delay)
    position, velocity = (recorder.series(prefix + name) for name in ("position", "velocity"))
    steps = position.shape[0]
    p_WE, p_WE_desired, v_WE_desired = (np.empty((steps, len(axes))) for _ in range(3))
    J = np.empty((steps, task.size, position.shape[1]))
    turned = np.empty(steps) if setup.holds_orientation else None
    for k, (t, q) in enumerate(zip(recorder.time, position, strict=True)):
        p_WE[k] = kinematics.p_WE(q)[axes]
        J[k] = task.J(kinematics, q)
        p, v, _ = setup.path.evaluate(float(t) - delay)
        p_WE_desired[k] = (origin + p)[axes]
        v_WE_desired[k] = v[axes]
        if turned is not None:
            turned[k] = np.linalg.norm(rotation_error(kinematics.R_WE(q), setup.R_WE_start))
    state = recorder.series("state")
    return Motion(
        time=recorder.time,
        position=position,
        velocity=velocity,
        network_velocity=law.state.part(state, "v"),
        p_WE=p_WE,
        v_WE=np.einsum("kmn,kn->km", J[:, -len(axes) :], velocity),
        p_WE_desired=p_WE_desired,
        v_WE_desired=v_WE_desired,
        J=J,
        J_hat=law.state.part(state, "J_hat") if "J_hat" in law.state else None,
        target=setup.target,
        orientation_error=turned,
        pressing=_pressing(experiment, recorder),
        tick=_tick(experiment),
        network_tick=experiment.period,
    )


def _pressing(experiment: Experiment, recorder: Recorder) -> Pressing | None:
    """The force along the surface's true normal, as the contact knows it."""
    contact = experiment.setup.contact
    if contact is None:
        return None
    n = contact.surface.normal_W
    return Pressing(
        normal=n,
        force=recorder.series("contact_force") @ n,
        desired=np.array([contact.force.at(t) for t in recorder.time.tolist()]),
    )


def _reaction(law: Law) -> str:
    reaction = getattr(getattr(law, "contact_loss", None), "reaction", None)
    return "" if reaction is None else f"; contact_loss: {reaction}"


def _tick(experiment: Experiment) -> float | None:
    """Time for which the arm's velocity is held [s]; None if it changes all the time."""
    if experiment.level == "dynamic":
        plant = experiment.plant
        return PlantSettings().time_step if plant is None else plant.time_step
    dither = experiment.dither
    if dither is None or dither.model != "actuated" or experiment.filter is not None:
        return experiment.period
    return dither.hold if experiment.period is None else min(dither.hold, experiment.period)


def _peaks(values: Array, at: NDArray[np.intp]) -> Array:
    """Largest entry of the rows up to each of ``at`` since the one before, shape (len(at),)."""
    peaks = np.zeros(at.size)
    for k in range(1, at.size):
        peaks[k] = values[at[k - 1] : at[k]].max(initial=0.0)
    return peaks
