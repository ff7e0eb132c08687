"""The desired motion of many robots, evaluated once for all that share a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays.algebra import functions_of
from ..arrays.namespace import AnyArray
from ..experiment import Experiment
from ..inputs.fields import Array
from ..paths import Motion
from ..paths.relative import displacement_of
from ..robot.rotation import product
from .grouping import contents

#: Values at a time, of each function that robots share, shape (..., functions).
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
        self._start = np.stack([start for _, _, start in moving], axis=-1)
        self._positions = _Shared([(key, position) for key, position, _ in moving], (3,))
        self._orientations = None
        if rotates:
            turning = [_turning(experiment) for experiment in experiments]
            self._R_start = np.stack([R for _, _, R in turning], axis=-1)
            self._orientations = _Shared([(key, turn) for key, turn, _ in turning], (3, 3))

    def row(self, k: int) -> Row:
        """Return what robots share at the time of that number."""
        position = self._positions.row(k, self._times)
        if self._orientations is None:
            return position
        return *position, *self._orientations.row(k, self._times)

    def rows(self) -> Row:
        """Return the same for all times, with these in front."""
        each = [self.row(k) for k in range(self._times.size)]
        return tuple(np.stack(values) for values in zip(*each, strict=True))

    def position(self, row: Row) -> tuple[Array, Array, Array]:
        """Return p_WE, v_WE and a_WE, each of shape (robots, 3), of a row in NumPy or in JAX."""
        p, v, a = self._positions.of_each(row[:3])
        return (self._start + p).T, v.T, a.T

    def orientation(self, row: Row) -> tuple[Array, Array, Array]:
        """Return R_WE, shape (robots, 3, 3), w_WE and alpha_WE, shape (robots, 3), likewise."""
        assert self._orientations is not None
        R, w, alpha = self._orientations.of_each(row[3:])
        turned = product(R.transpose(2, 0, 1), self._R_start.transpose(2, 0, 1))
        return turned, w.T, alpha.T


def _moving(experiment: Experiment) -> tuple[object, Callable[[float], Motion], Array]:
    """Return what identifies a path's displacement, its function, and where it starts."""
    desired = experiment.desired
    if (shared := displacement_of(desired)) is None:
        return id(desired), desired.position, np.zeros(3)
    path, start = shared
    return contents(path), path.evaluate, start


def _turning(experiment: Experiment) -> tuple[object, Callable[[float], Motion], Array]:
    """Return what identifies a rotation, its function, and the orientation that it turns."""
    desired = experiment.desired
    if desired.turns:
        return id(desired), desired.orientation, np.eye(3)
    return None, _still, desired.orientation(0.0)[0]


def _still(t: float) -> Motion:
    return np.eye(3), np.zeros(3), np.zeros(3)


class _Shared:
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
