"""Robots side by side: what they see at a step and how they move, in NumPy or in JAX arrays.

- Robots side by side at one step, and the motion that steps make.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays.algebra import AnyArray, functions_of, in_front
from ..features.obstacles import MeasuredPlaces
from ..inputs.fields import Array
from ..laws import SampledReading, Signals
from ..laws.checks import stack, start
from ..measures import Motion, Pressing, Yardsticks
from ..robot.rotation import angle_between
from ..signals import (
    DESIRED_ORIENTATION,
    DESIRED_POSITION,
    OF_EVERY_MOTION,
    PATH_AHEAD,
    POSITION_OF_PATH,
    TASK_MEASURES,
    names_of,
)
from .grouping import Filters, Robot, arm_of_all
from .signals import (
    DesiredMotions,
    Noises,
    PoseNoise,
    Rows,
    Schedule,
    Sight,
    Surfaces,
    Tables,
    schedule_of,
)


@dataclass(frozen=True)
class Snapshot:
    """Robots at the end of a step, before the updates at its time.

    Attributes:
        time: Time of the step [s].
        values: Fields of a `Motion` by name, each of shape (robots, ...).
        pressing: Contact with surfaces, without an axis of steps; None without surfaces.
        virtual: Fields of the motion of the arms that the laws see, where these are virtual.
        observed: Observables of the laws, each of shape (robots, size).
    """

    time: AnyArray
    values: dict[str, AnyArray]
    pressing: Pressing | None
    virtual: dict[str, AnyArray] | None
    observed: Signals


def motion_of(steps: Sequence[Snapshot], **fixed: Any) -> Motion:
    """Return the motion of robots over steps, shape (k, robots, ...).

    Args:
        steps: The steps.
        fixed: Fields of the motion that do not vary from step to step.
    """
    first = steps[0]
    fields = _together([step.values for step in steps])
    # A law whose velocity is the arm's has it once.
    fields.setdefault("network_velocity", fields["velocity"])
    xp = functions_of(fields["position"], first.time)
    time = xp.asarray([step.time for step in steps])
    pressing = None
    if first.pressing is not None:
        each = [step.pressing for step in steps if step.pressing is not None]
        force, desired_force = _stack([p.force for p in each]), _stack([p.desired for p in each])
        pressing = replace(first.pressing, force=force, desired=desired_force)
    virtual = None
    if first.virtual is not None:
        virtual_motion = _together([step.virtual for step in steps if step.virtual is not None])
        virtual = Motion(time=time, **_of_motion({**fields, **virtual_motion}))
    return Motion(
        time=time,
        **_of_motion(fields),
        pressing=pressing,
        virtual=virtual,
        observed=_together([step.observed for step in steps]),
        **fixed,
    )


def _of_motion(fields: Mapping[str, AnyArray]) -> dict[str, Any]:
    """Return fields of a motion, with what measures its task put together."""
    task = {each.name: fields[each.name] for each in TASK_MEASURES if each.name in fields}
    rest = {name: value for name, value in fields.items() if name not in task}
    return {**rest, "task": task}


def _together(steps: Sequence[Mapping[str, AnyArray]]) -> dict[str, AnyArray]:
    return {name: _stack([step[name] for step in steps]) for name in steps[0]}


def _stack(arrays: Sequence[AnyArray]) -> AnyArray:
    """Return arrays of steps, shape (robots, ...), as one, with robots side by side in memory."""
    xp = functions_of(*arrays)
    if xp is not np:
        return xp.stack(arrays)
    parts = np.stack([in_front(array, array.ndim - 1) for array in arrays])
    return parts.transpose(0, -1, *range(1, parts.ndim - 1))


_NOTHING: Signals = MappingProxyType({})
# Signals of the path that a motion has.
_METRIC_SIGNALS = frozenset(OF_EVERY_MOTION) & frozenset(POSITION_OF_PATH)
# Signals of the path that a law sees late if its arm is late.
_LATE = frozenset((DESIRED_POSITION, DESIRED_ORIENTATION))
# Signals of the path that a late arm is compared with.
_LATE_SIGNALS = _LATE | _METRIC_SIGNALS
_SEEN_ANYWAY = frozenset(OF_EVERY_MOTION) & frozenset(names_of("joints", "kinematics"))


@dataclass(frozen=True)
class Moving:
    """What varies in a block of robots, which lie side by side in memory.

    Attributes:
        q: Joint positions of the arms that the laws see, shape (robots, n) [rad].
        x: States of the laws, shape (robots, state.size).
        command: Joint velocities that move these, without noise, shape (robots, n) [rad/s].
        noise: Noise on these, likewise; None without dither.
        averages: States of the filters, which change in place; None without filters.
        behind: Joint positions of the arms behind the filters, if the laws see virtual arms ahead
            of these, shape (robots, n) [rad]; else None.
    """

    q: AnyArray
    x: AnyArray
    command: AnyArray
    noise: AnyArray | None
    averages: Array | None = None
    behind: AnyArray | None = None

    @property
    def position(self) -> AnyArray:
        """Joint positions of the arms themselves, shape (robots, n) [rad]."""
        return self.q if self.behind is None else self.behind

    @cached_property
    def dithered_velocity(self) -> AnyArray:
        """The commanded velocities with their noise, shape (robots, n) [rad/s]."""
        return self.command if self.noise is None else self.command + self.noise


class Around(NamedTuple):
    """What robots share of their surroundings at a step.

    Attributes:
        rows: Their desired motions.
        force: Desired forces; None without surfaces.
        seen_off: Noise of measured positions; None where these are exact.
        p_WO: How far each robot's obstacles have gone, as measured, shape (robots, m, 3) [m]; None
            if none may move.
    """

    rows: Rows
    force: AnyArray | None
    seen_off: AnyArray | None
    p_WO: AnyArray | None = None


class Look(NamedTuple):
    """What there is to see at a step.

    Attributes:
        time: Time of the step [s].
        sight: The arms.
        rows: Desired motions.
        around: Signals of paths and surfaces, by name.
        pressed: Contact with surfaces; None without these.
        seen_off: How far off the end effectors are seen, shape (robots, m) [m]; None for not.
    """

    time: float
    sight: Sight
    rows: Rows
    around: Mapping[str, AnyArray]
    pressed: Pressing | None
    seen_off: AnyArray | None


class Robots:
    """Robots whose laws differ in numbers alone.

    Args:
        robots: The robots.

    Attributes:
        schedule: Steps of their runs.
        law: Reading of a law with the numbers of all.
        noises: Their noise; None without dither.
        oriented: Whether the orientations of the paths matter.
        clearances: What each of them may touch; none if that is not looked at.
        motions: How obstacles of each move that may; None for none.
    """

    def __init__(self, robots: Sequence[Robot]) -> None:
        experiments = [robot.experiment for robot in robots]
        document = experiments[0].document
        self._experiments = experiments
        self._arm = arm_of_all(robots)
        self.schedule: Schedule = schedule_of(document)
        times, period = self.schedule.times, self.schedule.period
        self.readings = [robot.reading for robot in robots]
        self.law: SampledReading = stack(self.readings)
        self.motions = [each.motions for each in experiments]
        self._places = [
            MeasuredPlaces(each.motions, period, each.document.seed)
            for each in experiments
            if each.motions is not None and "p_WO" in self.law.inputs
        ]
        self.clearances = [each.clearance for each in experiments if each.clearance is not None]
        self._sees = frozenset(self.law.inputs.parts)
        # Observables are computed from true signals, none of them of the future.
        self._observed = (self._sees | _SEEN_ANYWAY) - PATH_AHEAD
        self.oriented = experiments[0].holds_orientation
        # Orientations of paths are evaluated only where they matter.
        self.turning = self.oriented or experiments[0].law_task.sees_turning
        turns = frozenset(("R_WE_desired",)) if self.turning else frozenset()
        self._around = self._observed | turns | _METRIC_SIGNALS
        self._model = None if document.joint_noise is None else document.joint_noise.model
        self.noises = None if document.joint_noise is None else Noises(experiments)
        self._pose_noise = None if document.sensing is None else PoseNoise(experiments)
        self._task = experiments[0].law_task
        ahead = None
        if self._sees & PATH_AHEAD:
            ahead = Tables(experiments, times + period, self.turning)
        late, delay = None, experiments[0].path_delay
        if delay > 0.0:
            late = Tables(experiments, times - delay, self.turning)
        now = Tables(experiments, times, self.turning)
        self._desired = DesiredMotions(now, ahead, late, experiments[0].task)
        # What laws see in their place, if it is another one.
        self._followed = self._desired
        if self._task.objectives:
            self._followed = DesiredMotions(now, ahead, late, self._task)
        self._filters = None if document.filter is None else Filters(experiments)
        self._surfaces = None if document.environment is None else Surfaces(experiments)

    @property
    def starts(self) -> Array:
        """Postures in which they start, shape (robots, n) [rad]."""
        return np.stack([each.start for each in self._experiments], axis=-1).T

    def start(self, beside: Signals = _NOTHING) -> Moving:
        """Return the robots at their start, with the states that their laws draw.

        Args:
            beside: What the laws see of arms beside theirs, by name.
        """
        q = self.starts
        still = np.zeros_like(q)
        look = self.look(float(self.schedule.times[0]), q, self.around(0))
        # The initial state may depend on a J that the law cannot see.
        u = {**self._view(look, still, still, beside), "J": look.sight.J}
        states = []
        for number, (experiment, reading) in enumerate(
            zip(self._experiments, self.readings, strict=True)
        ):
            rng = np.random.default_rng([experiment.document.seed, 0])
            signals = {name: np.array(values[number]) for name, values in u.items()}
            states.append(start(reading, rng, signals, 0.0))
        x = np.stack(states, axis=-1).T
        noise = None if self.noises is None else still
        first = Moving(q, x, self.law.commanded_velocity(0.0, x), noise)
        if (filters := self._filters) is None:
            return first
        if filters.apart:
            return replace(first, averages=filters.start(), behind=q)
        return replace(first, averages=filters.start(), command=still)

    def around(self, number: int) -> Around:
        """Return what is known of the surroundings at a step."""
        t = float(self.schedule.times[number])
        force = None if self._surfaces is None else self._surfaces.row(t)
        off = None if self._pose_noise is None else self._pose_noise.row(t)
        p_WO = np.stack([each.at(t) for each in self._places]) if self._places else None
        return Around(self._desired.row(number), force, off, p_WO)

    def all_around(self) -> Around:
        """Return the same for all steps, with these in front."""
        force, off, times = None, None, self.schedule.times.tolist()
        if self._surfaces is not None:
            force = np.stack([self._surfaces.row(t) for t in times])
        if self._pose_noise is not None:
            off = np.stack([self._pose_noise.row(t) for t in times])
        p_WO = None
        if self._places:
            p_WO = np.stack([np.stack([each.at(t) for each in self._places]) for t in times])
        return Around(self._desired.rows(), force, off, p_WO)

    def look(self, t: float, q: AnyArray, rows_known: Around) -> Look:
        """Return what there is to see at a step.

        Args:
            t: Its time [s].
            q: Joint positions, shape (robots, n) [rad].
            rows_known: What is known of the surroundings.
        """
        sight = Sight(self._task, self._arm.at(q), q)
        around, pressing = self._desired.at(rows_known.rows, self._around), None
        if self._surfaces is not None:
            pressing = self._surfaces.press(rows_known.force, sight.origin)
            around |= self._surfaces.signals(pressing)
        if rows_known.p_WO is not None:
            around |= {"p_WO": rows_known.p_WO}
        off = None
        if self._pose_noise is not None:
            off = self._task.position(self._pose_noise.of_each(rows_known.seen_off).T).T
        return Look(t, sight, rows_known.rows, around, pressing, off)

    def signals(self, look: Look, now: Moving, beside: Signals = _NOTHING) -> dict[str, AnyArray]:
        """Return what the laws see at a sample, by name.

        Args:
            look: What there is to see.
            now: The robots.
            beside: What the laws see of arms beside theirs, by name.
        """
        causes = now.command if self._model == "printed" else now.dithered_velocity
        return self._view(look, now.dithered_velocity, causes, beside)

    def _view(
        self, look: Look, velocity: AnyArray, causes: AnyArray, beside: Signals
    ) -> dict[str, AnyArray]:
        u = {**look.sight.of_arms(self._sees, velocity, causes), **look.around, **beside}
        if self._followed is not self._desired:
            u |= self._followed.at(look.rows, self._sees)
        u |= self._followed.ahead(look.rows, self._sees)
        if self._filters is not None and not self._filters.apart:
            u |= self._followed.late(look.rows, _LATE & self._sees)
        if look.seen_off is not None and "p_WE" in u:
            u["p_WE"] = u["p_WE"] + look.seen_off
        return {name: u[name] for name in self._sees}

    def filter(self, now: Moving, t: float) -> None:
        """Add a sample of the velocities that move the arms to the filters' states, in place."""
        if self._filters is None or now.averages is None:
            return
        velocity = self.law.commanded_velocity(t, now.x)
        if self._filters.apart:
            velocity = now.dithered_velocity if self._model == "actuated" else now.command
        self._filters.add(now.averages, velocity)

    def move(self, law: SampledReading, now: Moving, t: float, until: float) -> Moving:
        """Return the robots after they have moved as they are commanded.

        Args:
            law: Their law.
            now: The robots.
            t: Time at which they begin [s].
            until: Time at which they end [s].
        """
        h = until - t
        if self._filters is not None and now.averages is not None:
            velocity_averages = self._filters.velocity(now.averages)
            if now.behind is None:
                return replace(now, q=now.q + h * velocity_averages, command=velocity_averages)
            now = replace(now, behind=now.behind + h * velocity_averages)
        command = law.commanded_velocity(t, now.x)
        acts = now.noise if self._model == "actuated" else None
        velocity = command if acts is None else command + acts
        q = now.q + h * velocity
        if not law.holds_command:
            # Heun's method, exact for a ramp.
            command = law.commanded_velocity(until, now.x)
            q = q + 0.5 * h * ((command if acts is None else command + acts) - velocity)
        return replace(now, q=q, command=command)

    def measure(self, law: SampledReading, look: Look, now: Moving, *, observes: bool) -> Snapshot:
        """Return the values at a step that metrics use, just before the updates at its time.

        Args:
            law: Their law.
            look: What there is to see.
            now: The robots.
            observes: Whether the law's observables are among it.
        """
        state, sight = law.state, look.sight
        velocity = now.dithered_velocity if self._model == "actuated" else now.command
        signals = {**sight.of_arms(self._observed, velocity, velocity), **look.around}
        if self._followed is not self._desired:
            signals |= self._followed.at(look.rows, self._observed)
        path_signals_now = {
            **look.around,
            **self._desired.late(look.rows, _LATE_SIGNALS & self._around),
        }
        path_signals = {name: path_signals_now[name] for name in _METRIC_SIGNALS}
        if not (law.holds_command and velocity is now.command and self._filters is None):
            path_signals["network_velocity"] = state.part(now.x, "v")
        if "J_hat" in state:
            path_signals["J_hat"] = state.part(now.x, "J_hat")
        arms, virtual = self._of_arms(sight, now.q, velocity, path_signals_now, look.time), None
        if now.behind is not None and self._filters is not None and now.averages is not None:
            behind = Sight(self._task, self._arm.at(now.behind), now.behind)
            velocity_averages = self._filters.velocity(now.averages)
            virtual, arms = (
                arms,
                self._of_arms(behind, now.behind, velocity_averages, path_signals_now, look.time),
            )
        elif len(look.rows.late):
            signals[DESIRED_POSITION] = path_signals_now[DESIRED_POSITION]
        observables = law.diagnostics(look.time, now.x, signals) if observes else {}
        return Snapshot(look.time, {**path_signals, **arms}, look.pressed, virtual, observables)

    def _of_arms(
        self,
        sight: Sight,
        q: AnyArray,
        velocity: AnyArray,
        path_signals: Mapping[str, AnyArray],
        time: Any,
    ) -> dict[str, AnyArray]:
        """Return what metrics use of arms at a step, by fields of a `Motion` or of its task."""
        fields = {
            "position": q,
            "velocity": velocity,
            "p_WE": sight.p_WE,
            "v_WE": sight.v_WE(velocity),
            "J": sight.J,
        }
        if self.oriented:
            fields["orientation_error"] = angle_between(sight.R_WE, path_signals["R_WE_desired"])
        if self._task.objectives:
            R_desired = path_signals.get("R_WE_desired", sight.R_WE)
            fields |= self._task.errors(sight.origin, sight.R_WE, R_desired, time, sight.frames)
        return fields

    @cached_property
    def yardsticks(self) -> Yardsticks:
        """What the robots' motions are measured against."""
        return Yardsticks.side_by_side(
            [
                Yardsticks.of(each.limits, each.document.window, each.document.settling_tolerance_m)
                for each in self._experiments
            ]
        )

    @cached_property
    def constants(self) -> dict[str, Any]:
        """Fields of the robots' motion that do not vary from step to step."""
        experiments, until = self._experiments, float(self.schedule.times[-1])
        targets = [each.target for each in experiments if each.target is not None]
        laps = [np.nan if (lap := each.last_lap(until)) is None else lap for each in experiments]
        return {
            "target": np.stack(targets, axis=-1).T if targets else None,
            "returns": np.array([each.desired.closed for each in experiments]),
            "lap_start": np.array(laps),
            "until": until,
            "tick": self.schedule.tick,
            "network_tick": self.schedule.period,
        }


def restart(now: Moving, first: Moving, which: NDArray[np.bool_]) -> Moving:
    """Return the robots, with those selected by a mask, shape (robots,), back at their start."""

    def chosen(then: AnyArray, otherwise: AnyArray) -> AnyArray:
        return np.where(which, then.T, otherwise.T).T

    if now.averages is not None:
        # A chain at rest; the number of its samples is shared by all robots and does not matter.
        now.averages[1:, which] = 0.0
    return replace(
        now,
        q=chosen(first.q, now.q),
        x=chosen(first.x, now.x),
        command=chosen(first.command, now.command),
        behind=None if now.behind is None else chosen(first.behind, now.behind),
    )
