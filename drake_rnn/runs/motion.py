"""The motion of a run, or of a part of it, computed from the recorded joints."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ..diagrams import Loop
from ..experiment import Experiment
from ..features.feature import EvaluationSteps
from ..inputs.fields import Array
from ..inputs.messages import field_names, fields_of
from ..laws import Reading, Signals
from ..laws.checks import observables_of
from ..measures import Motion, Steps
from ..paths import LedPath
from ..robot.rotation import rotation_error
from ..signals import (
    DESIRED_ORIENTATION,
    OF_EVERY_MOTION,
    POSITION_OF_PATH,
    DelayedPath,
    View,
    at_steps,
    names_of,
)
from .series import PREFIX


def observed_signals(
    experiment: Experiment, motion: Motion, states: Array, reading: Reading, measurements: Signals
) -> Signals:
    """Return the law's observables at every step.

    Args:
        experiment: Experiment that was run.
        motion: Motion as the law saw it.
        states: States of the law, shape (k, state.size).
        reading: Reading of the law.
        measurements: Measurements of the sensors at every step, by name.

    Raises:
        InvalidInputError: If the law fails, or returns something else than it declares.
    """
    fields = fields_of(motion)
    u: dict[str, Array] = {
        name: fields[name] for name in OF_EVERY_MOTION if name != "network_velocity"
    }
    if experiment.law_task.objectives:
        # What the law sees by these names are coordinates.
        seen = [name for name in u if name not in names_of("joints")]
        u |= _further(experiment, motion, seen)
    u |= measurements
    if motion.pressing is not None:
        u["normal_force_desired"] = motion.pressing.desired[:, np.newaxis]
    u |= _further(experiment, motion, [name for name in reading.inputs.parts if name not in u])
    constants = {name: _read_only(values) for name, values in u.items()}
    return observables_of(reading, _read_only(motion.time), _read_only(states), constants)


def _read_only(values: Array) -> Array:
    view = values.view()
    view.setflags(write=False)
    return view


def _further(experiment: Experiment, motion: Motion, names: Iterable[str]) -> Signals:
    """Return the named signals that follow from posture, velocity and time, at every step."""
    normal = None if experiment.contact is None else experiment.contact.surface.believed_normal_W
    able = {*names_of("kinematics", "dynamics", "path")}
    able |= set() if normal is None else {"normal_WE"}
    further = [name for name in names if name in able]
    if not further:
        return {}
    view = View(
        experiment.law_task,
        experiment.arm.kinematics(),
        DelayedPath(experiment.desired),
        experiment.arm.believed_dynamics(),
        normal,
    )
    return _at_steps(experiment, view, further, motion.time, motion.position, motion.velocity)


def _at_steps(
    experiment: Experiment,
    view: View,
    names: Iterable[str],
    times: Array,
    position: Array,
    velocity: Array | None = None,
) -> Signals:
    """Return signals of the experiment's arm at every step; see `at_steps`."""
    return at_steps(view, names, times, position, velocity, **view.task.lengths)


def seen_motion(experiment: Experiment, steps: Steps, loop: Loop, motion: Motion) -> Motion:
    """Return the motion as the law saw it, which differs if the path is followed with a delay."""
    if experiment.path_delay == 0.0:
        return motion
    if experiment.feedback == "unfiltered":
        return motion_of(experiment, steps, loop, virtual=True)
    view = View(experiment.task, path=DelayedPath(experiment.desired))
    _, velocity, _ = POSITION_OF_PATH
    signals = _at_steps(experiment, view, [velocity], steps.time, motion.position)
    return replace(motion, v_WE_desired=signals[velocity])


def measured_signals(steps: Steps, loop: Loop) -> Signals:
    """Return the measurements of joints and end effector at every step, by name."""
    signals = {name: steps.series(f"measured_{name}") for name in loop.measured}
    if "R_WE" in signals:
        signals["R_WE"] = signals["R_WE"].reshape(-1, 3, 3)
    return signals


def sensed_motion(
    experiment: Experiment, times: Array, measurements: Signals, motion: Motion
) -> Motion:
    """Return the motion with the measured joints; without sensors, the motion itself.

    Args:
        experiment: Experiment that was run.
        times: Time of every step, shape (k,) [s].
        measurements: Measurements of the sensors at every step, by name.
        motion: The motion of the true arm.
    """
    if "position" not in measurements:
        return motion
    position, velocity = measurements["position"], measurements["velocity"]
    p_WE, J, _ = _task_motion(experiment, position, times)
    v_WE = _end_effector_velocity(J, velocity, p_WE)
    J = _jacobian_of_law(experiment, position, times, J)
    return replace(motion, position=position, velocity=velocity, p_WE=p_WE, v_WE=v_WE, J=J)


