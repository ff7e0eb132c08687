"""Evaluation of a run, part by part while it runs: from recorded steps to series and metrics.

- Warnings after a run: what its motion says of the contact and of the motors.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydrake.systems.framework import Diagram

from ..diagrams import Loop, wiring_graph
from ..errors import InvalidInputError
from ..experiment import Experiment, Forecast
from ..features.pairs import refusal
from ..inputs.fields import Array
from ..inputs.messages import fields_of
from ..laws import Signals
from ..laws.checks import warnings_of
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
from ..robot.limits import LIMIT_UNITS
from ..signals import OF_EVERY_MOTION
from ..systems import Body
from .motion import (
    measured_signals,
    motion_of,
    observed_signals,
    seen_motion,
    sensed_motion,
    ticks_of,
)
from .result import Result
from .series import StoredSeries, of_second

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


def limit_caveats(experiment: Experiment, metrics: Mapping[str, float]) -> list[str]:
    """Return warnings about limits that the arm exceeded.

    Those that are kept by construction have a verdict of their own. Limits of position and velocity
    no arm can exceed; higher ones count if the law keeps them of its command. Of what the path
    itself asks for too much there was a warning before the run.
    """
    caveats, guarantees = [], experiment.guarantees
    names = {"position", "velocity", *guarantees.command_only}
    for name, unit in LIMIT_UNITS.items():
        excess = metrics.get(violation_metric(name), 0.0)
        if name in names and excess > _BEYOND and name not in guarantees.arm.limits:
            caveats.append(
                f"limits: the arm exceeds a limit of {name} by {excess:.3g} {unit}; "
                f"{_why(name, experiment)}"
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
    effector; they are not counted, nor are those that make way for obstacles that move.
    """
    swing = metrics.get("rest_swing_max_rad_s", 0.0)
    last = metrics.get("rest_velocity_max_rad_s", 0.0)
    makes_way = "distance_moving_min_m" in metrics
    if min(swing, last) <= _RESTLESS or makes_way or _turns_on(experiment):
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
