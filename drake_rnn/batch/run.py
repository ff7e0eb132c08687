"""Many runs at once.

- Robots that run side by side, in the order of updates of a diagram, without a diagram.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ..compiled.library import laws_step
from ..errors import InvalidInputError
from ..experiment import Arms, Experiment, ExperimentDocument, ExperimentSource, load_experiment
from ..features.obstacles import least_distances
from ..inputs.fields import Array, checked, each, flag, function, optional
from ..inputs.kinds import describe
from ..inputs.messages import require_several
from ..laws import Signals
from ..laws.call_checks import without_checks
from ..measures import METRICS, MetricValues, RunMetrics
from ..robot.load_arm import screws_of
from ..robot.screws import Screws
from .grouping import Robot, able_reading, blocks, contents
from .robots import Moving, Robots, Snapshot, motion_of, restart
from .surroundings import Schedule


@dataclass(frozen=True)
class Failure:
    """How a robot's run ended early.

    Attributes:
        time: When [s].
        reason: Why.
    """

    time: float
    reason: str


class Block:
    """Robots whose laws differ in numbers alone.

    A robot whose state is no longer finite has failed. Its metrics until then are kept, and the
    robot is restarted, so that its numbers do not disturb the others.

    Args:
        robots: The robots.
        records: Whether to keep the joint positions of all steps.
        compiled: Whether the steps of the laws are compiled.

    Attributes:
        schedule: Steps of the runs.
        positions: Joint positions at each step, each of shape (robots, n), if they are kept.
        failures: How robots failed, by number.
    """

    def __init__(self, robots: Sequence[Robot], records: bool, compiled: bool = False) -> None:
        self._recorded = records
        self._robots = Robots(robots)
        self._law = self._robots.law
        self._step: Any = without_checks(self._law.step)
        self.schedule: Schedule = self._robots.schedule
        if compiled:
            readings, period = self._robots.readings, self.schedule.period
            self._step = laws_step(readings, self._law, period)
        self._delay = robots[0].experiment.path_delay
        self._metrics = RunMetrics(self._robots.yardsticks)
        # Steps whose metrics have not been taken yet, and the time of the run's first step.
        self._part: list[Snapshot] = []
        self._origin: float | None = None
        self._ends = self.schedule.part_ends(len(robots))
        self._kept: dict[int, Mapping[str, Array]] = {}
        self.positions: list[Array] = []
        self.failures: dict[int, Failure] = {}

    def run(self, count_step: Callable[[int], None]) -> tuple[MetricValues, Array, Signals]:
        """Run to the end; return metrics, each of shape (robots,), joint positions, and states.

        Args:
            count_step: Called after each step with the number of robots.
        """
        with np.errstate(all="ignore"):
            first = moving = self._robots.start()
            for number in range(self.schedule.times.size):
                moving = self._advance(number, moving, first)
                count_step(len(moving.q))
            metrics = self._metrics_of(self._metrics)
        for robot, states in self._kept.items():
            for name, values in metrics.items():
                values[robot] = states[name][robot] if name in states else np.nan
        return metrics, moving.position, self._law.state.by_name(moving.x)

    def _advance(self, number: int, before: Moving, first: Moving) -> Moving:
        """Return the robots one step later; at the last step, as they are."""
        t = float(self.schedule.times[number])
        before = self._without_failed(before, first, t)
        look = self._robots.look(t, before.q, self._robots.around(number))
        if self._recorded:
            self.positions.append(before.position)
        observes = self._law.observables.size > 0
        self._part.append(self._robots.measure(self._law, look, before, observes=observes))
        if number in self._ends:
            self._take_part()
        if number + 1 == self.schedule.times.size:
            return before
        x, noise, noises = before.x, before.noise, self._robots.noises
        if self.schedule.samples[number]:
            u = self._robots.signals(look, before)
            self._robots.filter(before, t)
            x = self._step_laws(t, x, u)
        if self.schedule.noises[number] and noises is not None:
            noise = noises.of_each(noises.row(t))
        after = self._without_failed(replace(before, x=x, noise=noise), first, t)
        return self._robots.move(self._law, after, t, float(self.schedule.times[number + 1]))

    def _step_laws(self, t: float, x: Array, u: Mapping[str, Array]) -> Array:
        """Return the laws' states one period later; NaN for a robot whose law has failed."""
        period = self.schedule.period
        try:
            after: Array = self._step(t, x, u, period)
            return after
        except KeyboardInterrupt:
            raise
        except BaseException:
            # The error of one robot, e.g. a singular matrix, stops the step of all.
            alone = [self._stepped_alone(k, t, x, u) for k in range(len(x))]
            return np.stack(alone, axis=-1).T

    def _stepped_alone(self, robot: int, t: float, x: Array, u: Mapping[str, Array]) -> Array:
        law, only = self._robots.readings[robot], slice(robot, robot + 1)
        signals = {name: values[only] for name, values in u.items()}
        try:
            after: Array = without_checks(law.step)(t, x[only], signals, self.schedule.period)
            return after[0]
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            reason = f"{type(law).__name__}.step raised {describe(error)}"
            self.failures.setdefault(robot, Failure(t, reason))
            return np.full(x.shape[-1], np.nan)

    def _take_part(self) -> None:
        """Take the metrics of a part of the runs; the next one begins with its last step."""
        self._add_part(self._metrics)
        self._part = self._part[-1:]
        self._origin = float(self.schedule.times[0])

    def _add_part(self, metrics: RunMetrics) -> None:
        motion = motion_of(self._part, origin=self._origin, **self._robots.constants)
        if clearances := self._robots.clearances:
            ways = np.moveaxis(motion.position, 1, 0)
            each = [
                least_distances(clearance, motions, q, motion.time)
                for clearance, motions, q in zip(
                    clearances, self._robots.motions, ways, strict=True
                )
            ]
            least: dict[str, Any] = {
                name: np.stack([one[name] for one in each], axis=-1) for name in each[0]
            }
            motion = replace(motion, **least)
        metrics.add(motion)

    def _metrics_of(self, metrics: RunMetrics) -> MetricValues:
        """Return metrics, each of shape (robots,); NaN for a robot that has none."""
        robots = (len(self._robots.readings),)
        columns = {
            name: np.array(np.broadcast_to(v, robots)) for name, v in metrics.metrics().items()
        }
        if self._delay > 0.0:
            columns["path_delay_s"] = np.full(robots, self._delay)
        return columns

    def _metrics_so_far(self) -> MetricValues:
        """Return the metrics until now without ending the part."""
        metrics = deepcopy(self._metrics)
        if self._part:
            self._add_part(metrics)
        return self._metrics_of(metrics)

    def _without_failed(self, now: Moving, first: Moving, t: float) -> Moving:
        """Return the robots; keep the metrics of one whose state is not finite, and restart it."""
        if np.isfinite(now.x).all() and np.isfinite(now.q).all():
            return now
        is_failed = ~np.isfinite(np.concatenate((now.x, now.q), axis=-1)).all(axis=-1)
        new = [robot for robot in np.flatnonzero(is_failed).tolist() if robot not in self._kept]
        if new:
            metrics = self._metrics_so_far()
        for robot in new:
            self._kept[robot] = metrics
            self.failures.setdefault(robot, Failure(t, self._reason(now, robot)))
        return restart(now, first, is_failed)

    def _reason(self, now: Moving, robot: int) -> str:
        parts = self._law.state.parts.items()
        bad = [name for name, (at, _) in parts if not np.isfinite(now.x[robot, at]).all()]
        of_law = f"{type(self._law).__name__}.step: {', '.join(bad)} is no longer finite"
        return of_law if bad else "the joint positions are no longer finite"


