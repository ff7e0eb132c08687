"""All metrics of a run, or of runs side by side, taken from their parts as they come.

- Recording of a simulation at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort, TriggerType
from pydrake.systems.primitives import LogVectorOutput

from ..arrays.algebra import AnyArray
from ..inputs.fields import Array
from ..inputs.processes import signals_held
from ..laws.law import Layout
from .metric import State, Values, Yardsticks
from .metric_groups import (
    BoundMetrics,
    DisplacementMetrics,
    DriftMetrics,
    FollowingMetrics,
    GapMetrics,
    Group,
    HeldJerkMetrics,
    HigherMetrics,
    MetricValues,
    NetworkMetrics,
    RestMetrics,
)
from .metrics import METRICS
from .motion import Motion


class RunMetrics:
    """The metrics of a run, or of robots that run side by side.

    Errors, drift and Jacobian errors are taken over the window; velocities, accelerations, margins
    and violations always over the whole run.

    Args:
        against: What motions are measured against.

    Attributes:
        gap: The time at which contact was lost.
        following: The largest distance of the arm from its command.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._against = against
        self.gap = GapMetrics()
        self.following = FollowingMetrics()
        self._groups: tuple[Group, ...] = (
            DriftMetrics(),
            BoundMetrics(against),
            NetworkMetrics(),
            HigherMetrics(against),
            HeldJerkMetrics(against),
            DisplacementMetrics(),
            RestMetrics(),
            self.following,
            self.gap,
        )
        self._taken = tuple(metric for metric in METRICS if metric.of is not None)
        self._gathered: dict[str, State] = {}

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.time.size == 0:
            return
        # Squares may overflow in a run that diverged; metrics that are not finite are left out.
        with np.errstate(all="ignore"):
            for group in self._groups:
                group.add(motion)
            everywhere = motion.steps_within(None)
            inside = motion.steps_within(self._against.window)
            # Metrics may share their values.
            computed_bounds: dict[Values, AnyArray | None] = {}
            for metric in self._taken:
                steps = inside if metric.over == "window" else everywhere
                if steps.start == steps.stop or metric.of is None:
                    continue
                if metric.of not in computed_bounds:
                    computed_bounds[metric.of] = metric.of(motion, self._against)
                if (values := computed_bounds[metric.of]) is None:
                    continue
                # Values between steps, e.g. accelerations, have no row for the first step.
                lead = motion.time.size - len(values)
                values = values[max(0, steps.start - lead) : max(0, steps.stop - lead)]
                if len(values):
                    state = self._gathered.get(metric.name, metric.by.start)
                    times = motion.time[steps.stop - len(values) : steps.stop]
                    self._gathered[metric.name] = metric.by.add(state, values, times)

    def metrics(self, *, of_law: bool = True) -> MetricValues:
        """Return the metrics, by name, each of shape (...); not finite where there is none.

        Args:
            of_law: Whether those that follow from the law's observables are among them.
        """
        with np.errstate(all="ignore"):
            values: MetricValues = {}
            for group in self._groups:
                if of_law or not isinstance(group, DisplacementMetrics):
                    values |= group.metrics()
            for metric in self._taken:
                if metric.name not in self._gathered or (metric.of_law and not of_law):
                    continue
                value = np.asarray(metric.by.value(self._gathered[metric.name]))
                if metric.name in values:
                    # A loss of contact that the law detects counts, even if some contact is left.
                    value = np.where(np.isfinite(value), value, values[metric.name])
                values[metric.name] = value
        return values


def of_one_run(metrics: MetricValues) -> dict[str, float]:
    """Return the metrics of one run that apply, by name, in the order of `METRICS`."""
    return {
        metric.name: float(metrics[metric.name])
        for metric in METRICS
        if metric.name in metrics and np.isfinite(metrics[metric.name])
    }


#: Number of steps that are evaluated together, unless a tick has more: about 100 MB.
PART = 2**16


@dataclass(frozen=True)
class Steps:
    """Recorded steps, in arrays that the recorder's next step overwrites.

    Attributes:
        time: Times of all steps, shape (k,) [s].
        rows: What was recorded, shape (k, layout.size).
        layout: Where each port is in a row.
        origin: Time of the run's first step [s]; None if it is the first of these.
    """

    time: Array
    rows: Array
    layout: Layout
    origin: float | None = None

    def series(self, name: str) -> Array:
        """Return the values of one port at every step, shape (k, size)."""
        return self.layout.part(self.rows, name)

    def until(self, last: int) -> Steps:
        """Return the steps up to and including the one with this number."""
        return Steps(self.time[: last + 1], self.rows[: last + 1], self.layout, self.origin)


