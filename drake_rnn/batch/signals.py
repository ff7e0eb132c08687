"""Signals of robots side by side: those of the arms, and those of their paths.

- The desired motion of many robots, evaluated once for all that share a path.
- What surrounds the robots of a batch: noise, surfaces, and the times of updates.
- Noise of robots side by side, with the same numbers as the blocks of a diagram.
- Elastic surfaces that many robots press on, and the forces between them.
- The times of the updates in a run: the steps that Drake's simulator would make.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays.algebra import AnyArray, functions_of, in_front, matvec, robots_first
from ..environments import ElasticSurface
from ..experiment import Experiment, ExperimentDocument
from ..features.contact import WATCH_WINDOW
from ..features.joint_noise import Samples
from ..features.sensing import BLOCK, pose_noise, sample_number
from ..inputs.fields import Array
from ..measures import Pressing
from ..measures.motion import tick_ends
from ..paths import Motion
from ..paths.path import displacement_of
from ..robot.rotation import product
from ..robot.screws import AtPosture, MovedPair, MovedScrews
from ..robot.task import Task
from ..robot.task_frame import pose_of
from ..signals import (
    AHEAD,
    ORIENTATION_OF_PATH,
    PATH_AHEAD,
    POSITION_OF_PATH,
    SIGNALS,
    MotionState,
    names_of,
)
from .grouping import contents

#: Values at a time, of each function that robots share, shape (..., functions); last the time.
Row = tuple[AnyArray, ...]

# Steps whose tables are made together.
_ROWS = 256


class Tables:
    """Desired motions at given times: their functions are called once for each time and path.

    Args:
        experiments: The robots' experiments.
        times: The times, shape (k,) [s], asked for one after the other.
        rotates: Whether orientations are asked for.
    """

    def __init__(self, experiments: Sequence[Experiment], times: Array, rotates: bool) -> None:
        self._times = times
        moving = [_moving(experiment) for experiment in experiments]
        if len(moving) == 1:
            # Of a single robot the table has all, so that a trace serves other paths as well.
            moving = [(key, _begun_at(start, path), 0.0 * start) for key, path, start in moving]
        self._start = np.stack([start for _, _, start in moving], axis=-1)
        self._positions = _TimeTables([(key, position) for key, position, _ in moving], (3,))
        self._orientations = None
        if rotates:
            turning = [_turning(experiment) for experiment in experiments]
            if len(turning) == 1:
                turning = [(key, _turned(R, turn), np.eye(3)) for key, turn, R in turning]
            self._R_start = np.stack([R for _, _, R in turning], axis=-1)
            self._orientations = _TimeTables([(key, turn) for key, turn, _ in turning], (3, 3))

    def row(self, k: int) -> Row:
        """Return what robots share at the time of that number."""
        position, time = self._positions.row(k, self._times), self._times[k]
        if self._orientations is None:
            return *position, time
        return *position, *self._orientations.row(k, self._times), time

    def rows(self) -> Row:
        """Return the same for all times, with these in front."""
        each = [self.row(k) for k in range(self._times.size)]
        return tuple(np.stack(values) for values in zip(*each, strict=True))

    def position(self, row: Row) -> tuple[Array, Array, Array]:
        """Return p_WE, v_WE and a_WE, each of shape (robots, 3), of a row in NumPy or in JAX."""
        p, v, a = self._positions.of_each(row[:3])
        return (self._start + p).T, v.T, a.T

    def time(self, row: Row) -> AnyArray:
        """Return the time along the paths [s]."""
        return row[-1]

    def orientation(self, row: Row) -> tuple[Array, Array, Array]:
        """Return R_WE, shape (robots, 3, 3), w_WE and alpha_WE, shape (robots, 3), likewise."""
        assert self._orientations is not None
        R, w, alpha = self._orientations.of_each(row[3:6])
        R_path = product(R.transpose(2, 0, 1), self._R_start.transpose(2, 0, 1))
        return R_path, w.T, alpha.T


def _moving(experiment: Experiment) -> tuple[object, Callable[[float], Motion], Array]:
    """Return what identifies a path's displacement, its function, and where it starts."""
    desired = experiment.desired
    if (displacement := displacement_of(desired)) is None:
        return id(desired), desired.position, np.zeros(3)
    path, start = displacement
    return contents(path), path.evaluate, start


