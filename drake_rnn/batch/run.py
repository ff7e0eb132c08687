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
from ..features.detour import detours_of
from ..features.obstacles import least_distances
from ..inputs.fields import Array, checked, each, flag, function, optional
from ..inputs.kinds import describe
from ..inputs.messages import require_several
from ..laws import Signals
from ..laws.call_checks import without_checks
from ..measures import METRICS, MetricValues, Motion, RunMetrics
from ..robot.load_arm import screws_of
from ..robot.screws import PairScrews, Screws
from .grouping import Robot, able_reading, blocks, contents
from .robots import Look, Moving, Robots, Snapshot, motion_of, restart
from .signals import Schedule


@dataclass(frozen=True)
class Failure:
    """How a robot's run ended early.

    Attributes:
        time: When [s].
        reason: Why.
    """

    time: float
    reason: str


class Side:
    """An arm of each robot of a block: the only ones, or the first or second ones of pairs.

    Args:
        robots: The robots, of this side.
        compiled: Whether the steps of the laws are compiled.

    Attributes:
        robots: The robots.
        law: Their law.
        step: Its step.
        metrics: Their metrics so far.
        part: Steps whose metrics have not been taken yet.
        positions: Joint positions at each step, each of shape (robots, n), if they are kept.
    """

    def __init__(self, robots: Sequence[Robot], compiled: bool) -> None:
        self.robots = Robots(robots)
        self.law = self.robots.law
        self.step: Any = without_checks(self.law.step)
        if compiled:
            readings, period = self.robots.readings, self.robots.schedule.period
            self.step = laws_step(readings, self.law, period)
        neighbour = robots[0].experiment.law.neighbour
        self._seen = {} if neighbour is None else neighbour.parts
        self._delay = robots[0].experiment.path_delay
        self.metrics = RunMetrics(self.robots.yardsticks)
        self.part: list[Snapshot] = []
        self.positions: list[Array] = []

    def seen_of(self, other: Side, x: Array | None = None) -> dict[str, Array]:
        """Return what the laws see of arms beside theirs, by name.

        Args:
            other: These arms.
            x: States of their laws, shape (robots, state.size); None as long as they rest.
        """
        if x is not None:
            return {signal: other.law.state.part(x, part) for signal, part in self._seen.items()}
        starts = other.robots.starts
        return {
            signal: starts if part == "commanded" else np.zeros_like(starts)
            for signal, part in self._seen.items()
        }

    def look(self, number: int, t: float, now: Moving) -> Look:
        """Return what there is to see at a step, and measure it."""
        look = self.robots.look(t, now.q, self.robots.around(number))
        observes = self.law.observables.size > 0
        self.part.append(self.robots.measure(self.law, look, now, observes=observes))
        return look

    def metrics_of(self, metrics: RunMetrics) -> MetricValues:
        """Return metrics, each of shape (robots,); NaN for a robot that has none."""
        robots = (len(self.robots.readings),)
        columns = {
            name: np.array(np.broadcast_to(v, robots)) for name, v in metrics.metrics().items()
        }
        if self._delay > 0.0:
            columns["path_delay_s"] = np.full(robots, self._delay)
        return columns


