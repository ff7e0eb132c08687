"""Many runs at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Arms, Described, Experiment, load_experiment
from ..inputs.complaints import require_several
from ..inputs.fields import Array
from ..measures import METRIC_NAMES
from ..robot.arm_screws import screws_of
from ..robot.screws import Screws
from .block import Block, Failure
from .grouping import Robot, blocks, contents
from .why_not import able_reading

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
        time: Times of the steps of each run, each of shape (steps,) [s], if series were asked for.
        series: Series by name, for each run, each of shape (steps, ...), if they were asked for.
    """

    metrics: Mapping[str, Array]
    status: tuple[Status, ...]
    until: Array
    failures: Mapping[int, str]
    position: tuple[Array, ...]
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


def run_many(
    experiments: Sequence[Described],
    progress: Progress | None = None,
    *,
    record: Sequence[str] = (),
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

    Raises:
        InvalidInputError: If an experiment cannot be run so, with its number and why.
    """
    for name in record:
        if name != "position":
            raise InvalidInputError(f"record: may be position, not {name!r}")
    return run_robots(robots_of(experiments), progress, record)


def run_robots(
    robots: Sequence[Robot], progress: Progress | None = None, record: Sequence[str] = ()
) -> Many:
    """Run robots at once; arguments and result are those of `run_many`."""
    groups = blocks(robots)
    table = _Table(robots)
    meter = _Meter(progress, groups, robots)
    for numbers in groups:
        block = Block([robots[number] for number in numbers], recorded="position" in record)
        found, q = block.run(meter.advance)
        table.fill(numbers, block, found, q)
    return table.result(record)


def robots_of(described: Sequence[Described]) -> list[Robot]:
    """Return the robots of experiments; those with the same model share its kinematics.

    Args:
        described: Experiments, or what `load_experiment` takes.

    Raises:
        InvalidInputError: If a batch cannot run one; the message says which and why.
    """
    require_several("experiments", described)
    arms: dict[object, Screws] = {}
    robots, shared = [], Arms()
    for number, each in enumerate(described):
        try:
            experiment = (
                each if isinstance(each, Experiment) else load_experiment(each, arms=shared)
            )
            reading = able_reading(experiment.document, experiment.law)
            model = contents(experiment.arm.description)
            if model not in arms:
                arms[model] = screws_of(experiment.arm)
        except InvalidInputError as error:
            raise InvalidInputError(f"experiments[{number}]: {error}") from None
        robots.append(Robot(experiment, reading, arms[model]))
    return robots


class _Table:
    """The rows of a result, filled block by block."""

    def __init__(self, robots: Sequence[Robot]) -> None:
        count = len(robots)
        self._metrics: dict[str, Array] = {}
        self._until = np.array([robot.experiment.document.duration for robot in robots])
        self._failures: dict[int, Failure] = {}
        self._positions = [np.empty(0)] * count
        self._times, self._series = [np.empty(0)] * count, [np.empty(0)] * count

    def fill(self, numbers: list[int], block: Block, found: Mapping[str, Array], q: Array) -> None:
        """Enter the rows of a block."""
        for name, values in found.items():
            column = self._metrics.setdefault(name, np.full(self._until.size, np.nan))
            column[numbers] = np.where(np.isfinite(values), values, np.nan)
        for robot, failure in block.failures.items():
            self._failures[numbers[robot]] = failure
            self._until[numbers[robot]] = failure.time
        for robot, number in enumerate(numbers):
            self._positions[number] = q[robot].copy()
        if block.positions:
            recorded = np.stack(block.positions)
            for robot, number in enumerate(numbers):
                self._times[number] = block.schedule.times
                self._series[number] = recorded[:, robot]

    def result(self, record: Sequence[str]) -> Many:
        """Return the whole table."""
        rows = range(self._until.size)
        named = {name: self._metrics[name] for name in METRIC_NAMES if name in self._metrics}
        return Many(
            metrics={name: values for name, values in named.items() if np.isfinite(values).any()},
            status=tuple("failed" if row in self._failures else "complete" for row in rows),
            until=self._until,
            failures={row: self._failures[row].reason for row in sorted(self._failures)},
            position=tuple(self._positions),
            time=tuple(self._times) if record else (),
            series={"position": tuple(self._series)} if record else {},
        )


class _Meter:
    """How far many runs have come.

    Args:
        progress: Is told, some hundred times.
        groups: Numbers of the robots of each block.
        robots: The robots.
    """

    def __init__(
        self,
        progress: Progress | None,
        groups: Sequence[Sequence[int]],
        robots: Sequence[Robot],
    ) -> None:
        self._progress = progress
        self._all, self._made, self._told = 0.0, 0.0, 0.0
        for numbers in groups:
            document = robots[numbers[0]].experiment.document
            steps = document.duration / (document.period or 1.0)
            if document.dither is not None:
                steps = max(steps, document.duration / document.dither.hold)
            self._all += steps * len(numbers)

    def advance(self, count: int) -> None:
        """Count a step of some robots."""
        self._made += count
        share = min(1.0, self._made / self._all)
        if self._progress is not None and share - self._told >= 0.01:
            self._told = share
            self._progress(share)