def _turning(experiment: Experiment) -> tuple[object, Callable[[float], Motion], Array]:
    """Return what identifies a rotation, its function, and the orientation that it turns."""
    path = experiment.desired
    if path.turns:
        return id(path), path.orientation, np.eye(3)
    return None, _still, path.orientation(0.0)[0]


def _begun_at(start: Array, path: Callable[[float], Motion]) -> Callable[[float], Motion]:
    """Return a path that begins at a place, of its displacement."""

    def motion(t: float) -> Motion:
        p, v, a = path(t)
        return start + p, v, a

    return motion


def _turned(start: Array, turn: Callable[[float], Motion]) -> Callable[[float], Motion]:
    """Return the orientations of a path that begins at one, of its rotation."""

    def motion(t: float) -> Motion:
        R, w, alpha = turn(t)
        return product(R[None], start[None])[0], w, alpha

    return motion


def _still(t: float) -> Motion:
    return np.eye(3), np.zeros(3), np.zeros(3)


class _TimeTables:
    """Functions of time that robots share, in tables of which a part at a time is kept.

    Args:
        functions: For each robot what identifies its function, and the function.
        shape: Shape of the first of the three values of a function.
    """

    def __init__(
        self, functions: Sequence[tuple[object, Callable[[float], Motion]]], shape: tuple[int, ...]
    ) -> None:
        distinct = dict(functions)
        keys = {key: number for number, key in enumerate(distinct)}
        self._functions = list(distinct.values())
        self._which = np.array([keys[key] for key, _ in functions])
        self._shape = shape
        self._part = -1
        self._tables: list[Array] = []

    def row(self, k: int, times: Array) -> Row:
        """Return the three values of each function at the time of a number."""
        part, row = divmod(k, _ROWS)
        if part != self._part:
            self._fill(times[part * _ROWS : (part + 1) * _ROWS].tolist())
            self._part = part
        return tuple(table[row] for table in self._tables)

    def of_each(self, row: Row) -> list[AnyArray]:
        """Return the values of a row for each robot, shape (..., robots)."""
        if len(self._functions) > 1:
            return [values[..., self._which] for values in row]
        robots, xp = self._which.shape, functions_of(*row)
        return [xp.broadcast_to(values, (*values.shape[:-1], *robots)) for values in row]

    def _fill(self, times: list[float]) -> None:
        count = len(self._functions)
        shapes = (self._shape, (3,), (3,))
        self._tables = [np.empty((len(times), *shape, count)) for shape in shapes]
        for number, function in enumerate(self._functions):
            for row, t in enumerate(times):
                for table, value in zip(self._tables, function(t), strict=True):
                    table[row, ..., number] = value


SignalValues = dict[str, AnyArray]
# Signals of arms that follow from their posture and velocity.
_OF_ARMS = frozenset(names_of("joints", "kinematics"))


class Sight:
    """Signals of the arms of many robots at one step, each computed once.

    Args:
        task: Their task.
        screws: Their kinematics.
        position: Joint positions, shape (robots, n) [rad].

    Attributes:
        origin: Origins of the end effectors, shape (robots, 3) [m].
        p_WE: The same along the task's axes, shape (robots, m) [m].
        J: Jacobians of the task, shape (robots, size, n).
    """

    def __init__(self, task: Task, screws: MovedScrews | MovedPair, position: Array) -> None:
        self._axes, self._task = _axes_of(task), task
        self._moved, self.kinematics = screws, AtPosture(screws)
        self._translation = screws.J[..., self._axes, :]
        # The last joint velocities asked for, and those of the end effectors for them.
        self._moving: tuple[Array, Array] | None = None
        self.position = position
        self.origin: Array = screws.p_WE
        self.p_WE: Array = self.origin[..., self._axes]
        self.J: Array = self._translation
        if task.objectives:
            self.J = task.J(self.kinematics, position)
        elif task.with_orientation:
            self.J = _below(screws.J_omega, self._translation)

    def coordinates(self, q: Array) -> Array:
        """Return what laws see as positions, shape (robots, m); see `View.coordinates`."""
        task = self._task
        return task.coordinates(self.kinematics, q) if task.objectives else self.p_WE

    def tip_bias(self, q: Array, v: Array) -> Array:
        """Return its acceleration at constant joint velocities, shape (robots, m)."""
        if self._task.objectives:
            return self._task.bias(self.kinematics, q, v)
        return self.kinematics.Jdot_v(q, v)[..., self._axes]

    def task_J(self, q: Array) -> Array:
        """Return the Jacobians of the task, shape (robots, size, n); see `View.task_J`."""
        return self.J

    def tip_velocity(self, q: Array, v: Array) -> Array:
        """Return the velocities of the end effectors, shape (robots, m) [m/s]."""
        return matvec(self.J, v) if self._task.objectives else self.v_WE(v)

    def v_WE(self, velocity: Array) -> Array:
        """Return the same, for joint velocities, shape (robots, n) [rad/s]."""
        if self._moving is None or self._moving[0] is not velocity:
            self._moving = velocity, matvec(self._translation, velocity)
        return self._moving[1]

    def of_arms(self, names: Set[str], velocity: Array, causes: Array) -> SignalValues:
        """Return signals of the arms, by name.

        Args:
            names: Names of signals; others are left out.
            velocity: Joint velocities that are shown, shape (robots, n) [rad/s].
            causes: Joint velocities that the others follow from, likewise.
        """
        signals = {
            name: _value(name, self, self.position, velocity if name == "velocity" else causes)
            for name in names & _OF_ARMS
        }
        return signals

    @property
    def frames(self) -> dict[str, tuple[Array, Array]]:
        """Positions and orientations of the other frames that objectives are about."""
        poses = {name: pose_of(self.kinematics, self.position, name) for name in self._task.frames}
        return {name: (pose.p_WE, pose.R) for name, pose in poses.items()}

    @property
    def R_WE(self) -> Array:
        """Orientations of the end effectors, shape (robots, 3, 3)."""
        R: Array = self._moved.R_WE
        return R


