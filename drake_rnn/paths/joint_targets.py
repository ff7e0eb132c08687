"""Joint targets with the times at which they came, read from a recording.

- Where the end effector is in the newest of some joint targets.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as File
from typing import Annotated, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.trajectories import PiecewisePolynomial

from ..errors import InvalidInputError
from ..inputs.fields import Array, Finite, Seed, Time, validated
from ..inputs.keys import Meaning
from ..inputs.messages import nearest, plural, short
from ..inputs.units import UNITS, ColumnKind, scale_of, split_unit
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from .arm_columns import split_by_arm
from .path import Motion, Path, PlacedPath
from .pieces import quintic_pieces
from .recordings import (
    CHUNK,
    ISSUED,
    MOST_ROWS,
    Choice,
    JointColumns,
    Kind,
    Points,
    RecordedCall,
    Recording,
    Table,
    chunks_of,
    joint_columns,
    read_recording,
    target_columns,
)

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.


# Rounding of times that are sums of periods [s].
_INSTANT = 1e-9
# Columns that are named in a note.
_TOLD = 8
# Ends of the range of normalised positions, and beyond which one seems to be reached, by so many
# joints; numbers up to a turn may be radians.
_RANGE, _NEAR_END, _ENDS, _TURN = 100.0, 99.0, 2, 2.0 * np.pi
# Period in which what lies between the points of a trajectory is filled in [s], at least.
_FILLED = 0.01


@dataclass(frozen=True, eq=False)
class JointTargets:
    """Joint targets of an arm and the times at which they came.

    Attributes:
        time: Times, increasing, shape (k,) [s].
        position: Targets, shape (k, n) [rad]; NaN where a source sent what is no number.
        notes: Sentences about what was taken of a file and what was not.
    """

    time: Array
    position: Array
    notes: Sequence[str] = ()

    @cached_property
    def followed_targets(self) -> "JointTargets":
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
        return np.vstack((start, self.followed_targets.position))[
            self.followed_targets.newest(times) + 1
        ]


@validated
class RecordedTargets:
    """Joint targets that were recorded."""

    file: Annotated[
        str,
        Meaning(
            "CSV file with times and a column for each joint [rad], by the joints' names or "
            "numbered, such as ``q1``; ``.yaml`` or ``.json`` of a JointTrajectory or of "
            "JointStates; ``.mcap`` with such messages; ``.parquet``; or ``.npz``. An empty entry "
            "or ``nan`` is no number; such a target came, and is not followed.",
            unit="s",
        ),
    ]
    columns: Annotated[
        str | list[str] | None,
        Meaning(
            "Columns of the joints, in the arm's order, or the name of a quantity whose first "
            "ones they are, such as ``action``; by default they are found by their names."
        ),
    ] = None
    angles: Annotated[
        Literal["radians", "degrees"],
        Meaning("Unit of the columns whose names state none."),
    ] = "radians"
    topic: Annotated[
        str | None,
        Meaning("Topic of an MCAP file; by default the only one with joint positions."),
    ] = None
    episode: Annotated[
        Seed | None,
        Meaning("Episode of a LeRobot file; by default its first one."),
    ] = None
    period: Annotated[
        Time | None,
        Meaning("Time between rows without times.", unit="s"),
    ] = None
    begin: Annotated[
        Finite | None,
        Meaning(
            "Time of the file at which the run begins; rows before are left out. By default 0, "
            "to which times since 1970 are moved.",
            unit="s",
        ),
    ] = None

    def __post_init__(self) -> None:
        self._recording  # noqa: B018 (a bad file is refused now, not during a run)

    @cached_property
    def _recording(self) -> Recording:
        choice = Choice(self.topic, self.episode, self.period, self.begin)
        recording = read_recording(self.file, choice)
        if self.begin is None or recording.points is not None:
            return recording
        if recording.calls:
            later = [call for call in recording.calls if call.time >= self.begin - _INSTANT]
            moved = [
                call._replace(time=call.time - self.begin, times=call.times - self.begin)
                for call in later
            ]
            return recording._replace(calls=moved, tables=[])
        tables = [_from(table, self.begin) for table in recording.tables]
        if not any(len(table.time) for table in tables):
            raise ValueError(f"begin: no row comes at {self.begin:g} s or later")
        return recording._replace(tables=tables)

    def of_arm(
        self,
        joints: Sequence[str],
        units: Sequence[str] | None = None,
        start: Array | None = None,
    ) -> JointTargets:
        """Return the targets in the order of an arm's joints.

        Args:
            joints: Names of the joints.
            units: Their units, ``rad`` or ``m``; by default all are rad.
            start: Posture at time 0, from which a trajectory leads to its first point, shape (n,)
                [rad]; None to begin at that point.

        Raises:
            InvalidInputError: If the columns are not those of the arm.
        """
        recording, points = self._recording, self._recording.points
        tables = recording.tables
        if recording.calls or any((np.diff(table.time) <= 0.0).any() for table in tables):
            raise InvalidInputError(
                f"targets: file {self.file}: has chunks of targets, which drake-rnn shield "
                "follows; a run follows single joint positions"
            )
        if points is not None:
            tables = [Table(points.time, points.names, points.rows[0], {}, {})]
        answers = [joint_columns(table, joints, self.columns) for table in tables]
        matches = [
            (t, c) for t, c in zip(tables, answers, strict=True) if isinstance(c, JointColumns)
        ]
        if not matches:
            self._refuse(tables, joints, answers)
        selection = matches[0][1]
        for table, each in matches:
            for name in each.names:
                if name in table.texts:
                    raise InvalidInputError(f"targets: file {self.file}: {table.texts[name]}")
        kinds = _kinds_of("positions", units or ["rad"] * len(joints))
        notes = self._notes(selection, sum(len(table.time) for table in tables), matches)
        notes += self._doubts(matches, kinds, joints)
        if points is not None:
            order = [points.names.index(name) for name in selection.names]
            scales = self._scales(selection.names, kinds, joints)
            parts = tuple(row[:, order] * scales for row in points.rows)
            time, position = fill_gaps(points._replace(rows=parts), start)
            return JointTargets(time, position, notes)
        time = np.concatenate([table.time for table, _ in matches])
        rows = [
            table.values[:, [table.names.index(x) for x in c.names]]
            * self._scales(c.names, kinds, joints)
            for table, c in matches
        ]
        sooner = np.argsort(time, kind="stable")
        return JointTargets(time[sooner], np.vstack(rows)[sooner], notes)

    @property
    def names(self) -> set[str]:
        """Names of the columns, or of the entries of targets, without units."""
        recording = self._recording
        names = [name for table in recording.tables for name in table.names]
        names += [] if recording.points is None else recording.points.names
        names += [name for call in recording.calls for name in call.joints]
        return {split_unit(name)[0] for name in names}

    def by_arm(self, joints: Mapping[str, Sequence[str]]) -> "dict[str, RecordedTargets]":
        """Return the targets of each of several arms, of whose columns the names begin with its.

        See `drake_rnn.paths.arm_columns.split_by_arm`.

        Args:
            joints: Names of the joints of each arm, by its name.

        Returns:
            Those of arms that are named, by name; empty if no column names an arm.

        Raises:
            InvalidInputError: If names are unclear.
        """
        try:
            parts = split_by_arm(self._recording, joints)
        except ValueError as error:
            raise InvalidInputError(f"targets: file {self.file}: {error}") from None
        if parts and self.columns is not None:
            raise InvalidInputError(
                "targets.columns: must be left out where columns name their arms; rename others"
            )
        targets = {}
        for arm, recording in parts.items():
            targets[arm] = own = copy(self)
            vars(own)["_recording"] = recording
        return targets

    @property
    def has_calls(self) -> bool:
        """Whether the file holds records of what a source gave, and not rows of targets."""
        return bool(self._recording.calls)

    def calls(
        self, joints: Sequence[str], units: Sequence[str], start: Array
    ) -> tuple[list[RecordedCall], Sequence[str]]:
        """Return what a source gave an arm, in the order in which it did, and what is told of it.

        Targets may be joint positions or velocities, or poses or twists of the tool, and rows may
        be chunks; see `drake_rnn.paths.recordings`.

        Args:
            joints: Names of the joints.
            units: Their units, ``rad`` or ``m``.
            start: Posture at time 0, shape (n,) [rad].

        Raises:
            InvalidInputError: If the columns are not those of the arm.
        """
        recording = self._recording
        if recording.calls:
            told = tuple(f"targets: {File(self.file).name}: {note}" for note in recording.notes)
            known: dict[tuple[Kind, tuple[str, ...]], tuple[Kind, JointColumns]] = {}
            calls = [self._checked(call, joints, units, known) for call in recording.calls]
            return calls, (*told, *self._doubts_of_calls(joints, units))
        found = "" if len(recording.tables) != 1 else self._stream(recording.tables[0], joints)
        if isinstance(found, str):
            targets = self.of_arm(joints, units, start)
            rows = zip(targets.time.tolist(), targets.position, strict=True)
            return [
                RecordedCall(t, "positions", np.array([t]), q[None]) for t, q in rows
            ], targets.notes
        kind, columns = found
        table = recording.tables[0]
        values = table.values[:, [table.names.index(name) for name in columns.names]]
        scales = self._scales(columns.names, _kinds_of(kind, units), joints)
        notes = self._notes(columns, len(table.time), [(table, columns)])
        notes += self._doubts([(table, columns)], _kinds_of(kind, units), joints)
        return self._rows_as_calls(table, kind, values * scales), notes

    def _stream(
        self, table: Table, joints: Sequence[str]
    ) -> tuple[Kind, JointColumns] | Literal[""]:
        """Return what rows that are not single joint positions are; empty if they are those."""
        found = target_columns(table, joints, self.columns)
        if isinstance(found, str):
            if found:
                raise InvalidInputError(f"targets: file {self.file}: {found}")
            return ""
        for name in found[1].names:
            if name in table.texts:
                raise InvalidInputError(f"targets: file {self.file}: {table.texts[name]}")
        is_chunked = CHUNK in table.names or ISSUED in table.names
        return found if is_chunked or found[0] != "positions" else ""

    def _rows_as_calls(self, table: Table, kind: Kind, values: Array) -> list[RecordedCall]:
        told = {
            name: table.values[:, table.names.index(name)]
            for name in (CHUNK, ISSUED)
            if name in table.names
        }
        chunks = chunks_of(told) or [slice(k, k + 1) for k in range(len(values))]
        begins = told.get(ISSUED, table.time)
        return [
            RecordedCall(float(begins[at.start]), kind, table.time[at], values[at]) for at in chunks
        ]

    def _checked(
        self,
        call: RecordedCall,
        joints: Sequence[str],
        units: Sequence[str],
        known: dict[tuple[Kind, tuple[str, ...]], tuple[Kind, JointColumns]],
    ) -> RecordedCall:
        """Return a call of an arm with its units; refused unless it has a number for each joint.

        Args:
            call: The call.
            joints: Names of the joints.
            units: Their units.
            known: Kind and columns of calls before it, by their kind and the names of all entries.
        """
        names = call.joints
        if names:
            key = call.kind, names
            if key not in known:
                known[key] = self._chosen(call, joints)
            kind, columns = known[key]
            order = [names.index(name) for name in columns.names]
            names = columns.names
            call = call._replace(kind=kind, values=call.values[:, order], joints=())
        kinds = _kinds_of(call.kind, units)
        if call.values.shape[1] != len(kinds):
            raise InvalidInputError(
                f"targets: file {self.file}: the {call.kind} at {call.time:g} s have "
                f"{plural(call.values.shape[1], 'number')} each; must be {len(kinds)}"
            )
        scales = self._scales(names or [""] * len(kinds), kinds, joints)
        return call._replace(values=call.values * scales)

    def _chosen(self, call: RecordedCall, joints: Sequence[str]) -> tuple[Kind, JointColumns]:
        """Return what the targets of a call are by the names of their entries, and which count."""
        names = call.joints
        table = Table(call.times, names, call.values, {}, {})
        # The list that columns may name is that of all entries.
        choice = [*names[: len(joints)]] if isinstance(self.columns, str) else self.columns
        found: tuple[Kind, JointColumns] | JointColumns | str
        if call.kind == "velocities":
            found = joint_columns(table, joints, choice)
        else:
            found = target_columns(table, joints, choice)
        if isinstance(found, str):
            reason = found or self._missing([table], joints)
            reason = reason or f"has not the joints {', '.join(joints)}"
            raise InvalidInputError(
                f"targets: file {self.file}: {call.kind} at {call.time:g} s: {reason}"
            )
        return (call.kind, found) if isinstance(found, JointColumns) else found

    def _scales(
        self, names: Sequence[str], kinds: Sequence[ColumnKind], joints: Sequence[str]
    ) -> Array:
        """Return the unit of each column [rad or m]."""
        degree = UNITS["angle"]["deg"] if self.angles == "degrees" else 1.0
        try:
            return np.array(
                [
                    scale_of(name, kind, joints, degree if kind.startswith("ang") else 1.0)
                    for name, kind in zip(names, kinds, strict=True)
                ]
            )
        except ValueError as error:
            raise InvalidInputError(f"targets: file {self.file}: {error}") from None

    def _notes(
        self, selection: JointColumns, rows: int, matches: Sequence[tuple[Table, JointColumns]]
    ) -> tuple[str, ...]:
        """Return one line of what was taken of the file and what was not, if there is any."""
        notes = list(self._recording.notes)
        if not selection.is_plain:
            notes.append(f"the joints are {selection.names[0]} to {selection.names[-1]}")
        others = [name for name in selection.others if name not in (CHUNK, ISSUED)]
        if others:
            some = ", ".join(others[:_TOLD])
            more = f" and {len(others) - _TOLD} more" * (len(others) > _TOLD)
            notes.append(f"{some}{more}: ignored")
        if rows_lost := rows - sum(len(table.time) for table, _ in matches):
            notes.append(f"{plural(rows_lost, 'message')} without all joints: ignored")
        return (f"targets: {File(self.file).name}: {'; '.join(notes)}",) if notes else ()

    def _doubts_of_calls(self, joints: Sequence[str], units: Sequence[str]) -> tuple[str, ...]:
        """Return the warning of `_doubts` about the first entries of calls, one for each joint."""
        calls = [call for call in self._recording.calls if call.kind == "positions"]
        n = len(joints)
        if not calls or any(call.values.shape[1] < n for call in calls):
            return ()
        names = calls[0].joints[:n] or tuple(map(str, range(n)))
        values = np.vstack([call.values[:, :n] for call in calls])
        table = Table(np.zeros(len(values)), names, values, {}, {})
        columns = JointColumns(names, (), True)
        return self._doubts([(table, columns)], _kinds_of("positions", units), joints)

    def _doubts(
        self,
        matches: Sequence[tuple[Table, JointColumns]],
        kinds: Sequence[ColumnKind],
        joints: Sequence[str],
    ) -> tuple[str, ...]:
        """Return a warning about numbers that may be shares of each joint's range, no angles."""
        unstated, largest, ends = list[str](), 0.0, 0
        for table, columns in matches:
            for name, kind in zip(columns.names, kinds, strict=True):
                if kind == "angle" and not split_unit(name, joints)[1]:
                    values = np.abs(table.values[:, table.names.index(name)])
                    most = float(np.nanmax(values, initial=0.0))
                    unstated.append(name)
                    largest, ends = max(largest, most), ends + (most >= _NEAR_END)
        if not _TURN < largest <= _RANGE:
            return ()
        is_of_lerobot = all(name.endswith(".pos") for name in unstated)
        if self.angles == "degrees" and not is_of_lerobot and ends < _ENDS:
            return ()
        return (
            f"targets: {File(self.file).name}: its numbers, up to {largest:.4g}, are within -100 "
            "to 100, which may be the ends of each joint's range, as LeRobot writes them unless "
            "use_degrees is set; such numbers are no angles: give them in degrees or radians, with "
            "[deg] or [rad] in columns' names",
        )

    def _refuse(
        self, tables: Sequence[Table], joints: Sequence[str], answers: Sequence[JointColumns | str]
    ) -> NoReturn:
        """Raise an InvalidInputError for a file that has not all joints."""
        reason = next((answer for answer in answers if isinstance(answer, str) and answer), "")
        if not reason:
            reason = self._missing(tables, joints)
        if not reason:
            numbers = ", ".join(f"q{k}" for k in range(1, len(joints) + 1))
            keys = [name for table in tables[:1] for name in table.names]
            reason = (
                f"must have the columns t, {numbers}, or the names of the "
                f"{plural(len(joints), 'joint')}, {', '.join(joints)}, not {short(['t', *keys])}"
            )
        raise InvalidInputError(f"targets: file {self.file}: {reason}")

    def _missing(self, tables: Sequence[Table], joints: Sequence[str]) -> str:
        """Return what to say of a file that names some joints; empty if it names none."""
        names = dict.fromkeys(name for table in tables for name in table.names)
        bare = [split_unit(name, joints)[0] for name in names]
        missing = [joint for joint in joints if joint not in bare]
        is_message = File(self.file).suffix.lower() in (".yaml", ".yml", ".json", ".mcap")
        if not missing or (len(missing) == len(joints) and not is_message):
            return ""
        hint = nearest(missing[0], [name for name in bare if name not in joints] or bare)
        if len(missing) == len(joints):
            return f"must name the {plural(len(joints), 'joint')}, {', '.join(joints)}; {hint}"
        what = "joint" if is_message else "column of the joint"
        return (
            f"has no {what} {missing[0]}; {hint}; all {len(joints)} joints are needed; one that is "
            "to stand still is given its place in each row, or is held by arm.lock"
        )


