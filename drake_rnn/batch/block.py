"""Robots that run side by side, in the order of updates of a diagram, without a diagram."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..inputs.fields import Array
from ..inputs.own_code import described
from ..laws.called import unchecked
from ..measures import Found, RunMetrics
from .grouping import Robot
from .robots import Moving, Robots, restarted
from .schedule import Schedule
from .snapshot import Snapshot, motion_of


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
        self._delay = robots[0].experiment.path_delay
        self._metrics = RunMetrics(self._robots.yardsticks)
        # Steps whose metrics have not been taken yet, and the time of the run's first step.
        self._part: list[Snapshot] = []
        self._origin: float | None = None
        self._ends = self.schedule.part_ends(len(robots))
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
            found = self._found(self._metrics)
        for robot, kept in self._kept.items():
            for name, values in found.items():
                values[robot] = kept[name][robot] if name in kept else np.nan
        return found, moving.position

    def _advanced(self, number: int, before: Moving, first: Moving) -> Moving:
        """Return the robots one step later; at the last step, as they are."""
        t = float(self.schedule.times[number])
        before = self._without_failed(before, first, t)
        look = self._robots.look(t, before.q, self._robots.around(number))
        if self._recorded:
            self.positions.append(before.position)
        observes = self._law.observables.size > 0
        self._part.append(self._robots.measured(self._law, look, before, observes=observes))
        if number in self._ends:
            self._take_part()
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
        seen = {name: values[only] for name, values in u.items()}
        try:
            after: Array = unchecked(law.step)(t, x[only], seen, self.schedule.period)
            return after[0]
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            reason = f"{type(law).__name__}.step raised {described(error)}"
            self.failures.setdefault(robot, Failure(t, reason))
            return np.full(x.shape[-1], np.nan)

    def _take_part(self) -> None:
        """Take the metrics of a part of the runs; the next one begins with its last step."""
        self._add_part(self._metrics)
        self._part = self._part[-1:]
        self._origin = float(self.schedule.times[0])

    def _add_part(self, metrics: RunMetrics) -> None:
        metrics.add(motion_of(self._part, origin=self._origin, **self._robots.fixed))

    def _found(self, metrics: RunMetrics) -> Found:
        """Return metrics, each of shape (robots,); NaN for a robot that has none."""
        robots = (len(self._robots.readings),)
        found = {name: np.array(np.broadcast_to(v, robots)) for name, v in metrics.found().items()}
        if self._delay > 0.0:
            found["path_delay_s"] = np.full(robots, self._delay)
        return found

    def _found_so_far(self) -> Found:
        """Return the metrics until now without ending the part."""
        metrics = deepcopy(self._metrics)
        if self._part:
            self._add_part(metrics)
        return self._found(metrics)

    def _without_failed(self, now: Moving, first: Moving, t: float) -> Moving:
        """Return the robots; keep the metrics of one whose state is not finite, and restart it."""
        if np.isfinite(now.x).all() and np.isfinite(now.q).all():
            return now
        failed = ~np.isfinite(np.concatenate((now.x, now.q), axis=-1)).all(axis=-1)
        new = [robot for robot in np.flatnonzero(failed).tolist() if robot not in self._kept]
        if new:
            found = self._found_so_far()
        for robot in new:
            self._kept[robot] = found
            self.failures.setdefault(robot, Failure(t, self._reason(now, robot)))
        return restarted(now, first, failed)

    def _reason(self, now: Moving, robot: int) -> str:
        parts = self._law.state.parts.items()
        bad = [name for name, (at, _) in parts if not np.isfinite(now.x[robot, at]).all()]
        of_law = f"{type(self._law).__name__}.step: {', '.join(bad)} is no longer finite"
        return of_law if bad else "the joint positions are no longer finite"
