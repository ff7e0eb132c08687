"""Whole runs of robots side by side, compiled by JAX from the source that NumPy runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..arrays.jax_module import require_jax
from ..arrays.namespace import AnyArray
from ..errors import InvalidInputError
from ..experiment import Described, Experiment
from ..inputs.fields import Array
from ..laws import SampledReading
from ..laws.called import unchecked
from ..laws.stacked import with_gains
from ..many.grouping import blocks
from ..many.robots import Around, Moving, Robots
from ..many.step import Step
from .compiling import compilable, compiled_in_order
from .metrics import Counts, counts_of, metrics_of, require_metrics

#: Numbers of a law by the names of its fields, each of shape (robots,).
Gains = Mapping[str, AnyArray]


class _Row(NamedTuple):
    """What a step needs that no gain changes; in a table of all, steps are in front.

    Attributes:
        t, until: Times at which it begins and ends [s].
        samples: Whether laws make a sample.
        counts: What it counts for.
        around: Paths and surfaces.
        noise: Noise from its time on, of standard deviation 1; None without dither.
    """

    t: AnyArray
    until: AnyArray
    samples: AnyArray
    counts: Counts
    around: Around
    noise: AnyArray | None


class CompiledRuns:
    """Runs of experiments side by side, compiled as a whole when they are first asked for.

    They are those of `run_many` but for rounding. A robot whose numbers are no longer finite has
    metrics that are not. Tables of paths and noise are kept for all steps.

    Args:
        experiments: Experiments that `run_many` can run, at most 1000, whose laws differ in nothing
            but numbers; each an experiment or what `load_experiment` takes.
        metrics: Names of the metrics to take.

    Raises:
        InvalidInputError: If JAX is not installed, an experiment cannot be run so, or a metric
            cannot be taken.
    """

    def __init__(self, experiments: Sequence[Described], metrics: Sequence[str]) -> None:
        self._jax = require_jax()
        robots = compilable(experiments)
        if len(blocks(robots)) != 1:
            raise InvalidInputError(
                "experiments: must be 1 to 1000, whose laws differ in nothing but numbers"
            )
        self.experiments: list[Experiment] = [robot.experiment for robot in robots]
        known = metrics_of(self.experiments)
        require_metrics(known, metrics)
        self._taken = {name: known[name] for name in metrics}
        self._first, self._robots = robots[0], Robots(robots)
        self._start = self._robots.started()
        samples = self._robots.schedule.samples[:-1]
        self._always = bool(samples.all())
        self._table: _Row | None = None
        self._compiled = compiled_in_order(self.of_gains)

    @property
    def law(self) -> SampledReading:
        """Reading of the law with the numbers of all robots."""
        return self._robots.law

    def run(self) -> dict[str, Array]:
        """Run all and return the metrics, by name, each of shape (robots,)."""
        found = self._compiled({}, self.table)
        return {name: np.asarray(values) for name, values in found.items()}

    def start_of(self, gains: Mapping[str, float]) -> Array:
        """Return the initial state of the first law with other numbers, shape (1, state.size)."""
        reading = with_gains(self._first.reading, gains)
        x: Array = Robots([replace(self._first, reading=reading)]).started().x
        return x

    @property
    def table(self) -> _Row:
        """What the steps of the runs need, made once; to be given to `of_gains`."""
        if self._table is None:
            table = self._rows()
            self._table = self._jax.tree.map(self._jax.numpy.asarray, table)
        return self._table

    def of_gains(self, gains: Gains, table: _Row) -> dict[str, AnyArray]:
        """Return the metrics of runs with other numbers, for JAX to trace.

        Args:
            gains: Numbers of the law.
            table: What the steps need.
        """
        law = with_gains(self.law, gains)
        first = replace(self._start, command=law.commanded_velocity(0.0, self._start.x))
        rows, last = self._split(table)
        like = self._measured(law, first, last)
        gathered = {name: taken.started(taken.of(like)) for name, taken in self._taken.items()}

        def body(carry: Any, row: _Row) -> tuple[Any, None]:
            now = Moving(*carry[0])
            gathered = self._added(law, carry[1], now, row)
            return (_parts(self._advanced(law, now, row)), gathered), None

        carry = (self._jax.tree.map(self._jax.numpy.asarray, _parts(first)), gathered)
        (parts, gathered), _ = self._jax.lax.scan(body, carry, rows)
        gathered = self._added(law, gathered, Moving(*parts), last)
        steps = float(self._robots.schedule.within.sum())
        means = {n: g / steps if self._taken[n].over == "mean" else g for n, g in gathered.items()}
        return {name: self._taken[name].finish(value) for name, value in means.items()}

    def _rows(self) -> _Row:
        schedule, noises = self._robots.schedule, self._robots.noises
        noise, times = None, schedule.times
        if noises is not None:
            # What is held at a step is the noise of the last step at which it changed.
            changes = np.flatnonzero(schedule.noises)
            drawn = np.stack([noises.row(float(times[k])) for k in changes])
            noise = drawn[np.cumsum(schedule.noises) - 1]
        return _Row(
            times,
            np.append(times[1:], times[-1]),
            schedule.samples,
            counts_of(schedule),
            self._robots.all_around(),
            noise,
        )

    def _split(self, table: _Row) -> tuple[_Row, _Row]:
        """Return all rows but the last one, and that."""
        rows = self._jax.tree.map(lambda values: values[:-1], table)
        return rows, self._jax.tree.map(lambda values: values[-1], table)

    def _measured(self, law: SampledReading, now: Moving, row: _Row) -> Step:
        look = self._robots.look(0, row.t, self._jax.numpy.asarray(now.q), row.around)
        return self._robots.measured(law, look, now, observes=False)

    def _added(
        self, law: SampledReading, gathered: Mapping[str, AnyArray], now: Moving, row: _Row
    ) -> dict[str, AnyArray]:
        step = self._measured(law, now, row)
        return {
            name: taken.added(gathered[name], taken.of(step), row.counts)
            for name, taken in self._taken.items()
        }

    def _advanced(self, law: SampledReading, now: Moving, row: _Row) -> Moving:
        """Return the robots one step later."""
        look = self._robots.look(0, row.t, now.q, row.around)
        u, period = self._robots.signals(look, now), self._robots.schedule.period

        def sampled() -> AnyArray:
            step: Any = unchecked(law.step)
            return step(row.t, now.x, u, period)

        x = sampled() if self._always else self._jax.lax.cond(row.samples, sampled, lambda: now.x)
        noises = self._robots.noises
        noise = None if noises is None else noises.of_each(row.noise)
        return self._robots.moved(law, replace(now, x=x, noise=noise), row.t, row.until)


def _parts(now: Moving) -> tuple[AnyArray, ...]:
    return now.q, now.x, now.command, now.noise
