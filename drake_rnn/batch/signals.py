"""Signals of robots side by side: those of the arms, and those of their paths.

- The desired motion of many robots, evaluated once for all that share a path.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import AnyArray, functions_of, in_front, matvec, robots_first
from ..experiment import Experiment
from ..inputs.fields import Array
from ..paths import Motion
from ..paths.relative import displacement_of
from ..robot.rotation import product
from ..robot.screws import AtPosture, MovedPair, MovedScrews
from ..robot.task import Task, pose_of
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
