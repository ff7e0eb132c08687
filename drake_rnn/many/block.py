"""Robots that run side by side: the order of things of a diagram, without the diagram."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..inputs.fields import Array
from ..inputs.own_code import described
from ..laws.called import unchecked
from ..laws.stacked import stacked
from .grouping import Robot
from .metrics import ManyMetrics
from .robots import Look, Moving, Robots, restarted
from .schedule import Schedule
from .step import Found


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

    A robot whose state is no longer finite has failed: its metrics are those until then, and in
    its place one goes on from its start, so that it harms no other.

    Args:
        robots: The robots.
        recorded: Whether to keep the joint positions of all steps.

    Attributes:
        schedule: Steps of the runs.
        positions: Joint positions at each step, each of shape (robots, n), if they are kept.
        failures: How robots failed, by number.
    """

    def __init__(self, robots: Sequence[Robot], recorded: bool) -> None:
        self._recorded = recorded
        self._robots = Robots(robots)
        self._law = self._robots.law
        self._step: Any = unchecked(self._law.step)
        self.schedule: Schedule = self._robots.schedule
        self._metrics = ManyMetrics([robot.experiment for robot in robots], self.schedule)
        self._kept: dict[int, Mapping[str, Array]] = {}
        self.positions: list[Array] = []
        self.failures: dict[int, Failure] = {}

    def run(self, advanced: Callable[[int], None]) -> tuple[Found, Array]:
        """Run to the end; return the metrics, each of shape (robots,), and the joint positions.

        Args:
            advanced: Called after each step with the number of robots.
        """
        with np.errstate(all="ignore"):
            first = moving = self._robots.started()
            for number in range(self.schedule.times.size):
                moving = self._advanced(number, moving, first)
                advanced(len(moving.q))
            found = self._metrics.found()
        for robot, kept in self._kept.items():
            for name, values in found.items():
                values[robot] = kept[name][robot] if name in kept else np.nan
        return found, moving.position

    def _advanced(self, number: int, before: Moving, first: Moving) -> Moving:
        """Return the robots one step later; at the last step, as they are."""
        t = float(self.schedule.times[number])
        before = self._without_failed(before, first, t)
        look = self._robots.look(number, t, before.q, self._robots.around(number))
        self._measure(look, before)
        if number + 1 == self.schedule.times.size:
            return before
        x, noise, noises = before.x, before.noise, self._robots.noises
        if self.schedule.samples[number]:
            u = self._robots.signals(look, before)
            self._robots.filter(before, t)
            x = self._stepped(t, x, u)
        if self.schedule.noises[number] and noises is not None:
            noise = noises.of_each(noises.row(t))
        after = self._without_failed(replace(before, x=x, noise=noise), first, t)
        return self._robots.moved(self._law, after, t, float(self.schedule.times[number + 1]))

    def _stepped(self, t: float, x: Array, u: Mapping[str, Array]) -> Array:
        """Return the laws' states one period later; not a number where a law has failed."""
        period = self.schedule.period
        try:
            after: Array = self._step(t, x, u, period)
            return after
        except Exception:
            # One robot may have stopped all, e.g. with a singular matrix.
            alone = [self._stepped_alone(k, t, x, u) for k in range(len(x))]
            return np.stack(alone, axis=-1).T

    def _stepped_alone(self, robot: int, t: float, x: Array, u: Mapping[str, Array]) -> Array:
        law, only = stacked([self._robots.readings[robot]]), slice(robot, robot + 1)
        seen = {name: values[only] for name, values in u.items()}
        try:
            after: Array = unchecked(law.step)(t, x[only], seen, self.schedule.period)
            return after[0]
        except Exception as error:
            reason = f"{type(law).__name__}.step raised {described(error)}"
            self.failures.setdefault(robot, Failure(t, reason))
            return np.full(x.shape[-1], np.nan)

    def _measure(self, look: Look, now: Moving) -> None:
        """Take the metrics of a step, just before what happens at its time."""
        if self._recorded:
            self.positions.append(now.position)
        observes = self._law.observables.size > 0
        self._metrics.add(self._robots.measured(self._law, look, now, observes=observes))

    def _without_failed(self, now: Moving, first: Moving, t: float) -> Moving:
        """Return robots of which those that failed, kept with their metrics, start again."""
        if np.isfinite(now.x).all() and np.isfinite(now.q).all():
            return now
        failed = ~np.isfinite(np.concatenate((now.x, now.q), axis=-1)).all(axis=-1)
        new = [robot for robot in np.flatnonzero(failed).tolist() if robot not in self._kept]
        if new:
            found = {name: values.copy() for name, values in self._metrics.found().items()}
        for robot in new:
            self._kept[robot] = found
            self.failures.setdefault(robot, Failure(t, self._reason(now, robot)))
        return restarted(now, first, failed)

    def _reason(self, now: Moving, robot: int) -> str:
        parts = self._law.state.parts.items()
        bad = [name for name, (at, _) in parts if not np.isfinite(now.x[robot, at]).all()]
        of_law = f"{type(self._law).__name__}.step: {', '.join(bad)} is no longer finite"
        return of_law if bad else "the joint positions are no longer finite"
