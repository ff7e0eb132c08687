"""Paths through points and waypoints, given as lists or read from tables.

- Smooth curves through points that are given or read from a CSV file, open or closed.
- Tables of points, times and orientations: given as lists, or read from a CSV file.
- A motion through waypoints: positions and perhaps orientations, with times.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as File
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator
from pydrake.math import RollPitchYaw
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array, Flag, Positive, Speed, Time, Vector, rows_of_numbers, validated
from ..inputs.files import Row, is_header, read_rows, require_few
from ..inputs.keys import Meaning
from ..inputs.messages import decimal, fields_of, is_number, short
from ..inputs.units import UNITS, ColumnKind, scale_of, seconds, split_unit, time_columns
from .curve import TURN, Curve, Triple
from .pieces import Blend, blend, cubic_spline, quintic_spline, rest_to_rest
from .recordings import pose_column, require_no_recording, row_times
from .trajectory import TimedPath, align

#: Columns that a file of points may have: of positions [m], of times [s], of unit quaternions, and
#: of roll, pitch and yaw [rad].
POSITION, TIME = ("x", "y", "z"), ("t",)
QUATERNION, RPY = ("qw", "qx", "qy", "qz"), ("roll", "pitch", "yaw")
_GROUPS = (POSITION, TIME, QUATERNION, RPY)
_COLUMNS = [name for group in _GROUPS for name in group]
# What the numbers of each column are.
_KINDS: Mapping[str, ColumnKind] = {
    **dict.fromkeys(POSITION, "length"),
    **dict.fromkeys(TIME, "time"),
    **dict.fromkeys(QUATERNION, "number"),
    **dict.fromkeys(RPY, "angle"),
}
# Angles of other makers, what they are, and the columns that they are here.
_ANGLES_OF_OTHERS = {
    ("a", "b", "c"): ("the angles A, B and C of KUKA", "yaw [deg], pitch [deg], roll [deg]"),
    ("w", "p", "r"): ("the angles W, P and R of Fanuc", "roll [deg], pitch [deg], yaw [deg]"),
    ("rx", "ry", "rz"): ("a rotation vector", "qw, qx, qy, qz"),
}
# The order of a TUM trajectory, which has no names.
_TUM = (*TIME, *POSITION, "qx", "qy", "qz", "qw")
#: Points of a path: a tenth of a millimetre apart, they make ten metres.
MOST_POINTS = 100_000
# Size of a file of so many rows with eight columns [bytes]; other columns that are named in a note.
_MOST_BYTES, _TOLD = 25_000_000, 8


@dataclass(frozen=True)
class Table:
    """Rows of numbers with named columns.

    Attributes:
        rows: Number of each row in its source, for messages.
        columns: Columns by name, each of shape (k,) [s, m, rad].
        notes: Sentences about what was taken of a file and what was not.
        unstated: Columns of which the file states no unit.
    """

    rows: Sequence[int]
    columns: Mapping[str, Array]
    notes: tuple[str, ...] = ()
    unstated: frozenset[str] = frozenset()

    def group(self, names: Sequence[str]) -> Array | None:
        """Return some columns, shape (k, len(names)); None if the table has none of them."""
        if names[0] not in self.columns:
            return None
        return np.column_stack([self.columns[name] for name in names])

    @classmethod
    def of_points(cls, points: Array) -> Table:
        """Return the table of points, shape (k, 3) [m], numbered from 1."""
        return cls(range(1, len(points) + 1), dict(zip(POSITION, points.T, strict=True)))

    @property
    def points(self) -> Array:
        """Positions, shape (k, 3) [m]."""
        return np.column_stack([self.columns[name] for name in POSITION])


def parse_points(value: Any) -> Array:
    """Return points that are given as a list of rows x, y, z, read-only, shape (k, 3) [m].

    Raises:
        ValueError: If the value is no such list; the message names row and column.
    """
    rows = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(rows, (list, tuple)):
        raise ValueError("must be a list of points [x, y, z]")
    require_few(len(rows), "points", MOST_POINTS)
    points = _table(POSITION, enumerate(rows, 1), _number_in).points
    points.setflags(write=False)
    return points


def read_table(file: str) -> Table:
    """Return the table in a CSV file.

    The first line may name the columns, in any order: x, y, z; t or time; qw, qx, qy, qz, or roll,
    pitch, yaw; or as other recorders do, with units in brackets. Other columns are ignored. Without
    such a line there are three columns x, y, z, or the eight of a TUM trajectory. Times since 1970
    begin at 0.

    Raises:
        ValueError: If it cannot be read; the message names file, row and column.
    """
    require_no_recording(file)
    table = read_rows(file, _MOST_BYTES, MOST_POINTS, _of_rows)
    text = (f"{File(file).name}: {'; '.join(table.notes)}",) if table.notes else ()
    return replace(table, notes=text)


def _of_rows(rows: list[Row]) -> Table:
    first, cells = rows[0]
    if not is_header(cells):
        is_tum = len(cells) == len(_TUM)
        table = _table(_TUM if is_tum else POSITION, rows, decimal)
        return _from_zero(table) if is_tum else table
    try:
        time_names = time_columns(cells)
    except ValueError as error:
        raise ValueError(f"row {first}: {error}") from None
    names = _header(first, cells, time_names)
    places = [k for k, name in enumerate(names) if name in _COLUMNS]
    own = [names[k] for k in places]
    # A stamp in two parts is no column here.
    is_whole = len(places) == len(names)
    for row, entries in rows[1:]:
        if len(entries) != len(cells):
            *some, last = own
            numbers = f"numbers, {', '.join(some)} and {last}"
            wanted = numbers if is_whole else f"entries, not {len(entries)}"
            raise ValueError(
                f"row {row}: must {'be' if is_whole else 'have'} {len(cells)} {wanted}"
            )
    read = [k for k in places if names[k] not in TIME]
    try:
        scales = {names[k]: scale_of(cells[k], _KINDS[names[k]]) for k in read}
    except ValueError as error:
        raise ValueError(f"row {first}: {error}") from None
    notes, columns = list[str](), dict[str, Array]()
    if time_names:
        columns[TIME[0]], is_epoch = row_times(rows[1:], cells, time_names)
        notes += [_SINCE_1970] * is_epoch
    table = _table([names[k] for k in read], _choose_columns(rows[1:], read), decimal, read)
    columns |= {name: values * scales[name] for name, values in table.columns.items()}
    others = [c for n, c in zip(names, cells, strict=True) if n not in (*_COLUMNS, *time_names)]
    if others:
        notes.append(f"{', '.join(others[:_TOLD])}{' ...' * (len(others) > _TOLD)}: ignored")
    unstated = frozenset(names[k] for k in read if not split_unit(cells[k])[1])
    return Table([row for row, _ in rows[1:]], columns, tuple(notes), unstated)


def _choose_columns(rows: Iterable[Row], places: Sequence[int]) -> Iterator[Row]:
    """Yield the entries of some columns."""
    for row, cells in rows:
        yield row, [cells[k] for k in places]


def _from_zero(table: Table) -> Table:
    """Return a table whose times begin at 0 if they are since 1970."""
    time, is_epoch = seconds(table.columns[TIME[0]], None)
    columns = {**table.columns, TIME[0]: time}
    return replace(table, columns=columns, notes=(_SINCE_1970,) * is_epoch)


_SINCE_1970 = "its times since 1970 begin at 0 here"


def _header(row: int, cells: Sequence[str], time_names: Sequence[str]) -> list[str]:
    """Return the names of the columns as this module calls them; of others their own."""
    names = [
        (TIME[0] if len(time_names) == 1 else cell) if cell in time_names else pose_column(cell)[1]
        for cell in cells
    ]
    for name in names:
        if name in _COLUMNS and names.count(name) > 1:
            raise ValueError(f"row {row}: column {name} is given twice")
    _require_groups(row, cells, names)
    return names


def _require_groups(row: int, cells: Sequence[str], names: Sequence[str]) -> None:
    """Raise a ValueError unless positions are there, and orientations whole, in one form."""
    for group in _GROUPS:
        missing = [name for name in group if name not in names]
        if missing and (group is POSITION or len(missing) < len(group)):
            other = next((c for n, c in zip(names, cells, strict=True) if n not in _COLUMNS), None)
            if other is not None:
                raise ValueError(
                    f"row {row}: has no column {', '.join(missing)}; no column may be called "
                    f"{other!r}; they may be x, y, z; t or time; qw, qx, qy, qz; roll, pitch, yaw"
                )
            raise ValueError(f"row {row}: has no column {', '.join(missing)}")
    if {"qw", "roll"} <= set(names):
        raise ValueError(f"row {row}: has both quaternions and roll, pitch, yaw; give one of them")
    for angles, (what, here) in _ANGLES_OF_OTHERS.items():
        if set(angles) <= set(names) and not {"qw", "roll"} & set(names):
            raise ValueError(
                f"row {row}: {', '.join(angles)} look like {what}; give orientations as columns "
                f"{here}"
            )


def _table(
    names: Sequence[str],
    numbered_rows: Iterable[tuple[int, Any]],
    number: Callable[[Any], float],
    places: Sequence[int] | None = None,
) -> Table:
    """Return rows of numbers as a table; ``places`` are those of its columns in the source."""
    rows: list[int] = []
    table: list[list[float]] = []
    for row, cells in numbered_rows:
        if not isinstance(cells, (list, tuple, np.ndarray)) or len(cells) != len(names):
            *some, last = names
            raise ValueError(
                f"row {row}: must be {len(names)} numbers, {', '.join(some)} and {last}"
            )
        rows.append(row)
        try:
            table.append([number(cell) for cell in cells])
        except (TypeError, ValueError):
            _refuse_first(cells, row, number, places or range(len(cells)))
    values = np.array(table).reshape(-1, len(names))
    return Table(rows, dict(zip(names, values.T, strict=True)))


def _refuse_first(
    cells: Iterable[Any], row: int, number: Callable[[Any], float], places: Sequence[int]
) -> None:
    """Raise a ValueError that names the first cell that is no number."""
    for place, cell in zip(places, cells, strict=True):
        column = place + 1
        try:
            number(cell)
        except (TypeError, ValueError):
            raise ValueError(
                f"row {row}, column {column}: {short(cell)} is not a finite number"
            ) from None


def _number_in(cell: Any) -> float:
    if not is_number(cell):
        raise ValueError
    return float(cell)


# Difference between two points, relative to the extent of all, up to which they are the same.
_SAME = 1e-9


@validated
class ThroughPoints(Curve):
    """A smooth curve through given points: a cubic spline over the chord length."""

    file: Annotated[
        str | None,
        Meaning("CSV file of three columns x, y, z; give this or ``points``.", unit="m"),
    ] = None
    points: Annotated[
        Annotated[Array, BeforeValidator(parse_points)] | None,
        Meaning("Rows x, y, z, shape (k, 3); at least 2 points.", unit="m"),
    ] = None
    absolute: Annotated[
        Flag,
        Meaning(
            "Whether the points stay where they are; otherwise the curve is moved so that the "
            "first point is at the arm's start, apart from ``offset``.",
        ),
    ] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.points is None):
            raise ValueError("give either a file or points")
        if self.absolute:
            self._require_no_offset("absolute")
        self._knots  # noqa: B018 (a bad file is refused now, not during a run)

    @property
    def has_place(self) -> bool:
        """Whether the points stay where they are."""
        return self.absolute

    @cached_property
    def _knots(self) -> Array:
        """The points that the spline goes through, shape (k, 3) [m]."""
        if self.points is not None:
            return self._check(Table.of_points(self.points))
        table = self._file_table
        try:
            for group in (TIME, QUATERNION, RPY):
                if group[0] in table.columns:
                    raise ValueError(
                        f"column {group[0]}: is not used here, where period and timing say how "
                        "the curve is passed; kind: waypoints takes times and orientations"
                    )
            return self._check(table)
        except ValueError as error:
            raise ValueError(f"file {self.file}: {error}") from None

    @cached_property
    def _file_table(self) -> Table:
        return read_table(str(self.file))

    @property
    def notes(self) -> Sequence[str]:
        """See `Path.notes`."""
        return () if self.file is None else self._file_table.notes

    def _check(self, table: Table) -> Array:
        points = table.points
        same = _SAME * np.ptp(points, axis=0).max() if len(points) else 0.0
        is_repeated = np.linalg.norm(np.diff(points, axis=0), axis=1) <= same
        if is_repeated.any():
            row = table.rows[int(is_repeated.argmax()) + 1]
            raise ValueError(f"row {row}: repeats the point before it")
        if self.closed:
            return _close(points, same)
        if len(points) < 2:
            raise ValueError(f"an open curve needs at least 2 points, not {len(points)}")
        # The middle of two points is on the line between them; a spline needs three.
        return points if len(points) > 2 else np.array([points[0], points.mean(axis=0), points[1]])

    @cached_property
    def _spline(self) -> tuple[list[float], list[list[list[float]]]]:
        """Phases at the points, and the coefficients of x, y and z between them."""
        way = np.cumsum([0.0, *np.linalg.norm(np.diff(self._knots, axis=0), axis=1)])
        phase = TURN * way / way[-1]
        displacement = (self._knots - self._knots[0]).T
        spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            breaks=phase, samples=displacement, periodic_end_condition=self.closed
        )
        slope = spline.MakeDerivative(1).vector_values(phase)
        second = spline.MakeDerivative(2).vector_values(phase)
        third = np.diff(second) / np.diff(phase)
        orders = displacement[:, :-1], slope[:, :-1], second[:, :-1] / 2, third / 6
        return phase.tolist(), np.stack(orders, axis=-1).swapaxes(0, 1).tolist()

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        phases, coefficients = self._spline
        piece = min(bisect_right(phases, phase), len(coefficients)) - 1
        u = phase - phases[piece]
        p, dp, ddp = zip(
            *[
                (a + u * (b + u * (c + u * d)), b + u * (2 * c + 3 * u * d), 2 * c + 6 * u * d)
                for a, b, c, d in coefficients[piece]
            ],
            strict=True,
        )
        return p, dp, ddp

    def start_point(self, p_FE: Array) -> Array:
        """See `RelativePath.start_point`; with ``absolute`` it is the first of the points."""
        return self._knots[0].copy() if self.absolute else super().start_point(p_FE)


@validated
class Spline(ThroughPoints):
    """A smooth open curve through given points."""

    kind: Literal["spline"] = "spline"
    summary = "A smooth open curve through given points."

    @property
    def closed(self) -> bool:
        return False


@validated
class Points(ThroughPoints):
    """A smooth curve through given points, open unless it is said to be closed."""

    kind: Literal["points"] = "points"
    summary = "A smooth curve through given points, open unless it is said to be closed."
    closed: Annotated[
        Flag,
        Meaning(
            "Whether the curve leads back to its first point; it then needs at least 4 distinct "
            "points, of which the first may be repeated as the last.",
        ),
    ] = False


def _close(points: Array, same: float) -> Array:
    """Return the points of a closed curve with the first repeated as the last."""
    if len(points) and np.linalg.norm(points[-1] - points[0]) <= same:
        points = points[:-1]
    distinct = len(np.unique(points, axis=0))
    if distinct < 4:
        raise ValueError(f"a closed curve needs at least 4 distinct points, not {distinct}")
    return np.vstack([points, points[:1]])


# Difference of a quaternion's length from 1 up to which it is taken for rounding.
_ROUNDING = 1e-3
# Largest sum of a leg's blends, relative to the leg.
_FULL = 1.0 + 1e-9
# Least time between two waypoints, and the latest time of one, as of a period [s].
_SOONEST, _LATEST = 1e-3, 1e6


def _rows(width: int, what: str) -> BeforeValidator:
    """Return a validator of lists of rows of this many finite numbers."""

    def rows(value: Any) -> Array:
        if (array := rows_of_numbers(value, width)) is None:
            raise ValueError(f"must be a list of rows of {width} finite numbers, {what}")
        return array

    return BeforeValidator(rows)


@validated
class Waypoints(TimedPath):
    """A motion through waypoints, from rest to rest, passed once."""

    kind: Literal["waypoints"] = "waypoints"
    summary = "A motion through waypoints, from rest to rest, passed once."
    file: Annotated[
        str | None,
        Meaning(
            "CSV file whose first line names its columns: x, y, z; t or time [s]; orientations "
            "as qw, qx, qy, qz, or as roll, pitch, yaw [rad]. Without that line it has three "
            "columns x, y, z, or the eight of a TUM trajectory. Give this or ``positions``.",
            unit="m",
        ),
    ] = None
    positions: Annotated[
        Annotated[Array, BeforeValidator(parse_points)] | None,
        Meaning("Rows x, y, z, shape (k, 3); at least 2.", unit="m"),
    ] = None
    times: Annotated[
        Vector | None,
        Meaning(
            "Times at which the waypoints are passed, increasing, shape (k,). Give this, "
            "``period`` or ``speed``, unless the file has times.",
            unit="s",
        ),
    ] = None
    period: Annotated[
        Time | None,
        Meaning("Duration [s], shared among the legs by their length.", unit="s"),
    ] = None
    speed: Annotated[Speed | None, Meaning("Mean speed along the legs.", unit="m/s")] = None
    quaternions: Annotated[
        Annotated[Array, _rows(4, "w, x, y, z")] | None,
        Meaning("Orientations as unit quaternions, rows w, x, y, z, shape (k, 4)."),
    ] = None
    rpy: Annotated[
        Annotated[Array, _rows(3, "roll, pitch, yaw")] | None,
        Meaning("Orientations as roll, pitch and yaw about fixed axes, shape (k, 3).", unit="rad"),
    ] = None
    angles: Annotated[
        Literal["radians", "degrees"],
        Meaning("Unit of roll, pitch and yaw, unless the file states it."),
    ] = "radians"
    through: Annotated[
        Literal["quintic", "cubic", "straight"],
        Meaning(
            "``quintic`` or ``cubic``: a smooth spline through all waypoints, which rests only "
            "at the ends; ``straight``: straight legs, which rest at each waypoint unless there "
            "are blends. See `pieces` for the formulas.",
        ),
    ] = "quintic"
    blend_time: Annotated[
        Positive | None,
        Meaning("Duration of the blend at each waypoint of straight legs.", unit="s"),
    ] = None
    blend_radius: Annotated[
        Positive | None,
        Meaning("Largest distance from a waypoint at which its blend may begin or end.", unit="m"),
    ] = None
    blend: Annotated[
        Blend | None,
        Meaning("Kind of the blends, ``quintic`` or ``parabolic``."),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.positions is None):
            raise ValueError("give either a file or positions")
        if self.quaternions is not None and self.rpy is not None:
            raise ValueError("give either quaternions or rpy")
        self._check_blends()
        # Bad waypoints are refused now, not during a run.
        _ = self._interpolants

    def _check_blends(self) -> None:
        keys = [
            k for k in ("blend_time", "blend_radius", "blend") if fields_of(self)[k] is not None
        ]
        if keys and self.through != "straight":
            raise ValueError(f"{keys[0]}: only with through: straight")
        if self.blend_time is not None and self.blend_radius is not None:
            raise ValueError("give either blend_time or blend_radius")
        if keys == ["blend"]:
            raise ValueError("blend: goes with a blend_time or blend_radius")

    @property
    def _positions(self) -> Any:
        return self._interpolants[0]

    @property
    def _quaternions(self) -> Any:
        return self._interpolants[1]

    @cached_property
    def _interpolants(self) -> tuple[Any, Any]:
        """Trajectories of the positions and of the quaternions, in F; None without the latter."""
        table = self._table
        points = table.points
        if len(points) < 2:
            raise ValueError(f"a path needs at least 2 waypoints, not {len(points)}")
        times = self._times(table)
        quaternions = self._orientations(table)
        blends = self._blends(times, points)
        positions = self._interpolant(times, points, blends)
        if quaternions is None:
            return positions, None
        return positions, self._interpolant(times, align(quaternions), blends)

    @property
    def notes(self) -> Sequence[str]:
        """See `Path.notes`."""
        return self._table.notes

    @cached_property
    def _table(self) -> Table:
        if self.positions is not None:
            return Table.of_points(self.positions)
        table = read_table(str(self.file))
        for names, rivals in (
            (("t",), ("times", "period", "speed")),
            (QUATERNION, ("quaternions", "rpy")),
            (RPY, ("quaternions", "rpy")),
        ):
            for rival in rivals:
                if names[0] in table.columns and fields_of(self)[rival] is not None:
                    raise ValueError(
                        f"{rival}: the file {self.file} has a column {names[0]}; leave one out"
                    )
        return table

    def _times(self, table: Table) -> Array:
        """Return the times of the waypoints, shape (k,) [s]."""
        keys = [key for key in ("times", "period", "speed") if fields_of(self)[key] is not None]
        if "t" in table.columns:
            return _increasing(table.columns["t"], table)
        if len(keys) != 1:
            raise ValueError("give one of times, period and speed" + (", no more" if keys else ""))
        if self.times is not None:
            if self.times.size != len(table.rows):
                raise ValueError(
                    f"times: must be {len(table.rows)}, one for each waypoint, "
                    f"not {self.times.size}"
                )
            return _increasing(self.times, table)
        legs = np.linalg.norm(np.diff(table.points, axis=0), axis=1)
        if not legs.all():
            row = table.rows[int(np.argmin(legs)) + 1]
            raise ValueError(
                f"{keys[0]}: gives row {row} no time, which is where the one before it is; give "
                "times"
            )
        way = np.cumsum([0.0, *legs])
        share = way / way[-1]
        times = way / self.speed if self.speed is not None else share * (self.period or 0.0)
        return _increasing(times, table)

    def _orientations(self, table: Table) -> Array | None:
        """Return the orientations as unit quaternions, shape (k, 4); None without any."""
        quaternions = table.group(QUATERNION) if self.quaternions is None else self.quaternions
        rpy = table.group(RPY) if self.rpy is None else self.rpy
        if rpy is not None:
            if self.angles == "degrees":
                own = [self.rpy is not None or name in table.unstated for name in RPY]
                rpy = rpy * np.where(own, UNITS["angle"]["deg"], 1.0)
            _require_radians(rpy, table)
            quaternions = np.array([RollPitchYaw(*row).ToQuaternion().wxyz() for row in rpy])
        if quaternions is None:
            return None
        if len(quaternions) != len(table.rows):
            key = "quaternions" if rpy is None else "rpy"
            raise ValueError(
                f"{key}: must be {len(table.rows)}, one for each waypoint, not {len(quaternions)}"
            )
        length = np.linalg.norm(quaternions, axis=1)
        worst = int(np.argmax(np.abs(length - 1.0)))
        if abs(length[worst] - 1.0) > _ROUNDING:
            raise ValueError(
                f"row {table.rows[worst]}: a quaternion must have the length 1, not "
                f"{length[worst]:.4g}"
            )
        return np.asarray(quaternions / length[:, np.newaxis])

    def _blends(self, times: Array, points: Array) -> Array | None:
        """Return the time of the blend at each waypoint, shape (k,) [s]; None without blends."""
        if self.blend_time is not None:
            blends = np.full(times.size, self.blend_time)
        elif self.blend_radius is not None:
            blends = _round(times, points, self.blend_radius)
        else:
            return None
        share = np.full(times.size, 0.5)
        share[[0, -1]] = 1.0
        lengths = (share * blends)[:-1] + (share * blends)[1:]
        leg = int(np.argmax(lengths / np.diff(times)))
        if lengths[leg] > _FULL * (times[leg + 1] - times[leg]):
            key = "blend_radius" if self.blend_time is None else "blend_time"
            raise ValueError(
                f"{key}: the blends of leg {leg + 1} take {lengths[leg]:.4g} s, and the leg has "
                f"{times[leg + 1] - times[leg]:.4g} s; give less"
            )
        return blends

    def _interpolant(self, times: Array, values: Array, blends: Array | None) -> Any:
        if self.through == "quintic":
            return quintic_spline(times, values)
        if self.through == "cubic":
            return cubic_spline(times, values)
        if blends is None:
            return rest_to_rest(times, values)
        return blend(times, values, blends, self.blend or "quintic")


def _increasing(times: Array, table: Table) -> Array:
    """Return times that increase from 0 or later.

    Raises:
        ValueError: If they do not; the message names the row.
    """
    if times.size and times[0] < 0.0:
        raise ValueError(f"row {table.rows[0]}: the time must be 0 or more, not {times[0]:g}")
    for row, before, time in zip(table.rows[1:], times[:-1], times[1:], strict=True):
        if time == before:
            raise ValueError(f"row {row}: repeats the time {time:g} of the row before it")
        if time < before:
            raise ValueError(f"row {row}: times must increase; {time:g} comes after {before:g}")
        if time - before < _SOONEST:
            raise ValueError(
                f"row {row}: must be at least {_SOONEST:g} s after the row before it, not "
                f"{time - before:g}"
            )
        if time > _LATEST:
            raise ValueError(f"row {row}: times may be up to {_LATEST:g} s, not {time:g}")
    return times


def _require_radians(rpy: Array, table: Table) -> None:
    """Raise a ValueError for angles of more than one turn, which are degrees."""
    beyond = np.abs(rpy).max(axis=1) > 2.0 * np.pi
    if beyond.any():
        k = int(np.argmax(beyond))
        raise ValueError(
            f"row {table.rows[k] if k < len(table.rows) else k + 1}: roll, pitch and yaw are at "
            f"most one turn, 2 pi, in radians, not {rpy[k].tolist()}; for degrees give angles: "
            "degrees"
        )


def _round(times: Array, points: Array, radius: float) -> Array:
    """Return the times of blends that begin and end at most ``radius`` [m] from their waypoints."""
    duration = np.diff(times)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not length.all():
        raise ValueError(
            f"blend_radius: leg {int(np.argmin(length)) + 1} has no length; give a blend_time"
        )
    # An end's blend covers half of what its leg's rate would.
    ends = 2.0 * radius * duration[[0, -1]] / (length[[0, -1]] + radius)
    fastest = np.maximum((length / duration)[:-1], (length / duration)[1:])
    return np.concatenate((ends[:1], 2.0 * radius / fastest, ends[1:]))
