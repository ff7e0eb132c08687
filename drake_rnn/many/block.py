"""Robots that run side by side: the order of things of a diagram, without the diagram."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..arrays.namespace import in_front
from ..inputs.fields import Array
from ..inputs.own_code import described
from ..laws import SampledReading
from ..laws.called import unchecked
from ..laws.stacked import stacked
from ..laws.trial import started
from ..robot.screws import Screws, side_by_side
from .desired import Tables
from .grouping import Robot
from .metrics import ManyMetrics
from .noise import Noises
from .pressing import Surfaces
from .rotation import angle_between
from .schedule import Schedule, schedule_of
from .signals import PREVIEWS, Desired, Sight
from .step import Found, Pressed, Step

_SEEN_ANYWAY = frozenset(("position", "p_WE", "J", "velocity", "v_WE"))


@dataclass(frozen=True)
class Failure:
    """How a robot's run ended early.

    Attributes:
        time: When [s].
        reason: Why.
    """

    time: float
    reason: str


@dataclass(frozen=True)
class Moving:
    """What varies in a block of robots, which lie side by side in memory.

    Attributes:
        q: Joint positions, shape (robots, n) [rad].
        x: States of the laws, shape (robots, state.size).
        command: Joint velocities that the laws command, shape (robots, n) [rad/s].
        noise: Noise on these, likewise; None without dither.
    """

    q: Array
    x: Array
    command: Array
    noise: Array | None

    @cached_property
    def dithered(self) -> Array:
        """The commanded velocities with their noise, shape (robots, n) [rad/s]."""
        return self.command if self.noise is None else self.command + self.noise


class _Look(NamedTuple):
    """What there is to see at a step.

    Attributes:
        number: Number of the step.
        time: Its time [s].
        sight: The arms.
        around: Signals of paths and surfaces, by name.
        pressed: Contact with surfaces; None without these.
    """

    number: int
    time: float
    sight: Sight
    around: Mapping[str, Array]
    pressed: Pressed | None


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
        experiments = [robot.experiment for robot in robots]
        document = experiments[0].document
        self._experiments, self._recorded = experiments, recorded
        self._arm = _arm([robot.arm for robot in robots])
        self.schedule: Schedule = schedule_of(document)
        times, period = self.schedule.times, self.schedule.period
        self._readings = [robot.reading for robot in robots]
        self._law: SampledReading = stacked(self._readings)
        self._step: Any = unchecked(self._law.step)
        self._sees = frozenset(self._law.inputs.parts)
        # What observables are computed from: true signals, and none of the future.
        self._observed = (self._sees | _SEEN_ANYWAY) - PREVIEWS
        # Paths are told of their orientations only where these matter.
        turns = frozenset(("R_WE_desired",)) if experiments[0].holds_orientation else frozenset()
        self._around = self._observed | turns
        self._model = None if document.dither is None else document.dither.model
        self._noises = None if document.dither is None else Noises(experiments)
        self._task = experiments[0].task
        self._oriented = experiments[0].holds_orientation
        ahead = None
        if self._sees & PREVIEWS:
            ahead = Tables(experiments, times + period, self._oriented)
        self._desired = Desired(Tables(experiments, times, self._oriented), ahead, self._task)
        self._surfaces = None if document.environment is None else Surfaces(experiments)
        self._metrics = ManyMetrics(experiments, self.schedule)
        self._kept: dict[int, Mapping[str, Array]] = {}
        self.positions: list[Array] = []
        self.failures: dict[int, Failure] = {}

    def run(self, advanced: Callable[[int], None]) -> tuple[Found, Array]:
        """Run to the end; return the metrics, each of shape (robots,), and the joint positions.

        Args:
            advanced: Called after each step with the number of robots.
        """
        with np.errstate(all="ignore"):
            first = moving = self._started()
            for number in range(self.schedule.times.size):
                moving = self._advanced(number, moving, first)
                advanced(len(moving.q))
            found = self._metrics.found()
        for robot, kept in self._kept.items():
            for name, values in found.items():
                values[robot] = kept[name][robot] if name in kept else np.nan
        return found, moving.q

    def _started(self) -> Moving:
        """Return the robots at their start, with the states that their laws draw."""
        q = np.stack([each.start for each in self._experiments], axis=-1).T
        still = np.zeros_like(q)
        look = self._look(0, q)
        # The initial state may depend on a J that the law cannot see.
        u = {**self._signals(look, still, still), "J": look.sight.J}
        states = []
        for number, (experiment, reading) in enumerate(
            zip(self._experiments, self._readings, strict=True)
        ):
            rng = np.random.default_rng([experiment.document.seed, 0])
            seen = {name: np.array(values[number]) for name, values in u.items()}
            states.append(started(reading, rng, seen, 0.0))
        x = np.stack(states, axis=-1).T
        noise = None if self._noises is None else still
        return Moving(q, x, self._law.commanded_velocity(0.0, x), noise)

    def _advanced(self, number: int, before: Moving, first: Moving) -> Moving:
        """Return the robots one step later; at the last step, as they are."""
        t = float(self.schedule.times[number])
        before = self._without_failed(before, first, t)
        look = self._look(number, before.q)
        self._measure(look, before)
        if number + 1 == self.schedule.times.size:
            return before
        x, noise = before.x, before.noise
        if self.schedule.samples[number]:
            dithered = before.dithered
            causes = before.command if self._model == "printed" else dithered
            u = self._signals(look, dithered, causes)
            x = self._stepped(t, x, u)
        if self.schedule.noises[number] and self._noises is not None:
            noise = self._noises.at(t)
        after = self._without_failed(replace(before, x=x, noise=noise), first, t)
        return self._moved(after, t, float(self.schedule.times[number + 1]))

    def _look(self, number: int, q: Array) -> _Look:
        """Return what there is to see at a step."""
        t, sight = float(self.schedule.times[number]), Sight(self._task, self._arm.at(q), q)
        around, pressed = self._desired.at(number, self._around), None
        if self._surfaces is not None:
            pressed = self._surfaces.pressed(t, sight.origin)
            around |= self._surfaces.signals(pressed)
        return _Look(number, t, sight, around, pressed)

    def _signals(self, look: _Look, velocity: Array, causes: Array) -> dict[str, Array]:
        """Return what the laws see at a sample."""
        u = {**look.sight.of_arms(self._sees, velocity, causes), **look.around}
        u |= self._desired.ahead(look.number, self._sees)
        return {name: u[name] for name in self._sees}

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
        law, only = stacked([self._readings[robot]]), slice(robot, robot + 1)
        seen = {name: values[only] for name, values in u.items()}
        try:
            after: Array = unchecked(law.step)(t, x[only], seen, self.schedule.period)
            return after[0]
        except Exception as error:
            reason = f"{type(law).__name__}.step raised {described(error)}"
            self.failures.setdefault(robot, Failure(t, reason))
            return np.full(x.shape[-1], np.nan)

    def _moved(self, now: Moving, t: float, until: float) -> Moving:
        """Return the robots after they have moved as they are commanded."""
        law, h = self._law, until - t
        command = law.commanded_velocity(t, now.x)
        acts = now.noise if self._model == "actuated" else None
        velocity = command if acts is None else command + acts
        q = now.q + h * velocity
        if not law.holds_command:
            # Heun's method, exact for a ramp.
            command = law.commanded_velocity(until, now.x)
            q = q + 0.5 * h * ((command if acts is None else command + acts) - velocity)
        return replace(now, q=q, command=command)

    def _measure(self, look: _Look, now: Moving) -> None:
        """Take the metrics of a step, just before what happens at its time."""
        if self._recorded:
            self.positions.append(now.q)
        law, state, sight = self._law, self._law.state, look.sight
        velocity = now.dithered if self._model == "actuated" else now.command
        network = state.part(now.x, "v")
        if law.holds_command and velocity is now.command:
            network = velocity
        seen = {**sight.of_arms(self._observed, velocity, velocity), **look.around}
        told, desired = velocity.T, look.around
        turned = angle_between(sight.R_WE, desired["R_WE_desired"]) if self._oriented else None
        self._metrics.add(
            Step(
                number=look.number,
                time=look.time,
                position=now.q.T,
                velocity=told,
                network_velocity=told if network is velocity else network.T,
                p_WE=sight.p_WE.T,
                p_WE_desired=desired["p_WE_desired"].T,
                v_WE=seen["v_WE"].T,
                v_WE_desired=desired["v_WE_desired"].T,
                J=in_front(sight.J, 2),
                turned=turned,
                J_hat=in_front(state.part(now.x, "J_hat"), 2) if "J_hat" in state else None,
                observed=law.diagnostics(look.time, now.x, seen) if law.observables.size else {},
                pressed=look.pressed,
            )
        )

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
        return replace(
            now,
            q=np.where(failed, first.q.T, now.q.T).T,
            x=np.where(failed, first.x.T, now.x.T).T,
            command=np.where(failed, first.command.T, now.command.T).T,
        )

    def _reason(self, now: Moving, robot: int) -> str:
        parts = self._law.state.parts.items()
        bad = [name for name, (at, _) in parts if not np.isfinite(now.x[robot, at]).all()]
        of_law = f"{type(self._law).__name__}.step: {', '.join(bad)} is no longer finite"
        return of_law if bad else "the joint positions are no longer finite"


def _arm(arms: Sequence[Screws]) -> Screws:
    """Return the one arm that all robots have, or the arms of each."""
    return arms[0] if all(arm is arms[0] for arm in arms) else side_by_side(arms)