class Block:
    """Robots whose laws differ in numbers alone; each may be a pair of arms beside each other.

    Of pairs the first arms choose first, and the second ones see what these have chosen.

    A robot whose state is no longer finite has failed. Its metrics until then are kept, and the
    robot is restarted, so that its numbers do not disturb the others.

    Args:
        robots: The robots.
        records: Whether to keep the joint positions of all steps.
        compiled: Whether the steps of the laws are compiled.

    Attributes:
        sides: The arms: those of all robots, and of pairs the second ones.
        schedule: Steps of the runs.
        failures: How robots failed, by number.
    """

    def __init__(self, robots: Sequence[Robot], records: bool, compiled: bool = False) -> None:
        self._recorded = records
        seconds = [robot.second for robot in robots if robot.second is not None]
        self.sides = tuple(Side(each, compiled) for each in (robots, seconds) if each)
        self.schedule: Schedule = self.sides[0].robots.schedule
        # The time of the run's first step.
        self._origin: float | None = None
        self._ends = self.schedule.part_ends(len(robots))
        self._kept: dict[int, Sequence[Mapping[str, Array]]] = {}
        self.failures: dict[int, Failure] = {}
        led = [detours_of(robot.experiment) for robot in robots]
        self._detours = [each for each in led if each is not None]
        self.led: list[Array] = []
        self._statuses: list[Array] = []

    def run(self, count_step: Callable[[int], None]) -> list[tuple[MetricValues, Array, Signals]]:
        """Run to the end; return metrics, each of shape (robots,), joint positions, and states.

        Args:
            count_step: Called after each step with the number of robots.

        Returns:
            The same of each side.
        """
        with np.errstate(all="ignore"):
            first = moving = self._start()
            starts = [np.concatenate(q) for q in zip(*(now.q for now in moving), strict=True)]
            self.led = [d.start(q) for d, q in zip(self._detours, starts, strict=False)]
            for number in range(self.schedule.times.size):
                moving = self._advance(number, moving, first)
                count_step(len(moving[0].q))
            metrics = [side.metrics_of(side.metrics) for side in self.sides]
        for robot, states in self._kept.items():
            for own, kept in zip(metrics, states, strict=True):
                for name, values in own.items():
                    values[robot] = kept[name][robot] if name in kept else np.nan
        return [
            (own, now.position, side.law.state.by_name(now.x))
            for own, now, side in zip(metrics, moving, self.sides, strict=True)
        ]

    def _start(self) -> list[Moving]:
        if len(self.sides) == 1:
            return [self.sides[0].robots.start(self._unled(self.sides[0]))]
        one, two = self.sides
        beside = one.seen_of(two) | self._unled(one), two.seen_of(one) | self._unled(two)
        return [one.robots.start(beside[0]), two.robots.start(beside[1])]

    def _unled(self, side: Side) -> dict[str, Array]:
        """Return what the laws of a side see as long as nothing leads them, by name."""
        starts = side.robots.starts
        return {"detour": np.nan * starts, "posture": starts} if self._detours else {}

    def _advance(
        self, number: int, before: Sequence[Moving], first: Sequence[Moving]
    ) -> list[Moving]:
        """Return the robots one step later; at the last step, as they are."""
        t = float(self.schedule.times[number])
        moving = self._without_failed(before, first, t)
        looks = [side.look(number, t, now) for side, now in zip(self.sides, moving, strict=True)]
        self._record(moving)
        if number in self._ends:
            self._take_part()
        if number + 1 == self.schedule.times.size:
            return moving
        leads = self._lead(number, t, moving)
        for k, (side, look) in enumerate(zip(self.sides, looks, strict=True)):
            now = moving[k]
            if self.schedule.samples[number]:
                others = zip(self.sides, moving, strict=True)
                # Of pairs: the states of the second arms, or those that the first ones chose.
                beside = [side.seen_of(arm, at.x) for arm, at in others if arm is not side]
                u = side.robots.signals(look, now, {**(beside[0] if beside else {}), **leads[k]})
                side.robots.filter(now, t)
                now = replace(now, x=self._step_laws(side, t, now.x, u))
            noises = side.robots.noises
            if self.schedule.noises[number] and noises is not None:
                now = replace(now, noise=noises.of_each(noises.row(t)))
            moving[k] = now
        until = float(self.schedule.times[number + 1])
        after = self._without_failed(moving, first, t)
        pairs = zip(self.sides, after, strict=True)
        return [side.robots.move(side.law, now, t, until) for side, now in pairs]

    def _record(self, moving: Sequence[Moving]) -> None:
        """Keep what there is to keep of a step."""
        if self._detours:
            states = zip(self._detours, self.led, strict=True)
            self._statuses.append(np.array([detours.status(x) for detours, x in states]))
        if self._recorded:
            for side, now in zip(self.sides, moving, strict=True):
                side.positions.append(now.position)

    def _lead(self, number: int, t: float, moving: Sequence[Moving]) -> list[dict[str, Array]]:
        """Return what leads the laws of each side round what they are stuck before, by name."""
        if not (self._detours and self.schedule.samples[number]):
            return [{} for _ in moving]
        joints = np.concatenate([now.q for now in moving], axis=1)
        velocities, postures = list[Array](), list[Array]()
        looks = round(t / self.schedule.period) % self._detours[0].every == 0
        for k, (detours, q) in enumerate(zip(self._detours, joints, strict=True)):
            velocities.append(detours.velocity(self.led[k], t, q))
            postures.append(detours.layout.part(self.led[k], "home"))
            if looks:
                self.led[k] = detours.step(self.led[k], t, q)
        ends = np.cumsum([now.q.shape[1] for now in moving])[:-1]
        sides = (np.split(np.array(each), ends, axis=1) for each in (velocities, postures))
        return [{"detour": v, "posture": q} for v, q in zip(*sides, strict=True)]

    def _step_laws(self, side: Side, t: float, x: Array, u: Mapping[str, Array]) -> Array:
        """Return the laws' states one period later; NaN for a robot whose law has failed."""
        period = self.schedule.period
        try:
            after: Array = side.step(t, x, u, period)
            return after
        except KeyboardInterrupt:
            raise
        except BaseException:
            # The error of one robot, e.g. a singular matrix, stops the step of all.
            alone = [self._stepped_alone(side, k, t, x, u) for k in range(len(x))]
            return np.stack(alone, axis=-1).T

    def _stepped_alone(
        self, side: Side, robot: int, t: float, x: Array, u: Mapping[str, Array]
    ) -> Array:
        law, only = side.robots.readings[robot], slice(robot, robot + 1)
        signals = {name: values[only] for name, values in u.items()}
        try:
            after: Array = without_checks(law.step)(t, x[only], signals, self.schedule.period)
            return after[0]
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            reason = f"{self._name(side)}{type(law).__name__}.step raised {describe(error)}"
            self.failures.setdefault(robot, Failure(t, reason))
            return np.full(x.shape[-1], np.nan)

    def _name(self, side: Side) -> str:
        return "" if side is self.sides[0] else "second: "

    def _take_part(self) -> None:
        """Take the metrics of a part of the runs; the next one begins with its last step."""
        for side, motion in zip(self.sides, self._motions(), strict=True):
            side.metrics.add(motion)
            side.part = side.part[-1:]
        self._statuses = self._statuses[-1:]
        self._origin = float(self.schedule.times[0])

    def _motions(self) -> list[Motion]:
        """Return the motions of the part, with the least distances of each robot."""
        motions = [
            motion_of(side.part, origin=self._origin, **side.robots.constants)
            for side in self.sides
        ]
        found = []
        for side, motion in zip(self.sides, motions, strict=True):
            if clearances := side.robots.clearances:
                # Postures are those of an arm and, behind them, of the one beside it.
                others = [each.position for each in motions if each is not motion]
                ways = np.moveaxis(np.concatenate((motion.position, *others), axis=-1), 1, 0)
                each = [
                    least_distances(clearance, obstacles, q, motion.time)
                    for clearance, obstacles, q in zip(
                        clearances, side.robots.motions, ways, strict=True
                    )
                ]
                least: dict[str, Any] = {
                    name: np.stack([one[name] for one in each], axis=-1) for name in each[0]
                }
                motion = replace(motion, **least)
            if self._statuses and side is self.sides[0]:
                motion = replace(motion, features={"detours": np.array(self._statuses)})
            found.append(motion)
        return found

    def _metrics_so_far(self) -> list[MetricValues]:
        """Return the metrics until now without ending the part."""
        metrics = [deepcopy(side.metrics) for side in self.sides]
        if self.sides[0].part:
            for own, motion in zip(metrics, self._motions(), strict=True):
                own.add(motion)
        return [side.metrics_of(own) for side, own in zip(self.sides, metrics, strict=True)]

    def _without_failed(
        self, moving: Sequence[Moving], first: Sequence[Moving], t: float
    ) -> list[Moving]:
        """Return the robots; keep the metrics of one whose state is not finite, and restart it."""
        if all(np.isfinite(now.x).all() and np.isfinite(now.q).all() for now in moving):
            return list(moving)
        values = [part for now in moving for part in (now.x, now.q)]
        is_failed = ~np.isfinite(np.concatenate(values, axis=-1)).all(axis=-1)
        new = [robot for robot in np.flatnonzero(is_failed).tolist() if robot not in self._kept]
        if new:
            metrics = self._metrics_so_far()
        for robot in new:
            self._kept[robot] = metrics
            self.failures.setdefault(robot, Failure(t, self._reason(moving, robot)))
        pairs = zip(moving, first, strict=True)
        return [restart(now, begin, is_failed) for now, begin in pairs]

    def _reason(self, moving: Sequence[Moving], robot: int) -> str:
        for side, now in zip(self.sides, moving, strict=True):
            parts = side.law.state.parts.items()
            bad = [name for name, (at, _) in parts if not np.isfinite(now.x[robot, at]).all()]
            if bad:
                law = f"{self._name(side)}{type(side.law).__name__}"
                return f"{law}.step: {', '.join(bad)} is no longer finite"
        return "the joint positions are no longer finite"


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
        second: The same of the arms beside these, with a row for each run; None if no run has two.
    """

    metrics: Mapping[str, Array]
    status: tuple[Status, ...]
    until: Array
    failures: Mapping[int, str]
    position: tuple[Array, ...]
    state: tuple[Signals, ...] = ()
    time: tuple[Array, ...] = ()
    series: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)
    second: Many | None = None

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

    An experiment with a second arm is a row; `Many.second` has that of its second arm.

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
    until = np.array([document.duration for document in documents])
    failures: dict[int, Failure] = {}
    tables = [_Rows(len(robots)), _Rows(len(robots))]
    for numbers in groups:
        group = [robots[number] for number in numbers]
        block = Block(group, records="position" in record, compiled=compiled)
        results = block.run(count_step)
        failures |= {numbers[robot]: failure for robot, failure in block.failures.items()}
        for rows, side, result in zip(tables, block.sides, results, strict=False):
            rows.put(numbers, side, *result)
    for number, failure in failures.items():
        until[number] = failure.time
    first, second = (
        Many(
            metrics=rows.metrics,
            status=tuple("failed" if row in failures else "complete" for row in range(len(robots))),
            until=until,
            failures={row: failures[row].reason for row in sorted(failures)},
            position=tuple(rows.ends),
            state=tuple(rows.states),
            time=tuple(rows.times) if record else (),
            series={"position": tuple(rows.series)} if record else {},
        )
        for rows in tables
    )
    return replace(first, second=second) if any(robot.second for robot in robots) else first


class _Rows:
    """What runs of one arm each come to, in their order.

    Args:
        count: Number of runs.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._columns: dict[str, Array] = {}
        self.ends, self.times, self.series = ([np.empty(0)] * count for _ in range(3))
        self.states: list[Signals] = [{}] * count

    def put(
        self,
        numbers: Sequence[int],
        side: Side,
        metrics: MetricValues,
        q: Array,
        parts: Signals,
    ) -> None:
        """Put what a side of a block has come to in the rows of its runs."""
        for name, values in metrics.items():
            column = self._columns.setdefault(name, np.full(self._count, np.nan))
            column[numbers] = np.where(np.isfinite(values), values, np.nan)
        positions = np.stack(side.positions) if side.positions else None
        for robot, number in enumerate(numbers):
            self.ends[number] = q[robot].copy()
            self.states[number] = {name: part[robot].copy() for name, part in parts.items()}
            if positions is not None:
                self.times[number] = side.robots.schedule.times
                self.series[number] = positions[:, robot]

    @property
    def metrics(self) -> dict[str, Array]:
        """The metrics that any run has, in the order of `METRICS`."""
        columns = {name: self._columns[name] for name in METRICS.names if name in self._columns}
        return {name: values for name, values in columns.items() if np.isfinite(values).any()}