def _kinds_of(kind: Kind, units: Sequence[str]) -> Sequence[ColumnKind]:
    """Return what the numbers of a target are, of joints with the units ``rad`` or ``m``."""
    tool: Mapping[str, Sequence[ColumnKind]] = {
        "poses": (*("length",) * 3, *("number",) * 4),
        "twists": (*("angular velocity",) * 3, *("velocity",) * 3),
    }
    if kind in tool:
        return tool[kind]
    turning: ColumnKind = "angle" if kind == "positions" else "angular velocity"
    sliding: ColumnKind = "length" if kind == "positions" else "velocity"
    return [turning if unit == "rad" else sliding for unit in units]


def _from(table: Table, begin: float) -> Table:
    """Return the rows from a time on, which is 0 then."""
    later = table.time >= begin - _INSTANT
    time = np.maximum(table.time[later] - begin, 0.0)
    values = table.values[later]
    if ISSUED in table.names:
        values[:, table.names.index(ISSUED)] -= begin
    return replace(table, time=time, values=values)


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
        postures = np.vstack((q, self.targets.followed_targets.position))
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
        newest = int(self.targets.followed_targets.newest(np.array(t)))
        return self.p_WE[newest + 1].copy(), self._rest.copy(), self._rest.copy()

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`.

        Raises:
            InvalidInputError: Always.
        """
        raise InvalidInputError("path: joint targets are followed by the joints, not by a pose")

    def _breaks(self, until: float) -> list[Array | float]:
        return [*super()._breaks(until), self.targets.time]


def fill_gaps(points: Points, start: Array | None) -> tuple[Array, Array]:
    """Return times and positions of a trajectory, filled in as ros2_control does.

    Between two points it is a straight line, or a polynomial of degree 3 with velocities, and of
    degree 5 with accelerations. Before the first one, it leads there from rest at the start.

    Args:
        points: The points.
        start: Posture at time 0, shape (n,) [rad]; None to begin at the first point.

    Returns:
        Times, shape (k,) [s], and positions, shape (k, n) [rad].
    """
    time, rows = points.time, list(points.rows)
    if start is not None and time[0] > 0.0:
        rest = np.zeros_like(start)
        time = np.concatenate(([0.0], time))
        rows = [
            np.vstack((first, row)) for first, row in zip((start, rest, rest), rows, strict=False)
        ]
    if len(time) == 1:
        return time, rows[0]
    every = _spread(time, max(_FILLED, float(time[-1] - time[0]) / (MOST_ROWS // 2)))
    if len(rows) == 3:
        curve = quintic_pieces(time, *rows)
    elif len(rows) == 2:
        curve = PiecewisePolynomial.CubicHermite(time, rows[0].T, rows[1].T)
    else:
        curve = PiecewisePolynomial.FirstOrderHold(time, rows[0].T)
    return every, np.asarray(curve.vector_values(every)).T


def _spread(time: Array, most: float) -> Array:
    """Return times with others between them, evenly, so that none are farther apart than that."""
    gaps = np.diff(time)
    counts = np.maximum(np.ceil(gaps / most - 1e-6).astype(int), 1)
    places = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    between = np.repeat(time[:-1], counts) + places * np.repeat(gaps / counts, counts)
    return np.append(between, time[-1])
