"""Joint targets with the times at which they came, read from a CSV file.

- Where the end effector is in the newest of some joint targets.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array, validated
from ..inputs.files import Row, is_header, read_rows
from ..inputs.keys import Meaning
from ..inputs.messages import decimal, short
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from .path import Motion, Path, PlacedPath

# No postponed annotations: see `path`.


# Targets that a file may have: a quarter of an hour of them at 100 Hz; and its size [bytes].
_MOST_TARGETS, _MOST_BYTES = 100_000, 25_000_000
# Columns beside that of times: no arm has more joints.
_MOST_JOINTS = 100
_TIMES = ("t", "time")
# Rounding of times that are sums of periods [s].
_INSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class JointTargets:
    """Joint targets of an arm and the times at which they came.

    Attributes:
        time: Times, increasing, shape (k,) [s].
        position: Targets, shape (k, n) [rad]; NaN where a source sent what is no number.
    """

    time: Array
    position: Array

    @cached_property
    def followed(self) -> "JointTargets":
        """Those that are followed: all of whose entries are numbers."""
        whole = np.isfinite(self.position).all(axis=1)
        return JointTargets(self.time[whole], self.position[whole])

    def turned(
        self, start: Array, endless: NDArray[np.bool_], limits: JointLimits
    ) -> "JointTargets":
        """Return the same targets, of endless joints always the turn nearest to the one before.

        Args:
            start: Posture before any, shape (n,) [rad].
            endless: Which joints turn without end, shape (n,).
            limits: Limits of the joints.
        """
        if not endless.any():
            return self
        whole = np.isfinite(self.position).all(axis=1)
        position, near = self.position.copy(), start
        for row in np.flatnonzero(whole):
            position[row] = near = limits.nearest_turn(position[row], near, endless)
        return JointTargets(self.time, position)

    def newest(self, times: Array) -> NDArray[np.intp]:
        """Return the number of the newest target at each time [s], shape (s,); -1 before any."""
        return np.searchsorted(self.time, np.asarray(times) + _INSTANT, side="right") - 1

    def goals(self, times: Array, start: Array) -> Array:
        """Return the newest target that is followed at each time, shape (s, n) [rad].

        Args:
            times: Times, shape (s,) [s].
            start: Posture before any, shape (n,) [rad].
        """
        return np.vstack((start, self.followed.position))[self.followed.newest(times) + 1]


@validated
class RecordedTargets:
    """Joint targets that were recorded."""

    file: Annotated[
        str,
        Meaning(
            "CSV file: times ``t`` [s], increasing from 0 or later, and a column for each joint "
            "[rad], called ``q1``, ``q2`` ... or by the joints' names. An empty entry or ``nan`` "
            "is no number; such a target came, and is not followed.",
            unit="s",
        ),
    ]

    def __post_init__(self) -> None:
        self._table  # noqa: B018 (a bad file is refused now, not during a run)

    @cached_property
    def _table(self) -> tuple[list[str], Array]:
        """Names of the joints, and rows of times and targets."""
        return read_rows(self.file, _MOST_BYTES, _MOST_TARGETS, _of_rows)

    def of_arm(self, joints: Sequence[str]) -> JointTargets:
        """Return the targets in the order of an arm's joints.

        Args:
            joints: Names of the joints.

        Raises:
            InvalidInputError: If the columns are not those of the arm.
        """
        names, rows = self._table
        numbered = [f"q{k}" for k in range(1, len(joints) + 1)]
        for known in (list(joints), numbered):
            if sorted(known) == sorted(names):
                return JointTargets(rows[:, 0], rows[:, [1 + names.index(k) for k in known]])
        raise InvalidInputError(
            f"targets: file {self.file}: must have the columns t, {', '.join(numbered)}, or the "
            f"names of the {len(joints)} joints, {', '.join(joints)}, not {short(['t', *names])}"
        )


def _of_rows(rows: list[Row]) -> tuple[list[str], Array]:
    """Return the names of the joints, and the times and targets, shape (k, 1 + n)."""
    first, cells = rows[0]
    if len(cells) > 1 + _MOST_JOINTS:
        raise ValueError(
            f"row {first}: has {len(cells)} columns, and may have {1 + _MOST_JOINTS}: t, and one "
            "per joint"
        )
    names = [f"q{k}" for k in range(1, len(cells))]
    if is_header(cells):
        names, rows = _header(first, cells), rows[1:]
    if not names:
        raise ValueError(f"row {first}: must have the columns t, and one per joint")
    if not rows:
        raise ValueError("has no targets")
    table = np.array([_numbers(row, cells, names) for row, cells in rows])
    if table[0, 0] < 0.0:
        raise ValueError(f"row {rows[0][0]}: t must be 0 or later, not {table[0, 0]:g}")
    late = np.diff(table[:, 0]) <= 0.0
    if late.any():
        k = int(late.argmax())
        raise ValueError(
            f"row {rows[k + 1][0]}: t must be greater than {table[k, 0]:g}, that of the row "
            f"before, not {table[k + 1, 0]:g}"
        )
    table.setflags(write=False)
    return names, table


def _header(row: int, cells: list[str]) -> list[str]:
    """Return the names of the joints."""
    if cells[0].lower() not in _TIMES:
        raise ValueError(f"row {row}: the first column must be t, not {cells[0]!r}")
    for name in cells[1:]:
        if cells.count(name) > 1:
            raise ValueError(f"row {row}: column {name} is given twice")
    return cells[1:]


def _numbers(row: int, cells: list[str], names: list[str]) -> list[float]:
    """Return time and targets of a row."""
    if len(cells) != 1 + len(names):
        raise ValueError(
            f"row {row}: must have {1 + len(names)} entries, t and one per joint, not {len(cells)}"
        )
    found = []
    for column, cell in enumerate(cells, 1):
        if column > 1 and cell.lower() in ("", "nan"):
            found.append(np.nan)
            continue
        try:
            found.append(decimal(cell))
        except ValueError:
            what = "a finite number" if column == 1 else "a finite number, nor nan"
            raise ValueError(f"row {row}, column {column}: {short(cell)} is not {what}") from None
    return found


# No postponed annotations: see `path`.


@dataclass(frozen=True, eq=False)
class TargetPath(Path):
    """The end effector in the newest joint target that is followed: a place that jumps.

    It depends on all of an arm, and is placed by an arm's kinematics.

    Attributes:
        targets: The joint targets.
    """

    targets: JointTargets

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        """See `Path.placed`.

        Raises:
            InvalidInputError: Always, as a pose says nothing of other postures.
        """
        raise InvalidInputError("path: joint targets are placed by an arm, not by a pose")

    def placed_by(self, kinematics: ArmKinematics, q: Array) -> PlacedPath:
        """See `Path.placed_by`."""
        postures = np.vstack((q, self.targets.followed.position))
        return PlacedTargets(self.targets, np.array([kinematics.p_WE(each) for each in postures]))


@dataclass(frozen=True, eq=False)
class PlacedTargets(PlacedPath):
    """A `TargetPath` of an arm.

    Attributes:
        targets: The joint targets.
        p_WE: Place of the end effector at the start and in each target that is followed, shape
            (k + 1, 3) [m].
    """

    targets: JointTargets
    p_WE: Array
    _rest: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def duration(self) -> float:
        """See `Passage.duration`; the time at which the last target came."""
        return float(self.targets.time[-1])

    @property
    def oriented(self) -> bool:
        """See `PlacedPath.oriented`; it is not, since joints alone are followed."""
        return False

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`; between targets it rests."""
        if not np.isfinite(t):
            raise InvalidInputError(f"t: must be finite, not {t}")
        newest = int(self.targets.followed.newest(np.array(t)))
        return self.p_WE[newest + 1].copy(), self._rest.copy(), self._rest.copy()

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`.

        Raises:
            InvalidInputError: Always.
        """
        raise InvalidInputError("path: joint targets are followed by the joints, not by a pose")

    def _breaks(self, until: float) -> list[Array | float]:
        return [*super()._breaks(until), self.targets.time]