def robots_of(descriptions: Sequence[ExperimentSource]) -> list[Robot]:
    """Return the robots of experiments; those with the same model share its kinematics.

    Args:
        descriptions: Experiments, or what `load_experiment` takes.

    Raises:
        InvalidInputError: If a batch cannot run one; the message says which and why.
    """
    require_several("experiments", descriptions)
    arms: dict[object, Screws | PairScrews] = {}
    robots, shared_arms = [], Arms()
    for number, value in enumerate(descriptions):
        try:
            experiment = (
                value if isinstance(value, Experiment) else load_experiment(value, arms=shared_arms)
            )
            robots.append(_robot_of(experiment, arms))
        except InvalidInputError as error:
            raise InvalidInputError(f"{named_place(descriptions, number)}{error}") from None
    return robots


def _robot_of(experiment: Experiment, arms: dict[object, Screws | PairScrews]) -> Robot:
    """Return the robot of an experiment; ``arms`` has the kinematics of models, by their contents.

    Raises:
        InvalidInputError: If a batch cannot run it.
    """
    reading = able_reading(experiment.document, experiment.law)
    if experiment.safety is not None:
        reading = experiment.safety.around(reading, experiment.document.period or 0.0)
    model = contents(experiment.arm.description)
    if model not in arms:
        arms[model] = screws_of(experiment.arm)
    if experiment.second is None:
        return Robot(experiment, reading, arms[model])
    try:
        second = _robot_of(experiment.second, arms)
    except InvalidInputError as error:
        raise InvalidInputError(f"second: {error}") from None
    return Robot(experiment, reading, arms[model], second)


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
