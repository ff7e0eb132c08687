"""Many runs at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Arms, Described, Experiment, ExperimentDocument, load_experiment
from ..inputs.arguments import checked, each, function, optional
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


@checked(progress=optional(function()), record=each(str))
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
    documents = [robot.experiment.document for robot in robots]
    advanced = _counted(progress, [(documents[group[0]], len(group)) for group in groups])
    count = len(robots)
    columns: dict[str, Array] = {}
    until = np.array([document.duration for document in documents])
    failures: dict[int, Failure] = {}
    ends, times, series = ([np.empty(0)] * count for _ in range(3))
    for numbers in groups:
        block = Block([robots[number] for number in numbers], recorded="position" in record)
        found, q = block.run(advanced)
        for name, values in found.items():
            column = columns.setdefault(name, np.full(count, np.nan))
            column[numbers] = np.where(np.isfinite(values), values, np.nan)
        failures |= {numbers[robot]: failure for robot, failure in block.failures.items()}
        recorded = np.stack(block.positions) if block.positions else None
        for robot, number in enumerate(numbers):
            ends[number] = q[robot].copy()
            if recorded is not None:
                times[number], series[number] = block.schedule.times, recorded[:, robot]
    for number, failure in failures.items():
        until[number] = failure.time
    named = {name: columns[name] for name in METRIC_NAMES if name in columns}
    return Many(
        metrics={name: values for name, values in named.items() if np.isfinite(values).any()},
        status=tuple("failed" if row in failures else "complete" for row in range(count)),
        until=until,
        failures={row: failures[row].reason for row in sorted(failures)},
        position=tuple(ends),
        time=tuple(times) if record else (),
        series={"position": tuple(series)} if record else {},
    )


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
    for number, given in enumerate(described):
        try:
            experiment = (
                given if isinstance(given, Experiment) else load_experiment(given, arms=shared)
            )
            reading = able_reading(experiment.document, experiment.law)
            model = contents(experiment.arm.description)
            if model not in arms:
                arms[model] = screws_of(experiment.arm)
        except InvalidInputError as error:
            raise InvalidInputError(f"experiments[{number}]: {error}") from None
        robots.append(Robot(experiment, reading, arms[model]))
    return robots


def _counted(
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