class Rows(NamedTuple):
    """The desired motions at a step.

    Attributes:
        now: Those of the functions that robots share.
        ahead: The same one period later; empty if no law sees ahead.
        late: The same, earlier by the delay of the arms; empty if they are not late.
    """

    now: Row
    ahead: Row
    late: Row


class DesiredMotions:
    """Desired motions of many robots, by the names of signals.

    Args:
        tables: The motions at each step.
        ahead: The motions one period after each step; None if no law sees ahead.
        late: The motions that arms behind filters make at each step; None if they are not late.
        task: Their task.
    """

    def __init__(
        self, tables: Tables, ahead: Tables | None, late: Tables | None, task: Task
    ) -> None:
        self._tables, self._ahead, self._late = tables, ahead, late
        self._each = (tables, ahead, late)
        self._task = task

    def row(self, number: int) -> Rows:
        """Return what is known of a step."""
        return Rows(*(() if tables is None else tables.row(number) for tables in self._each))

    def rows(self) -> Rows:
        """Return the same for all steps, with these in front."""
        return Rows(*(() if tables is None else tables.rows() for tables in self._each))

    def at(self, rows: Rows, names: Set[str]) -> SignalValues:
        """Return the signals of a step, by name; position and velocity whatever the names are."""
        return self._by_name(self._tables, rows.now, names)

    def ahead(self, rows: Rows, names: Set[str]) -> SignalValues:
        """Return those of the signals that are seen ahead of time at a step."""
        if self._ahead is None:
            return {}
        names_at_instant = {AHEAD[name] for name in names & PATH_AHEAD}
        signals = self._by_name(self._ahead, rows.ahead, names_at_instant)
        return {name: signals[AHEAD[name]] for name in names & PATH_AHEAD}

    def late(self, rows: Rows, names: Set[str]) -> SignalValues:
        """Return the signals that arms behind filters should have; none if they are not late."""
        if self._late is None or not names:
            return {}
        signals = self._by_name(self._late, rows.late, names)
        return {name: value for name, value in signals.items() if name in names}

    def _by_name(self, tables: Tables, row: Row, names: Set[str]) -> SignalValues:
        view = _PathView(tables, self._task)
        wanted = [*POSITION_OF_PATH]
        if not names.isdisjoint(ORIENTATION_OF_PATH):
            wanted += ORIENTATION_OF_PATH
        return {name: _value(name, view, t=row) for name in wanted}


class _PathView:
    """What the functions of the table compute signals of paths with, each motion once.

    Args:
        tables: The motions; a row stands for the time.
        task: The task.
    """

    def __init__(self, tables: Tables, task: Task) -> None:
        self.path, self._tables, self._task = self, tables, task
        self._axes = _axes_of(task)
        self._desired: MotionState | None = None
        self._position: MotionState | None = None
        self._orientation: MotionState | None = None

    def desired(self, row: Row) -> MotionState:
        if not self._task.objectives:
            p, v, a = self.position(row)
            return p[..., self._axes], v[..., self._axes], a[..., self._axes]
        if self._desired is None:
            self._desired = self._task.desired(self, row)
        return self._desired

    def position(self, row: Row) -> MotionState:
        if self._position is None:
            self._position = self._tables.position(row)
        return self._position

    def time(self, row: Row) -> AnyArray:
        return self._tables.time(row)

    def orientation(self, row: Row) -> MotionState:
        if self._orientation is None:
            self._orientation = self._tables.orientation(row)
        return self._orientation