#: Evaluates a part of the run and returns the number of the step with which the next part begins; 0
#: if no part ends within these steps.
Take = Callable[[Steps], int]


class Recorder:
    """Recorder of a diagram's output ports at every accepted step.

    Drake's own logs record each step when it is published, which does not change the steps. Values
    at time t are those just before the updates at t: velocities are those of the step that ended
    there.

    Args:
        builder: Builder of the diagram, which the logs are added to.
        ports: Output ports in ``builder`` to record, by name.
    """

    def __init__(self, builder: DiagramBuilder, ports: Mapping[str, OutputPort]) -> None:
        self._layout = Layout(**{name: (port.size(),) for name, port in ports.items()})
        each_step = {TriggerType.kPerStep}
        self._sinks = [LogVectorOutput(port, builder, each_step) for port in ports.values()]

    def watch(self, simulator: Simulator, take: Take | None = None, part: int = PART) -> None:
        """Begin to record a simulator of the diagram, as its monitor.

        Args:
            simulator: Simulator of the diagram, not yet initialized.
            take: Called with the steps of each part; without it, all steps are kept.
            part: Number of steps of a part.
        """
        root = simulator.get_mutable_context()
        self._logs = [sink.FindMutableLog(root) for sink in self._sinks]
        self._take, self._due = take, part
        self._origin: float | None = None
        self._count = self._dropped = 0
        simulator.set_monitor(self)

    def reserve(self, count: int) -> None:
        """Make room for so many steps, so that no step has to wait for it."""
        for log in self._logs:
            log.Reserve(count)

    def __call__(self, context: Context) -> None:
        """Count a step that was logged; if a part is due, evaluate the steps before it first."""
        self._step()

    def _step(self) -> None:
        if self._count == self._due:
            self._make_room()
        self._count += 1

    @property
    def steps(self) -> Steps:
        """The steps not taken yet; they begin with the last step of the part taken before."""
        # A port that raises an error ends the run, after some ports have been logged once more.
        count = min(log.num_samples() for log in self._logs)
        rows = np.hstack([log.data().T[:count] for log in self._logs])
        times = self._logs[0].sample_times()[:count]
        return Steps(times, rows, self._layout, self._origin)

    def since(self, number: int) -> tuple[Array, Array]:
        """Return times, shape (k,), and rows, shape (k, layout.size), from a step of the run on.

        Args:
            number: Number of the step in the whole run; it must not have been dropped.
        """
        steps = self.steps
        return steps.time[number - self._dropped :], steps.rows[number - self._dropped :]

    def replay(self, times: Array, rows: Array) -> None:
        """Record the steps of a run anew, in place of what was recorded since the watch began.

        Parts are evaluated where they were in that run.

        Args:
            times: Times, shape (k,) [s].
            rows: What `since` returned of them, shape (k, layout.size).
        """
        for log in self._logs:
            log.Clear()
        ports = [self._layout.part(rows, name) for name in self._layout.parts]
        for number, time in enumerate(times.tolist()):
            for log, values in zip(self._logs, ports, strict=True):
                log.AddData(time, values[number])
            self._step()

    def take(self) -> Steps:
        """Return the steps since the last call, of which only the last is kept for the next one.

        They begin with the last step of the call before, and what is returned does not change.
        """
        with signals_held():
            steps = self.steps
            if steps.time.size:
                self._drop(steps, steps.time.size - 1)
            return Steps(steps.time.copy(), steps.rows, steps.layout, steps.origin)

    def _make_room(self) -> None:
        # An interrupt in this block could make steps count twice or not at all.
        with signals_held():
            steps = self.steps
            room = 0 if self._take is None else self._take(steps.until(self._count - 1))
            if room:
                self._drop(steps, room)
            else:
                self._due *= 2

    def _drop(self, steps: Steps, first: int) -> None:
        """Drop the steps before the one with this number."""
        times = steps.time.tolist()
        if self._origin is None:
            self._origin = times[0]
        for log, name in zip(self._logs, self._layout.parts, strict=True):
            log.Clear()
            for time, value in zip(times[first:], steps.series(name)[first:], strict=True):
                log.AddData(time, value)
        self._count -= first
        self._dropped += first
