"""Evaluation of a run, part by part while it runs: from recorded steps to series and metrics."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from pydrake.systems.framework import Diagram

from ..diagrams import Loop, wiring_graph
from ..errors import InvalidInputError
from ..experiment import Experiment, Forecast
from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array
from ..laws import Signals
from ..laws.checks import warnings_of
from ..measures import Motion, RunMetrics, Steps, Yardsticks, last_end, of_one_run
from ..signals import OF_EVERY_MOTION
from .beside import of_second
from .caveats import (
    contact_caveats,
    distance_caveats,
    image_caveats,
    limit_caveats,
    motor_caveats,
    rest_caveats,
    standing,
)
from .motion import (
    measured_signals,
    motion_of,
    observed_signals,
    seen_motion,
    sensed_motion,
    ticks_of,
)
from .result import Result
from .stored import StoredSeries


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
        self, steps: Steps, found: Sequence[Forecast], diagram: Diagram
    ) -> tuple[Result, InvalidInputError | None]:
        """Return the result of a run, complete or not, and an error in what the law says of it.

        With such an error the result lacks the law's observables or caveats.

        Args:
            steps: The last steps of the run.
            found: Warnings about the path from before the run.
            diagram: Simulated diagram.
        """
        self._add(steps)
        reading, fault = self._loop.controller.reading, self._fault
        metrics = of_one_run(self._metrics.found(of_law=fault is None))
        if (delay := self._experiment.path_delay) > 0.0:
            metrics["path_delay_s"] = delay
        series = self._series.taken()
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
                *standing(found, metrics),
                *limit_caveats(self._experiment, metrics),
                *caveats,
                *distance_caveats(self._experiment, metrics),
                *image_caveats(self._experiment, metrics),
                *contact_caveats(self._metrics.gap, metrics),
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
        seen = seen_motion(experiment, steps, loop, motion)
        measured = measured_signals(steps, loop)
        observed = self._observed(steps, seen, measured)
        virtual = seen if experiment.feedback == "unfiltered" else None
        motion = replace(motion, observed=observed, virtual=virtual)
        self._metrics.add(motion)
        known = fields_of(motion)
        series: dict[str, Array] = {name: known[name] for name in OF_EVERY_MOTION}
        series |= _further_series(motion, steps)
        series |= {f"{name}_measured": values for name, values in measured.items()}
        states, state = steps.series("state"), loop.controller.reading.state
        # The law's velocity has a series of its own.
        series |= {name: state.part(states, name) for name in state.parts if name != "v"}
        changes = {
            "acceleration": motion.joint_acceleration,
            "network_acceleration": motion.network_acceleration,
        }
        self._series.add(steps.time, {**series, **observed}, changes, last=until is None)

    def _observed(self, steps: Steps, seen: Motion, measured: Signals) -> Signals:
        """Return the law's observables at every step; none after an error in them."""
        if self._fault is not None:
            return {}
        try:
            sensed = sensed_motion(self._experiment, steps.time, measured, seen)
            reading, states = self._loop.controller.reading, steps.series("state")
            return observed_signals(self._experiment, sensed, states, reading, measured)
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
        self, steps: Steps, found: Sequence[Sequence[Forecast]], diagram: Diagram
    ) -> tuple[Result, InvalidInputError | None]:
        """Return the result of a run, with that of its second arm; see `Evaluation.finish`.

        Warnings about the path from before the run are of each arm.
        """
        result, fault = self._first.finish(steps, found[0], diagram)
        if self._second is None:
            return result, fault
        second, other = self._second.finish(of_second(steps), found[1], diagram)
        return replace(result, second=second), fault or other


def _further_series(motion: Motion, steps: Steps) -> dict[str, Array]:
    """Return the series of targets, an orientation, a contact, obstacles and pixels, if any."""
    series = {}
    if motion.distance is not None:
        series["distance"] = motion.distance
    if motion.target is not None:
        series["joint_error"] = motion.position - motion.target
    if motion.pressing is not None:
        series["normal_force"] = motion.pressing.force
        series["normal_force_desired"] = motion.pressing.desired
        series["normal_force_measured"] = steps.series("normal_force")[:, 0]
        series["contact_force"] = steps.series("contact_force")
    if motion.image is not None:
        series["pixels"] = motion.image.pixels
        series["pixels_desired"] = motion.image.desired
    if motion.orientation_error is not None:
        series["orientation_error"] = motion.orientation_error
    return series
