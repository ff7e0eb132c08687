"""Evaluation of a run, part by part while it runs: from recorded steps to series and metrics.

- Warnings after a run: what its motion says of the contact and of the motors.
- The motion of a run, or of a part of it, computed from the recorded joints.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.systems.framework import Diagram

from ..diagrams import Loop, wiring_graph
from ..errors import InvalidInputError
from ..experiment import Experiment, Forecast
from ..features.feature import EvaluationSteps
from ..features.pairs import refusal
from ..inputs.fields import Array
from ..inputs.messages import field_names, fields_of
from ..laws import Reading, Signals
from ..laws.checks import observables_of, warnings_of
from ..laws.parts.bounded_velocity import limits_within_bounds
from ..measures import (
    FollowingMetrics,
    Motion,
    RunMetrics,
    Steps,
    Yardsticks,
    last_end,
    of_one_run,
    violation_metric,
)
from ..measures.metric_groups import LOOKING
from ..paths import LedPath
from ..robot.limits import LIMIT_UNITS
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
from ..systems import Body
from .result import Result
from .series import PREFIX, StoredSeries, of_second


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
    told = observables_of(reading, _read_only(motion.time), _read_only(states), constants)
    if experiment.law.commands_torque and "torque_share" in told:
        # Of the limits that the arm has, whichever the law was told.
        share = np.abs(reading.state.part(states, "torque") / experiment.arm.effort)
        told = {**told, "torque_share": share.max(axis=-1, keepdims=True)}
    return told


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
    return _at_steps(view, further, motion.time, motion.position, motion.velocity)


def _at_steps(
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
    signals = _at_steps(view, [velocity], steps.time, motion.position)
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
    if loop.arm.has_motors and loop.arm.follows_command and not virtual:
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
    p_WE, J, *orientations = _at_steps(view, names, times, position).values()
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
    return _at_steps(view, ["J"], times, position)["J"]


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
    p_WE, v_WE = _at_steps(view, POSITION_OF_PATH[:2], times, position).values()
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


# Distance from the command beyond which an arm is said not to follow it: of the end effector [m]
# and of a joint [rad].
_FAR, _FAR_JOINT = 5e-3, 0.02
# Speed of joints to and fro, and in the end, from which on they do not rest [rad/s].
_RESTLESS = 0.01
# Excess of a limit that is no rounding error [rad, rad/s and so on].
_BEYOND = 1e-6


def standing(forecasts: Sequence[Forecast], metrics: Mapping[str, float]) -> list[str]:
    """Return the forecasts that a run with these metrics has not disproved.

    That a path asks for more than a limit is estimated from the least joint velocities. A law with
    others may follow the path within the limit, without having cut what it demanded.

    Args:
        forecasts: Warnings from before the run.
        metrics: Metrics of the run.
    """
    cut = metrics.get("saturated_fraction", 0.0) > 0.0
    excess = {name: metrics.get(violation_metric(name), np.inf) for name in LIMIT_UNITS if not cut}
    return [each.text for each in forecasts if excess.get(each.limit or "", np.inf) > 0.0]


def hard_limits(experiment: Experiment) -> tuple[str, ...]:
    """Return the limits that count in any run, whether or not its law keeps them.

    No arm can exceed those of position and velocity. Nor can a mobile base that of acceleration: an
    arm's motors lag behind a velocity that jumps, and wheels slip.
    """
    return ("position", "velocity", *(() if experiment.arm.base is None else ("acceleration",)))


def limit_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return warnings about limits that the arm exceeded.

    Those that are kept by construction have a verdict of their own. Of others `hard_limits` count,
    and those that the law keeps of its command. Of what the path itself asks for too much there was
    a warning before the run.
    """
    caveats, guarantees = [], experiment.guarantees
    names = {*hard_limits(experiment), *guarantees.command_only}
    units = sorted({*experiment.arm.units}, reverse=True)
    for name, unit in LIMIT_UNITS.items():
        # The metric is the largest of all joints, of which some may slide.
        unit = " or ".join(unit.replace("rad", each) for each in units)
        excess = metrics.get(violation_metric(name), 0.0)
        if name in names and excess > _BEYOND and name not in guarantees.arm.limits:
            caveats.append(
                f"limits: the arm exceeds a limit of {name} by {excess:.3g} {unit}; "
                f"{_why(name, experiment)}"
            )
    if (ratio := metrics.get("torque_ratio_max", 0.0)) > 1.0 + _BEYOND:
        caveats.append(
            f"limits: a torque is commanded of {ratio:.3g} times its joint's limit; the law was "
            "told of larger limits than the arm has, or of none"
        )
    return caveats


