"""Evaluation of a run: from recorded steps to series and metrics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram

from ..diagrams import Loop
from ..errors import InvalidInputError
from ..experiment import Experiment, Forecast
from ..inputs.fields import Array
from ..laws import Reading, Signals
from ..laws.checks import caveats_of
from ..measures import Motion, Recorder, law_metrics, motion_metrics
from .caveats import contact_caveats, limit_caveats, motor_caveats, standing
from .motion import motion_of, observed_signals, seen_motion, sensed_motion
from .result import Result


def evaluate(
    experiment: Experiment,
    recorder: Recorder,
    found: Sequence[Forecast],
    diagram: Diagram,
    loop: Loop,
) -> tuple[Result, InvalidInputError | None]:
    """Return the result of a run, complete or not, and an error in what the law says of it.

    With such an error the result lacks the law's observables or caveats.

    Args:
        experiment: Experiment that was run.
        recorder: Recorder of the run.
        found: Warnings about the path from before the run.
        diagram: Simulated diagram.
        loop: Systems of the loop.
    """
    reading = loop.controller.reading
    motion = motion_of(experiment, recorder, loop)
    seen = seen_motion(experiment, recorder, loop, motion)
    fault: InvalidInputError | None = None
    observed: Signals = {}
    caveats: list[str] = []
    try:
        sensed = sensed_motion(experiment, recorder, loop, seen)
        observed = observed_signals(experiment, sensed, recorder.series("state"), reading)
    except InvalidInputError as error:
        fault = error
    metrics = _metrics(experiment, motion, seen, observed)
    try:
        caveats = caveats_of(reading, metrics)
    except InvalidInputError as error:
        fault = fault or error
    at = _samples(motion.time, experiment.document.log_period)
    series = _series(motion, at) | _contact_series(motion, recorder, at)
    if loop.joint_sensor is not None:
        for name in ("position", "velocity"):
            series[f"{name}_measured"] = recorder.series(f"measured_{name}")[at]
    series |= _state_series(recorder.series("state")[at], reading)
    result = Result(
        experiment=experiment,
        time=motion.time[at],
        series=series | {name: values[at] for name, values in observed.items()},
        metrics=metrics,
        warnings=[
            *experiment.warnings,
            *standing(found, metrics),
            *limit_caveats(experiment, metrics),
            *caveats,
            *contact_caveats(motion, metrics),
            *motor_caveats(loop.arm, motion),
        ],
        graphviz=diagram.GetGraphvizString(max_depth=1),
    )
    return result, fault


def _metrics(
    experiment: Experiment, motion: Motion, seen: Motion, observed: Signals
) -> dict[str, float]:
    document = experiment.document
    evaluation = (experiment.limits, document.window, document.settling_tolerance_m)
    metrics = motion_metrics(motion, *evaluation)
    if experiment.path_delay > 0.0:
        metrics["path_delay_s"] = experiment.path_delay
    if experiment.feedback == "unfiltered" and seen.J_hat is not None:
        # The law learns the Jacobian of the arm that it sees.
        metrics |= {
            name: value
            for name, value in motion_metrics(seen, *evaluation).items()
            if name.startswith("jacobian_")
        }
    return metrics | law_metrics(seen, observed)


def _series(motion: Motion, at: NDArray[np.intp]) -> dict[str, Array]:
    """Return the series that every run has, at the steps to keep."""
    series = {
        "position": motion.position[at],
        "velocity": motion.velocity[at],
        "network_velocity": motion.network_velocity[at],
        "p_WE": motion.p_WE[at],
        "v_WE": motion.v_WE[at],
        "p_WE_desired": motion.p_WE_desired[at],
        "v_WE_desired": motion.v_WE_desired[at],
        "J": motion.J[at],
    }
    for name, values in (
        ("acceleration", motion.joint_acceleration()),
        ("network_acceleration", motion.network_acceleration()),
    ):
        # Value of the step that ends at each sample; no step ends at the first one.
        series[name] = np.concatenate((np.zeros((1, values.shape[1])), values))[at]
        series[f"{name}_peak"] = _peaks(np.abs(values), at)
    return series


def _contact_series(motion: Motion, recorder: Recorder, at: NDArray[np.intp]) -> dict[str, Array]:
    """Return the series of a target posture, an orientation to hold and a contact, if any."""
    series = {}
    if motion.target is not None:
        series["joint_error"] = (motion.position - motion.target)[at]
    if motion.pressing is not None:
        series["normal_force"] = motion.pressing.force[at]
        series["normal_force_desired"] = motion.pressing.desired[at]
        series["normal_force_measured"] = recorder.series("normal_force")[at, 0]
        series["contact_force"] = recorder.series("contact_force")[at]
    if motion.orientation_error is not None:
        series["orientation_error"] = motion.orientation_error[at]
    return series


def _state_series(states: Array, reading: Reading) -> dict[str, Array]:
    """Return the parts of the law's state, except its velocity, which has its own series."""
    names = [name for name in reading.state.parts if name != "v"]
    return {name: reading.state.part(states, name) for name in names}


def _samples(time: Array, period: float) -> NDArray[np.intp]:
    """Return the numbers of the steps to keep, shape (j,): each period's first, and the last."""
    number = np.floor(time / period + 1e-6)
    kept = np.diff(number, prepend=-1.0) != 0
    # A last step that is only a rounding error past a kept one is not kept again.
    if time.size and time[-1] - time[kept][-1] > 1e-6 * period:
        kept[-1] = True
    return np.flatnonzero(kept)


def _peaks(values: Array, at: NDArray[np.intp]) -> Array:
    """Return the largest entry of the rows between successive ``at``, shape (len(at),)."""
    peaks = np.zeros(at.size)
    for k in range(1, at.size):
        peaks[k] = values[at[k - 1] : at[k]].max(initial=0.0)
    return peaks