#: Callback for the share of all steps that have been made, from 0 to 1, called from time to time.
Progress = Callable[[float], None]

Status = Literal["complete", "failed"]


@dataclass(frozen=True, eq=False)
class Many:
    """The results of many runs: a row for each experiment, in their order.

    Attributes:
        metrics: Values by the name of the metric, each of shape (rows,), as `METRICS` describes
            them; NaN where a run has none.
        status: Of each run, ``complete`` or ``failed``.
        until: Time that its metrics cover, shape (rows,) [s].
        failures: Why a run failed, by the number of its row.
        position: Joint positions at the end of each run, each of shape (n,) [rad]. Those of a run
            that failed have no meaning.
        state: State of each run's law at the end, by part, likewise.
        time: Times of the steps of each run, each of shape (steps,) [s], if series were asked for.
        series: Series by name, for each run, each of shape (steps, ...), if they were asked for.
    """

    metrics: Mapping[str, Array]
    status: tuple[Status, ...]
    until: Array
    failures: Mapping[int, str]
    position: tuple[Array, ...]
    state: tuple[Signals, ...] = ()
    time: tuple[Array, ...] = ()
    series: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.status)

    def row(self, number: int) -> dict[str, float]:
        """Return the metrics of one run that apply, by name, as `Result.metrics` has them.

        Raises:
            InvalidInputError: If there is no such row.
        """
        if not isinstance(number, (int, np.integer)) or not 0 <= number < len(self):
            raise InvalidInputError(
                f"row: must be the number of one of {len(self)} rows, from 0 on, not {number!r}"
            )
        row = {name: float(values[number]) for name, values in self.metrics.items()}
        return {name: value for name, value in row.items() if np.isfinite(value)}