def _why(name: str, experiment: Experiment) -> str:
    """Return why a limit is not kept."""
    if name not in experiment.guarantees.command.limits:
        remedy = experiment.law.limits_remedy or _by_safety(name, experiment)
        return f"this law does not keep it{remedy and '; ' + remedy}"
    if experiment.level.has_motors:
        return "the law keeps it of the command, and motors follow that with errors"
    return "noise, a filter or errors of measurement lie between this law and the arm"


def _by_safety(name: str, experiment: Experiment) -> str:
    """Return whether safety around the law would keep a limit, as advice; empty if not."""
    document = experiment.document
    limits_kept = limits_within_bounds(experiment.limits)
    if document.period is None or document.safety is not None or name not in limits_kept:
        return ""
    beside = replace(experiment.combination, safety=True)
    return "" if refusal(beside) else "safety: {bounds: true} does"


def rest_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return a warning if joints keep going to and fro although their target rests.

    Joints that move in one direction may be on their way to a posture, without moving the end
    effector; they are not counted, nor are those that make way for obstacles that move, or that a
    detour may still lead: another warning says that the arm is not back on its path.
    """
    swing = metrics.get("rest_swing_max_rad_s", 0.0)
    last = metrics.get("rest_velocity_max_rad_s", 0.0)
    makes_way = "distance_moving_min_m" in metrics
    is_led = min(metrics.get(each, 0.0) for each in ("detour_time_s", "stuck_in_the_end_s")) > 0.0
    if min(swing, last) <= _RESTLESS or makes_way or is_led or _turns_on(experiment):
        return []
    slower = "; or raise limits.jerk" if experiment.limits.jerk is not None else ""
    return [
        f"rest: a joint keeps going to and fro by {swing:.3g} rad/s, in the end with {last:.3g} "
        "rad/s rms, while the target rests; if the target is out of reach, bring it into reach; if "
        f"not, lower the gain of the feedback{slower}"
    ]


def _turns_on(experiment: Experiment) -> bool:
    """Return whether the desired orientation still moves when the run ends."""
    if not experiment.holds_orientation:
        return False
    end = experiment.document.duration
    rates = [experiment.desired.orientation(t)[1] for t in (end - LOOKING, end)]
    return bool(np.abs(rates).max() > _BEYOND)


def motor_caveats(
    arm: Body, following: FollowingMetrics, metrics: Mapping[str, float]
) -> list[str]:
    """Return a warning if the arm is far from what its motors are told: 5 mm, or 0.02 rad.

    The measure is the distance from the command, not from the path: where motors are too weak for
    the feedback of a law that measures the arm, the command itself leaves the path. It is absolute
    because motors with the default gains lag by tenths of a millimetre, whatever the law's error.

    Args:
        arm: Body that was moved.
        following: Where it is farthest from its command.
        metrics: Metrics of the run.
    """
    away = metrics.get("command_error_max_m")
    if following.worst is None or away is None:
        return []
    off, joint, time = following.worst
    if not (away > _FAR or off > _FAR_JOINT):
        return []
    return [
        f"plant: the arm is far from its command: {arm.arm.joints[joint]} by up to "
        f"{off:.3g} rad, at t = {time:.4g} s, and the end effector by up to "
        f"{away:.3g} m; {arm.remedy(joint, off)}"
    ]


class Evaluation:
    """What a run comes to, taken from its steps as they come.

    What is kept of steps that were taken are the stored samples, and two numbers for each step in
    the window if the law learns a Jacobian, which has medians.

    Args:
        experiment: Experiment that runs.
        loop: Systems of the loop.
        period: Time between two stored samples [s]; infinite to store the last step alone.

    Attributes:
        wall_time: Time that `take` has taken [s].
    """

    wall_time: float = 0.0

    def __init__(self, experiment: Experiment, loop: Loop, period: float) -> None:
        document = experiment.document
        self._experiment, self._loop = experiment, loop
        self._metrics = RunMetrics(
            Yardsticks.of(experiment.limits, document.window, document.settling_tolerance_m)
        )
        self._series = StoredSeries(period, document.duration)
        # An error in the law's observables, of which nothing is told then.
        self._fault: InvalidInputError | None = None

    def take(self, steps: Steps) -> int:
        """Evaluate steps up to the last at which ticks end; return its number, 0 without one."""
        began = time.perf_counter()
        origin = float(steps.time[0]) if steps.origin is None else steps.origin
        end = last_end(steps.time, ticks_of(self._experiment, self._loop), origin)
        if end:
            self._add(steps.until(end), until=self._experiment.document.duration)
        self.wall_time += time.perf_counter() - began
        return end

    def finish(
        self, steps: Steps, forecasts: Sequence[Forecast], diagram: Diagram
    ) -> tuple[Result, InvalidInputError | None]:
        """Return the result of a run, complete or not, and an error in what the law says of it.

        With such an error the result lacks the law's observables or caveats.

        Args:
            steps: The last steps of the run.
            forecasts: Warnings about the path from before the run.
            diagram: Simulated diagram.
        """
        self._add(steps)
        reading, fault = self._loop.controller.reading, self._fault
        metrics = of_one_run(self._metrics.metrics(of_law=fault is None))
        if (delay := self._experiment.path_delay) > 0.0:
            metrics["path_delay_s"] = delay
        series = self._series.take()
        if fault is not None:
            series = {name: series[name] for name in series if name not in reading.observables}
        caveats: list[str] = []
        try:
            caveats = warnings_of(reading, "caveats", lambda: reading.caveats(metrics))
        except InvalidInputError as error:
            fault = fault or error
        result = Result(
            experiment=self._experiment,
            time=series.pop("time"),
            series=series,
            metrics=metrics,
            warnings=[
                *self._experiment.warnings,
                *standing(forecasts, metrics),
                *limit_caveats(self._experiment, metrics),
                *caveats,
                *(
                    caveat
                    for each in self._experiment.document.features
                    for caveat in each.caveats(self._experiment, metrics, self._metrics)
                ),
                *motor_caveats(self._loop.arm, self._metrics.following, metrics),
                *rest_caveats(self._experiment, metrics),
            ],
            graphviz=wiring_graph(diagram),
        )
        return result, fault

    def _add(self, steps: Steps, until: float | None = None) -> None:
        """Add a part of the run; ``until`` is given if more are to come."""
        experiment, loop = self._experiment, self._loop
        motion = motion_of(experiment, steps, loop, until=until)
        motion_seen = seen_motion(experiment, steps, loop, motion)
        measurements = measured_signals(steps, loop)
        observables = self._observe(steps, motion_seen, measurements)
        virtual = motion_seen if experiment.feedback == "unfiltered" else None
        motion = replace(motion, observed=observables, virtual=virtual)
        self._metrics.add(motion)
        fields = fields_of(motion)
        series: dict[str, Array] = {name: fields[name] for name in OF_EVERY_MOTION}
        if motion.target is not None:
            series["joint_error"] = motion.position - motion.target
        if motion.orientation_error is not None:
            series["orientation_error"] = motion.orientation_error
        for feature in experiment.document.features:
            series |= feature.series(motion, steps)
        series |= motion.features
        series |= {f"{name}_measured": values for name, values in measurements.items()}
        states, state = steps.series("state"), loop.controller.reading.state
        # The law's velocity has a series of its own.
        series |= {name: state.part(states, name) for name in state.parts if name != "v"}
        changes = {
            "acceleration": motion.joint_acceleration,
            "network_acceleration": motion.network_acceleration,
        }
        self._series.add(steps.time, {**series, **observables}, changes, last=until is None)

    def _observe(self, steps: Steps, motion_seen: Motion, measurements: Signals) -> Signals:
        """Return the law's observables at every step; none after an error in them."""
        if self._fault is not None:
            return {}
        try:
            motion_measured = sensed_motion(self._experiment, steps.time, measurements, motion_seen)
            reading, states = self._loop.controller.reading, steps.series("state")
            return observed_signals(
                self._experiment, motion_measured, states, reading, measurements
            )
        except InvalidInputError as error:
            self._fault = error
            return {}