def motion_of(
    experiment: Experiment,
    steps: Steps,
    loop: Loop,
    *,
    until: float | None = None,
    virtual: bool = False,
) -> Motion:
    """Return the motion, with path and kinematics evaluated for the recorded steps.

    Evaluating their ports during the run would cost more than the law itself.

    Args:
        experiment: Experiment that was run.
        steps: Recorded steps.
        loop: Systems of the loop.
        until: Time at which the run is going to end [s]; None if these steps end it.
        virtual: Whether to return the virtual arm's motion, which has no delay to the path.
    """
    prefix, delay = ("virtual_", 0.0) if virtual else ("", experiment.path_delay)
    position, velocity = (steps.series(prefix + name) for name in ("position", "velocity"))
    state, layout = steps.series("state"), loop.controller.reading.state
    p_WE, J, orientation = _task_motion(experiment, position, steps.time - delay)
    v_WE = _end_effector_velocity(J, velocity, p_WE)
    p_WE_desired, v_WE_desired = _desired_motion(experiment, steps, delay)
    if until is None and steps.time.size:
        until = float(steps.time[-1])
    tick, network_tick = ticks_of(experiment, loop)
    position_commanded = None
    if loop.arm.has_motors and not virtual:
        position_commanded = steps.series("position_commanded")
    of_motion, of_features = _observe(experiment, EvaluationSteps(steps, position, J, virtual))
    motion = Motion(
        time=steps.time,
        position=position,
        velocity=velocity,
        network_velocity=layout.part(state, "v"),
        p_WE=p_WE,
        v_WE=v_WE,
        p_WE_desired=p_WE_desired,
        v_WE_desired=v_WE_desired,
        J=_jacobian_of_law(experiment, position, steps.time, J),
        J_hat=layout.part(state, "J_hat") if "J_hat" in layout else None,
        target=_target(experiment, steps.time),
        orientation_error=orientation,
        returns=experiment.desired.closed,
        lap_start=None if until is None else experiment.last_lap(until, delay),
        until=until,
        position_commanded=position_commanded,
        p_WE_commanded=None
        if position_commanded is None
        else _place(experiment, position_commanded),
        tick=tick,
        network_tick=network_tick,
        origin=steps.origin,
        features=of_features,
    )
    return replace(motion, **of_motion)


def _observe(experiment: Experiment, run: EvaluationSteps) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what features observe of steps: fields of a motion, and the rest."""
    entries: dict[str, Any] = {}
    for feature in experiment.document.features:
        entries |= feature.observe(experiment, run)
    fields = field_names(Motion)
    rest = {name: value for name, value in entries.items() if name not in fields}
    return {name: value for name, value in entries.items() if name in fields}, rest


def _target(experiment: Experiment, times: Array) -> Array | None:
    """Return the target posture, shape (n,), or the newest of targets at each time, (k, n)."""
    if experiment.targets is None:
        return experiment.target
    return experiment.targets.goals(times, experiment.start)


def _task_motion(
    experiment: Experiment, position: Array, times: Array
) -> tuple[Array, Array, Array | None]:
    """Return position, Jacobian and angle to the desired orientation, if any, at every step.

    Args:
        experiment: Experiment that was run.
        position: Joint positions at every step, shape (k, n) [rad].
        times: Time along the path at every step, shape (k,) [s].
    """
    names = ["p_WE", "J"]
    if experiment.holds_orientation:
        names += ["R_WE", DESIRED_ORIENTATION]
    kinematics, path = experiment.arm.kinematics(), DelayedPath(experiment.desired)
    view = View(experiment.task, kinematics, path)
    p_WE, J, *orientations = _at_steps(experiment, view, names, times, position).values()
    if not orientations:
        return p_WE, J, None
    off = [
        np.linalg.norm(rotation_error(R, R_desired))
        for R, R_desired in zip(*orientations, strict=True)
    ]
    return p_WE, J, np.array(off, dtype=float)


def _jacobian_of_law(experiment: Experiment, position: Array, times: Array, J: Array) -> Array:
    """Return the Jacobian of what the law is asked for: J, or that of objectives."""
    task = experiment.law_task
    if not task.objectives:
        return J
    view = View(task, experiment.arm.kinematics())
    return _at_steps(experiment, view, ["J"], times, position)["J"]


def _end_effector_velocity(J: Array, velocity: Array, p_WE: Array) -> Array:
    """Return the velocity along the axes of ``p_WE``, whose rows of ``J`` are the last."""
    return np.einsum("kmn,kn->km", J[:, -p_WE.shape[1] :], velocity)


def _place(experiment: Experiment, position: Array) -> Array:
    """Return the position of the end effector, on the task's axes, at each posture."""
    axes, kinematics = list(experiment.task.axes), experiment.arm.kinematics()
    return np.array([kinematics.p_WE(q)[axes] for q in position])


def _desired_motion(experiment: Experiment, steps: Steps, delay: float) -> tuple[Array, Array]:
    """Return desired position and velocity at every step, of a path followed with a delay."""
    view = View(experiment.task, path=DelayedPath(experiment.desired))
    times, position = steps.time - delay, steps.series("position")
    p_WE, v_WE = _at_steps(experiment, view, POSITION_OF_PATH[:2], times, position).values()
    if isinstance(experiment.desired, LedPath):
        return _leading_path(experiment, experiment.desired, steps), v_WE
    return p_WE, v_WE


def _leading_path(experiment: Experiment, path: LedPath, steps: Steps) -> Array:
    """Return the desired position beside where the leading arm is, at every step."""
    arm = path.arm.kinematics()
    points = [arm.p_WE(q) for q in steps.series(f"{PREFIX}position")]
    axes, times = list(experiment.task.axes), steps.time.tolist()
    return np.array([path.beside(t, p)[axes] for t, p in zip(times, points, strict=True)])


def ticks_of(experiment: Experiment, loop: Loop) -> tuple[float | None, float | None]:
    """Return the times for which arm and law hold their velocities [s]; None if not held."""
    document, tick = experiment.document, loop.arm.tick
    noise, period = document.joint_noise, document.period
    if tick is not None:
        return tick, period
    if noise is None or not noise.moves_arm or document.filter is not None:
        return period, period
    return noise.hold if period is None else min(noise.hold, period), period