def _axes_of(task: Task) -> slice | list[int]:
    """Return the axes of a task as an index; a slice where they are side by side."""
    first, last = task.axes[0], task.axes[-1]
    side_by_side = last - first + 1 == len(task.axes)
    return slice(first, last + 1) if side_by_side else list(task.axes)


def _value(name: str, view: Any, q: Any = None, v: Any = None, t: Any = None) -> AnyArray:
    """Return a signal by its function in the table."""
    function = SIGNALS[name].function
    assert function is not None
    return function(view, q, v, t)


def _below(first: AnyArray, second: AnyArray) -> Array:
    """Return matrices of the rows of two, with robots side by side."""
    rows = functions_of(first).concatenate((in_front(first, 2), in_front(second, 2)))
    stack: Array = robots_first(rows, 2)
    return stack


class _Rows:
    """Samples of several noises, of which the next one asked for is usually in the same block.

    Args:
        noises: The noises.
    """

    def __init__(self, noises: Sequence[Samples]) -> None:
        self._noises = noises
        # A memo of a pure function.
        self._block, self._values = -1, np.empty(0)

    def row(self, number: int) -> Array:
        """Return the sample of that number of each noise, shape (size, noises)."""
        block, row = divmod(number, BLOCK)
        if block != self._block:
            self._values = np.stack([noise.block(block) for noise in self._noises], axis=-1)
            self._block = block
        values: Array = self._values[row]
        return values


class Noises:
    """Held noise on the joint velocities of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with dither or a disturbance of one hold.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        settings = [noise for each in documents if (noise := each.joint_noise) is not None]
        # Those that differ in size alone share their samples.
        kinds = [
            (each.section, each.course, document.seed)
            for each, document in zip(settings, documents, strict=True)
        ]
        distinct = list(dict.fromkeys(kinds))
        n = experiments[0].arm.n
        self._rows = _Rows([settings[kinds.index(kind)].samples(n, kind[-1]) for kind in distinct])
        self._which = np.array([distinct.index(kind) for kind in kinds])
        self._scale = np.array([each.scale for each in settings])
        self._hold = settings[0].hold

    def row(self, t: float) -> Array:
        """Return the noise of each seed from a time on, of standard deviation 1, (n, seeds)."""
        return self._rows.row(round(t / self._hold))

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, n) [rad/s], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T


class PoseNoise:
    """Noise of positions that are measured from outside, of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with a measured position and one period.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        seeds = [document.seed for document in documents]
        distinct = list(dict.fromkeys(seeds))
        self._rows = _Rows([pose_noise(seed) for seed in distinct])
        self._which = np.array([distinct.index(seed) for seed in seeds])
        sizes = [each.sensing and each.sensing.p_WE_noise for each in documents]
        self._scale = np.array([size or 0.0 for size in sizes])
        self._period = documents[0].period or 1.0

    def row(self, t: float) -> Array:
        """Return the noise of each seed of the sample at a time, or after it, (3, seeds)."""
        return self._rows.row(sample_number(t, self._period))[:3]

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, 3) [m], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T