class Evaluations:
    """What a run comes to for each of its arms; see `Evaluation`.

    Args:
        experiment: Experiment that runs.
        loops: Systems of each arm's loop.
        period: Time between two stored samples [s]; infinite to store the last step alone.
    """

    def __init__(self, experiment: Experiment, loops: Sequence[Loop], period: float) -> None:
        self._first = Evaluation(experiment, loops[0], period)
        second = experiment.second
        self._second = None if second is None else Evaluation(second, loops[1], period)

    @property
    def wall_time(self) -> float:
        """Time that `take` has taken [s]."""
        return self._first.wall_time + (0.0 if self._second is None else self._second.wall_time)

    def take(self, steps: Steps) -> int:
        """See `Evaluation.take`."""
        if self._second is not None:
            self._second.take(of_second(steps))
        return self._first.take(steps)

    def finish(
        self, steps: Steps, metrics: Sequence[Sequence[Forecast]], diagram: Diagram
    ) -> tuple[Result, InvalidInputError | None]:
        """Return the result of a run, with that of its second arm; see `Evaluation.finish`.

        Warnings about the path from before the run are of each arm.
        """
        result, fault = self._first.finish(steps, metrics[0], diagram)
        if self._second is None:
            return result, fault
        second, other = self._second.finish(of_second(steps), metrics[1], diagram)
        return replace(result, second=second), fault or other