@checked(progress=optional(function()), record=each(str), compiled=flag)
def run_many(
    experiments: Sequence[ExperimentSource],
    progress: Progress | None = None,
    *,
    record: Sequence[str] = (),
    compiled: bool = False,
) -> Many:
    """Run many experiments at once and return their metrics.

    Robots whose laws differ only in numbers run side by side, up to 1000 at a time: each may have
    its own start, gains, limits, seed, path and arm. A run equals that of `simulate` except for
    rounding, and has the same bits in any batch. Memory does not grow with the duration; a run
    needs some hundred bytes in addition to its experiment.

    Metrics are those of `simulate`, except that the medians of a learned Jacobian's errors come
    from a histogram, within 0.6 %. A run whose state is no longer finite has failed; the others go
    on. The checks of `simulate` before a run, e.g. whether the path is in reach, are not made:
    `check_experiment` makes them for one experiment.

    Args:
        experiments: Experiments, or what `load_experiment` takes. `why_not` tells which ones cannot
            run in a batch, and why.
        progress: Called with the share of steps made, from time to time.
        record: Series to keep of every step, which takes memory: ``position`` or nothing.
        compiled: Whether the steps of the laws are compiled, once for all robots that run side by
            side: to C if the machine has a C compiler, else by JAX. Each may have obstacles of its
            own, as many of each shape.

    Raises:
        InvalidInputError: If an experiment cannot be run so, with its number and why.
    """
    for name in record:
        if name != "position":
            raise InvalidInputError(f"record: may be position, not {name!r}")
    return run_robots(robots_of(experiments), progress, record, compiled=compiled)


def run_robots(
    robots: Sequence[Robot],
    progress: Progress | None = None,
    record: Sequence[str] = (),
    *,
    compiled: bool = False,
) -> Many:
    """Run robots at once; arguments and result are those of `run_many`."""
    groups = blocks(robots)
    documents = [robot.experiment.document for robot in robots]
    count_step = _step_counter(progress, [(documents[group[0]], len(group)) for group in groups])
    count = len(robots)
    columns: dict[str, Array] = {}
    until = np.array([document.duration for document in documents])
    failures: dict[int, Failure] = {}
    ends, times, series = ([np.empty(0)] * count for _ in range(3))
    states: list[Signals] = [{}] * count
    for numbers in groups:
        group = [robots[number] for number in numbers]
        block = Block(group, records="position" in record, compiled=compiled)
        metrics, q, parts = block.run(count_step)
        for name, values in metrics.items():
            column = columns.setdefault(name, np.full(count, np.nan))
            column[numbers] = np.where(np.isfinite(values), values, np.nan)
        failures |= {numbers[robot]: failure for robot, failure in block.failures.items()}
        positions = np.stack(block.positions) if block.positions else None
        for robot, number in enumerate(numbers):
            ends[number] = q[robot].copy()
            states[number] = {name: part[robot].copy() for name, part in parts.items()}
            if positions is not None:
                times[number], series[number] = block.schedule.times, positions[:, robot]
    for number, failure in failures.items():
        until[number] = failure.time
    ordered_columns = {name: columns[name] for name in METRICS.names if name in columns}
    return Many(
        metrics={
            name: values for name, values in ordered_columns.items() if np.isfinite(values).any()
        },
        status=tuple("failed" if row in failures else "complete" for row in range(count)),
        until=until,
        failures={row: failures[row].reason for row in sorted(failures)},
        position=tuple(ends),
        state=tuple(states),
        time=tuple(times) if record else (),
        series={"position": tuple(series)} if record else {},
    )


def robots_of(descriptions: Sequence[ExperimentSource]) -> list[Robot]:
    """Return the robots of experiments; those with the same model share its kinematics.

    Args:
        descriptions: Experiments, or what `load_experiment` takes.

    Raises:
        InvalidInputError: If a batch cannot run one; the message says which and why.
    """
    require_several("experiments", descriptions)
    arms: dict[object, Screws] = {}
    robots, shared_arms = [], Arms()
    for number, value in enumerate(descriptions):
        try:
            experiment = (
                value if isinstance(value, Experiment) else load_experiment(value, arms=shared_arms)
            )
            reading = able_reading(experiment.document, experiment.law)
            if experiment.safety is not None:
                reading = experiment.safety.around(reading, experiment.document.period or 0.0)
            model = contents(experiment.arm.description)
            if model not in arms:
                arms[model] = screws_of(experiment.arm)
        except InvalidInputError as error:
            raise InvalidInputError(f"{named_place(descriptions, number)}{error}") from None
        robots.append(Robot(experiment, reading, arms[model]))
    return robots


def named_place(sources: Sequence[ExperimentSource], number: int) -> str:
    """Return which of several experiments is meant, to begin a message; nothing if all are one."""
    return "" if all(each is sources[0] for each in sources) else f"experiments[{number}]: "


def _step_counter(
    progress: Progress | None, groups: Sequence[tuple[ExperimentDocument, int]]
) -> Callable[[int], None]:
    """Return what counts a step of some robots, and tells the progress some hundred times.

    Args:
        progress: Is told the share of all steps that have been made.
        groups: Document of one robot of each block, and the number of its robots.
    """
    every, made, told = 0.0, 0.0, 0.0
    for document, count in groups:
        steps = document.duration / (document.period or 1.0)
        if document.joint_noise is not None:
            steps = max(steps, document.duration / document.joint_noise.hold)
        every += steps * count

    def advanced(count: int) -> None:
        nonlocal made, told
        made += count
        share = min(1.0, made / every)
        if progress is not None and share - told >= 0.01:
            told = share
            progress(share)

    return advanced