class Surfaces:
    """The surface of each robot, a spring as in `drake_rnn.systems.body`.

    Args:
        experiments: The robots' experiments, each with an `ElasticSurface`.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        contacts = [each.contact for each in experiments if each.contact is not None]
        surfaces = [each.surface for each in contacts if isinstance(each.surface, ElasticSurface)]
        self._normal = np.stack([surface.normal_W for surface in surfaces], axis=-1)
        self._believed = np.stack([surface.believed_normal_W for surface in surfaces], axis=-1)
        self._stiffness = np.array([surface.stiffness for surface in surfaces])
        places = zip(contacts, experiments, strict=True)
        p_WS = [contact.place(each.arm, each.start) for contact, each in places]
        self._height = _add(self._normal * np.stack(p_WS, axis=-1))
        keys = [contents(contact.force) for contact in contacts]
        distinct = list(dict.fromkeys(keys))
        self._profiles = [contacts[keys.index(key)].force for key in distinct]
        self._which = np.array([distinct.index(key) for key in keys])
        ends = [each.document.duration for each in experiments]
        self._desired_end = np.array(
            [contact.force.at(end) for contact, end in zip(contacts, ends, strict=True)]
        )

    def row(self, t: float) -> Array:
        """Return the desired force of each profile at a time [s], shape (profiles,) [N]."""
        return np.array([profile.at(t) for profile in self._profiles])

    def press(self, row: AnyArray, p_WE: AnyArray) -> Pressing:
        """Return the forces, in NumPy or in JAX.

        Args:
            row: The desired force of each profile, shape (profiles,) [N].
            p_WE: Positions of the end effectors, shape (robots, 3) [m].
        """
        depth = self._height - _add(self._normal * p_WE.T)
        pushes = functions_of(depth).where(depth > 0.0, self._stiffness * depth, 0.0)
        force = _add(pushes * self._normal * self._normal)
        return Pressing(self._normal.T, force, row[self._which], self._desired_end)

    def signals(self, pressing: Pressing) -> dict[str, Array]:
        """Return what the laws are told of the contact, by name.

        Args:
            pressing: The forces, along the true normals.
        """
        force = pressing.force * self._normal
        return {
            "normal_WE": self._believed.T,
            "normal_force": _add(self._believed * force)[:, np.newaxis],
            "normal_force_desired": pressing.desired[:, np.newaxis],
        }


def _add(rows: AnyArray) -> AnyArray:
    """Return the sum of three rows, shape (robots,)."""
    return rows[0] + rows[1] + rows[2]


# Robots times steps of a part of the motion: more would not fit a processor's cache, fewer would
# cost more calls; and the least and the largest number of steps.
_PART, _LEAST, _MOST = 8192, 8, 64


@dataclass(frozen=True, eq=False)
class Schedule:
    """The steps of a run, which end where a law samples, a noise changes, or the run ends.

    Attributes:
        times: Time of each step, shape (k + 1,) [s]; the last is the duration.
        samples: Whether the law makes a sample at each, shape (k + 1,).
        noises: Whether the noise changes at each, shape (k + 1,).
        period: Sampling period [s].
        tick: Time for which the arm's velocity is held [s].
        window: Start and end of the time in which errors are evaluated [s]; None for all of it.
    """

    times: Array
    samples: NDArray[np.bool_]
    noises: NDArray[np.bool_]
    period: float
    tick: float
    window: tuple[float, float] | None

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """Whether each step lies in the window, shape (k + 1,)."""
        if self.window is None:
            return np.ones(self.times.size, dtype=bool)
        # Step times carry rounding errors.
        begin, end = self.window
        within = (self.times >= begin - 1e-9) & (self.times <= end + 1e-9)
        return np.asarray(within)

    def part_ends(self, robots: int) -> frozenset[int]:
        """Return the numbers of the steps that end parts of the motion, for metrics.

        A tick of the arm and of the law ends with each part. Parts of few robots have more steps.

        Args:
            robots: Number of robots.
        """
        count = min(max(_PART // robots, _LEAST), _MOST)
        tick, network_tick = (
            set(tick_ends(self.times, each, 0.0)[0].tolist()) for each in (self.tick, self.period)
        )
        ends, least = [], count
        for number in sorted(tick & network_tick):
            if number >= least:
                ends.append(number)
                least = number + count
        return frozenset((*ends, self.times.size - 1))


def schedule_of(document: ExperimentDocument) -> Schedule:
    """Return the steps of a sampled run.

    Args:
        document: Document of an experiment with a period.
    """
    assert document.period is not None
    period, noise, duration = document.period, document.joint_noise, document.duration
    samples = _multiples(period, duration)
    noises = np.empty(0) if noise is None else _multiples(noise.hold, duration)
    # Times a rounding error apart are two steps, as in Drake; a law sees the noise of the first.
    ends = [samples, noises]
    if document.environment is not None:
        # The diagram's watch of the force sensor.
        ends.append(_multiples(WATCH_WINDOW * period, duration))
    times = np.append(np.unique(np.concatenate(ends)), duration)
    tick = period
    if noise is not None and noise.moves_arm and document.filter is None:
        tick = min(noise.hold, period)
    return Schedule(
        times, np.isin(times, samples), np.isin(times, noises), period, tick, document.window
    )


def _multiples(period: float, duration: float) -> Array:
    times = np.arange(int(duration / period) + 2) * period
    return np.asarray(times[times < duration], dtype=float)
