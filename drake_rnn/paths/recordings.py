"""Recordings of joint positions as other tools write them.

- CSV, with the headers of other recorders.
- Messages of ROS in YAML or JSON, trajectory_msgs/JointTrajectory and sensor_msgs/JointState.
- MCAP with such messages, or with chunks of targets as JSON.
- Parquet, as LeRobot and pandas write it, and arrays of NumPy.
- Chunks of targets: rows with the number of a chunk or when it came, or records of calls.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.documents import list_of, number_of, numbers_of, records_of
from ..inputs.fields import Array
from ..inputs.files import (
    Row,
    arrays_of,
    heads_of,
    is_file,
    is_header,
    json_of,
    open_regular,
    read_rows,
    require_few,
    require_readable,
)
from ..inputs.messages import decimal, given_twice, is_number, plural, short
from ..inputs.packages import import_extra, import_name
from ..inputs.units import (
    ColumnKind,
    factor_of,
    scale_of,
    seconds,
    split_unit,
    time_columns,
    time_in,
    time_unit,
)

#: Rows that a recording may have: a quarter of an hour at 100 Hz; its size as text [bytes].
MOST_ROWS, _MOST_BYTES = 100_000, 25_000_000
# Size of a file of YAML, of which a megabyte takes about a second [bytes].
_MOST_RECORDS = 5_000_000
# Columns of a table, and size of a binary file, of which only some messages are read [bytes].
_MOST_COLUMNS, _MOST_BINARY = 1000, 100_000_000_000
# Numbers of the columns of a table that are read, of a part of its file and of all that is kept:
# a few bytes of it may stand for any number of them. What is packed into them [bytes a number].
_MOST_NUMBERS, _MOST_PACKED = 20_000_000, 16
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")
# Columns that name those of positions, as rostopic writes them.
_NAMES = re.compile(r"(.*)name(\W?\d+\W?)")
# Words of columns that are no joint positions, and of those that are commands.
_OTHER = re.compile(
    r"velocit|torque|effort|accelerat|temperature|voltage|error"
    r"|(?:^|[^a-z])(?:vel|speeds?|acc|jerk|tau|moments?|currents?|temp|volts?|forces?|wrench|tcp"
    r"|poses?|cartesian|delta|noise|limits?|name|d+q|qd+|eef|ee)(?:[^a-z]|$)"
)
_COMMAND = re.compile(r"target|command|cmd|action|desired|goal|reference|setpoint")


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of numbers, each row with its time.

    Attributes:
        time: Times, shape (k,) [s].
        names: Names of the columns, unit included.
        values: The columns, shape (k, c); NaN where a source sent no number.
        series: Columns that are one quantity, by its name, in order.
        texts: What is said of columns that are no numbers, by name.
    """

    time: Array
    names: tuple[str, ...]
    values: Array
    series: Mapping[str, tuple[str, ...]]
    texts: Mapping[str, str]


class Points(NamedTuple):
    """Points of a trajectory, between which it is filled in.

    Attributes:
        names: Names of the joints.
        time: Times, shape (k,) [s].
        rows: Positions and, if they are given, velocities and accelerations, each of shape (k, n).
        notes: What is told of the rest.
    """

    names: tuple[str, ...]
    time: Array
    rows: tuple[Array, ...]
    notes: tuple[str, ...] = ()


#: What targets are.
Kind = Literal["positions", "velocities", "poses", "twists"]


class RecordedCall(NamedTuple):
    """What a source gave at a time: a target, or a chunk of them.

    Attributes:
        time: When it was given [s].
        kind: What the targets are.
        times: Times that they are for, increasing, shape (k,) [s].
        values: The targets, shape (k, w).
        joints: Names of the joints that they are of, in their order; empty for all of an arm in its
            own order, and for targets of the tool.
    """

    time: float
    kind: Kind
    times: Array
    values: Array
    joints: tuple[str, ...] = ()


#: What targets may be, with the names of the columns of those that are the tool's.
TARGET_KINDS: Mapping[Kind, tuple[str, ...]] = {
    "positions": (),
    "velocities": (),
    "poses": ("x", "y", "z", "qw", "qx", "qy", "qz"),
    "twists": ("wx", "wy", "wz", "vx", "vy", "vz"),
}
# Columns that are named in a message.
_TOLD = 8
# So many columns of a kind say that it is meant.
_SOME = 3
#: Columns that say which rows are one chunk: its number, and when it came [s].
CHUNK, ISSUED = "chunk", "issued"
# By which other names these go, in small letters.
_CHUNK_NAMES = {"chunk", "chunk_id", "chunk_index"}
_ISSUED_NAMES = {"issued", "issued_at", "issue_time", "time_issued", "t_issued"}


class Recording(NamedTuple):
    """What a file holds: tables of rows, a trajectory's points or calls; and what is told of it."""

    tables: Sequence[Table]
    points: Points | None
    notes: Sequence[str]
    calls: Sequence[RecordedCall] = ()


class Choice(NamedTuple):
    """What a user says of a recording.

    Attributes:
        topic: Topic of messages.
        episode: Number of an episode.
        period: Time between rows without times [s].
        begin: Time at which the run begins [s].
    """

    topic: str | None = None
    episode: int | None = None
    period: float | None = None
    begin: float | None = None


def read_recording(file: str, choice: Choice) -> Recording:
    """Return what a file holds, as its ending says.

    Raises:
        ValueError: If it cannot be read; the message names the file.
        InvalidInputError: If a package that reads it is not installed.
    """
    require_readable(file)
    ending = Path(file).suffix.lower()
    if ending not in _READERS:
        return read_rows(file, _MOST_BYTES, MOST_ROWS, lambda rows: _of_rows(rows, choice))
    try:
        return _READERS[ending](Path(file), choice)
    except OSError as error:
        raise ValueError(f"file {file}: cannot be read: {error.strerror}") from None
    except InvalidInputError:
        raise
    except ValueError as error:
        raise ValueError(f"file {file}: {error}") from None


def require_no_recording(file: str) -> None:
    """Raise a ValueError for a file of joint positions of another tool, where a table is wanted."""
    require_readable(file)
    if Path(file).suffix.lower() in _READERS:
        raise ValueError(
            f"file {file}: must be a file of comma-separated values; recorded joint positions, "
            "such as a JointTrajectory, are given in targets"
        )


def _bag(file: Path, choice: Choice) -> Recording:
    raise ValueError("is a bag of ROS; convert it to MCAP, by ros2 bag convert or mcap convert")


# Columns.


_SINCE_1970 = "its times since 1970 begin at 0 here"


def require_increasing(time: Array, rows: Sequence[int], begin: float | None = None) -> None:
    """Raise a ValueError unless times increase, and from 0 on if no time is said to be the first.

    Args:
        time: Times, shape (k,) [s].
        rows: Their numbers in the file.
        begin: The first time that counts [s].
    """
    if not np.isfinite(time).all():
        raise ValueError(f"row {rows[int(np.isfinite(time).argmin())]}: t is no finite number")
    if begin is None and time[0] < 0.0:
        raise ValueError(f"row {rows[0]}: t must be 0 or later, not {time[0]:g}")
    late = np.diff(time) <= 0.0
    if late.any():
        k = int(late.argmax())
        raise ValueError(
            f"row {rows[k + 1]}: t must be greater than {time[k]:.12g}, that of the row before, "
            f"not {time[k + 1]:.12g}"
        )


def _with_chunks(columns: dict[str, Array], zero: float | None) -> dict[str, Array]:
    """Return columns of which those that tell of chunks have their names here.

    Args:
        columns: The columns.
        zero: The first time, of times since 1970 which are from 0 on here; else None.
    """
    result = {}
    for name, values in columns.items():
        bare = split_unit(name)[0].lower()
        if bare in _ISSUED_NAMES:
            unit = scale_of(name, "time")
            if zero is not None:
                values = seconds(np.concatenate(((zero,), values)), None)[0][1:]
            result[ISSUED] = values if zero is not None else values * unit
        elif bare in _CHUNK_NAMES:
            result[CHUNK] = values * scale_of(name, "number")
        else:
            result[name] = values
    return result


def chunks_of(columns: Mapping[str, Array]) -> list[slice]:
    """Return the rows of each chunk, by its number or when it came; none without such a column.

    Raises:
        ValueError: If one of them is no number, or chunks come in another order than in the file.
    """
    telling = [columns[name] for name in (CHUNK, ISSUED) if name in columns]
    if not telling:
        return []
    keys = np.column_stack(telling)
    bad = ~np.isfinite(keys).all(axis=1)
    if bad.any():
        raise ValueError(f"target {int(bad.argmax()) + 1}: its chunk is no number")
    begins = [0, *(np.flatnonzero((np.diff(keys, axis=0) != 0.0).any(axis=1)) + 1), len(keys)]
    if ISSUED in columns:
        issued = columns[ISSUED][begins[:-1]]
        if (np.diff(issued) < 0.0).any():
            k = int((np.diff(issued) < 0.0).argmax()) + 1
            raise ValueError(
                f"chunk {k + 1} of the file: {ISSUED} must not decrease, from {issued[k - 1]:g} to "
                f"{issued[k]:g} s; chunks stand in the order in which they came"
            )
    return [slice(int(a), int(b)) for a, b in pairwise(begins)]


def _require_order(
    time: Array, columns: Mapping[str, Array], rows: Sequence[int], begin: float | None
) -> None:
    """Raise a ValueError unless times increase, those of chunks in each of them."""
    for at in chunks_of(columns) or [slice(None)]:
        require_increasing(time[at], rows[at], begin)


class JointColumns(NamedTuple):
    """The columns of an arm's joints, in its order; others; and whether their names say so."""

    names: tuple[str, ...]
    others: tuple[str, ...]
    is_plain: bool


def joint_columns(table: Table, joints: Sequence[str], choice: Any) -> JointColumns | str:
    """Return the columns of an arm's joints, or what is wrong.

    Columns whose names tell of the tool, or of differences, are never taken for joints.

    Args:
        table: The table.
        joints: Names of the joints.
        choice: Names of the columns, or of a series, of which the first ones count; None to find
            them by their names.
    """
    names = table.names
    if choice is not None:
        found = _columns_by_name(table, len(joints), choice)
    elif set(joints) <= set(names):
        return JointColumns(tuple(joints), tuple(x for x in names if x not in joints), True)
    else:
        found = _columns_of_joints(table, joints)
        if isinstance(found, JointColumns) and (text := _beside_commands(table, joints, found)):
            return text
    if isinstance(found, JointColumns):
        return _of_tool(found.names, joints) or found
    told = [*map(_of_tool, table.series.values()), _of_tool(names, least=_SOME)]
    return next(filter(None, told), found)


def _columns_of_joints(table: Table, joints: Sequence[str]) -> JointColumns | str:
    """Return the columns that are called as joints are, those with units of positions first."""
    names, n = table.names, len(joints)
    bare = {name: split_unit(name, joints)[0] for name in names}
    positions = {name: each for name, each in bare.items() if _may_be_position(name, joints)}
    for own in (positions, bare):
        for groups in (_match_names(own, joints), _of_size(own, table, n)):
            ranking = sorted((_rank(*stem), columns) for stem, columns in groups.items())
            best = list(dict.fromkeys(c for rank, c in ranking if rank == ranking[0][0]))
            if len(best) > 1:
                text = " or ".join(f"{columns[0]} ..." for columns in best[:4])
                return f"columns: must be given, as the joints may be {text}"
            if best:
                columns = best[0]
                if missing := _missing([bare[name] for name in columns], joints):
                    return (
                        f"columns: must be given, as {columns[0]} ... have names of some joints, "
                        f"and none of {', '.join(missing)}"
                    )
                for name in columns:
                    same = [each for each in own if own[each] == own[name]]
                    if len(same) > 1:
                        text = " or ".join(same)
                        return f"columns: must be given, as {own[name]} may be {text}"
                others = tuple(x for x in names if x not in columns)
                return JointColumns(tuple(columns), others, ranking[0][0] == 0)
    return next(
        (
            _not_called(stem, columns, joints)
            for stem, columns in table.series.items()
            if len(columns) == n and not _OTHER.search(stem.lower())
        ),
        "",
    )


def _not_called(stem: str, columns: Sequence[str], joints: Sequence[str]) -> str:
    """Return what to say of a list that may be the joints, by other names."""
    return (
        f"columns: must be given, as the entries of {stem}, "
        f"{', '.join(_inner(stem, columns))}, are not called as the arm's joints, "
        f"{', '.join(joints)}; {stem} takes them in this order"
    )


def _beside_commands(table: Table, joints: Sequence[str], found: JointColumns) -> str:
    """Return what to say of joints that are measured, beside what is commanded; empty if not so.

    Such as a data set's `observation.state`, whose `action` are poses of the tool.
    """
    commands = [name for name in table.names if _COMMAND.search(name.lower())]
    in_list = any(set(found.names) <= set(columns) for columns in table.series.values())
    if (found.is_plain and not in_list) or set(found.names) & set(commands):
        return ""
    if told := _of_tool(commands):
        return told
    velocities = _velocity_columns(table, joints)
    for stem, columns in table.series.items():
        is_motion = not _OTHER.search(stem.lower()) and len(columns) >= len(joints)
        if _COMMAND.search(stem.lower()) and (is_motion or velocities == tuple(columns)):
            text = f", and {found.names[0]} ... are not what is commanded"
            return _not_called(stem, columns, joints) + text
    return ""


def _may_be_position(name: str, joints: Sequence[str]) -> bool:
    """Return whether a column states no unit, or one of an angle or a length."""
    unit = split_unit(name, joints)[1]
    kinds: tuple[ColumnKind, ColumnKind] = ("angle", "length")
    return not unit or any(factor_of(unit, kind) is not None for kind in kinds)


# Words of the names of a tool's motion: what tells of it, and what may be beside that.
_AXIS_WORDS = {
    *("x", "y", "z", "roll", "pitch", "yaw"),
    *(f"{kind}{axis}" for kind in "dpqrtvw" for axis in "xyz"),
    *("qw", "droll", "dpitch", "dyaw"),
}
_BESIDE_AXES = {
    *("delta", "d", "rel", "relative", "ee", "eef", "tcp", "tool", "hand", "end", "effector"),
    *("cartesian", "cart", "world", "base", "robot", "arm", "left", "right", "l", "r"),
    *("target", "goal", "cmd", "command", "action", "actions", "state", "observation", "field"),
    *("pose", "pos", "position", "translation", "trans", "linear", "lin", "vel", "velocity"),
    *("rot", "rotation", "ori", "orientation", "angular", "ang", "axis", "angle", "euler", "quat"),
}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def _words(name: str) -> set[str]:
    return {word.lower() for word in _WORD.findall(split_unit(name)[0])}


def _of_tool(names: Sequence[str], joints: Sequence[str] = (), least: int = 2) -> str:
    """Return what to say of columns of the tool, or of differences; empty if these are few.

    Args:
        names: Names of the columns.
        joints: Names of the joints that they are taken for; an axis may be in a joint's own name.
        least: Number of columns that tell of it, at least; and at least half of all.
    """
    by_joint = dict(zip(names, map(_words, joints), strict=False))
    telling, every = list[str](), set[str]()
    for name in names:
        words = _words(name)
        axes, own = words & _AXIS_WORDS, by_joint.get(name, set())
        is_of_tool = bool(axes - own) and words <= _AXIS_WORDS | _BESIDE_AXES
        if is_of_tool or (joints and {"delta", "relative"} & (words - own)):
            telling.append(name)
            every |= words
    # A wrist may roll, pitch and yaw by joints of these names.
    places = _AXIS_WORDS - {"roll", "pitch", "yaw"} | {"delta", "relative"}
    if len(telling) < max(least, len(names) / 2) or not every & places:
        return ""
    return (
        f"the columns {', '.join(telling[:_TOLD])} are by their names a pose or a motion of the "
        "tool, or differences, not positions of joints; drake-rnn shield follows poses, by "
        f"{', '.join(TARGET_KINDS['poses'])}, and twists, {', '.join(TARGET_KINDS['twists'])}; "
        "a path of waypoints takes poses in a CSV file"
    )


def _inner(stem: str, columns: Sequence[str]) -> list[str]:
    """Return the names of the entries of a list within the name of the list."""
    return [name.removeprefix(stem).lstrip(".") for name in columns]


# Entries of a list that may be joints of any arm: without names, numbered, or LeRobot's positions.
_ANY_JOINT = re.compile(r"\[\d+\]|.*\d.*|.*[._]pos(ition)?")


def _missing(columns: Sequence[str], joints: Sequence[str]) -> list[str]:
    """Return the joints whose names no columns have although they have those of others."""
    ends = {name for column in columns for name in (column, re.split(r"[./]", column)[-1])}
    ends |= {name.removesuffix(".pos") for name in ends}
    missing = [joint for joint in joints if joint not in ends]
    return missing if len(missing) < len(joints) else []


_VELOCITY = re.compile(r"(?:^|[^a-z])(?:v|dq|qd|q_?dot|vel|velocity|velocities|speeds?)(?![a-z])")


def target_columns(
    table: Table, joints: Sequence[str], choice: Any
) -> tuple[Kind, JointColumns] | str:
    """Return what the targets of a table are, of `TARGET_KINDS`, and their columns; or `str`.

    Args:
        table: The table.
        joints: Names of the arm's joints.
        choice: See `joint_columns`.
    """
    found, velocities = joint_columns(table, joints, choice), _velocity_columns(table, joints)
    if isinstance(found, JointColumns) and (found.names != velocities or choice is not None):
        return "positions", found
    own = _tool_columns(table)
    groups: dict[Kind, tuple[str, ...]] = {"velocities": velocities}
    tool_kinds: tuple[Kind, Kind] = ("poses", "twists")
    for kind in tool_kinds:
        whole = [each for each in own.values() if set(TARGET_KINDS[kind]) <= set(each)]
        every = [name for each in whole for part in TARGET_KINDS[kind] for name in each[part]]
        if len(every) > len(TARGET_KINDS[kind]):
            return f"has several columns of {kind}, {short(every)}; leave those of the tool"
        groups[kind] = tuple(every)
    there = {kind: names for kind, names in groups.items() if names}
    if len(there) > 1:
        return f"columns: must be given, as targets may be {' or '.join(there)}"
    for kind, names in there.items():
        others = tuple(x for x in table.names if x not in names and x not in (CHUNK, ISSUED))
        return kind, JointColumns(names, others, True)
    reason, plain = found if isinstance(found, str) else "", own.get("", {})
    known = {name for names in TARGET_KINDS.values() for name in names}
    has_other_axes = any(_words(name) & _AXIS_WORDS for name in plain.keys() - known)
    return reason if reason and has_other_axes else _incomplete(plain) or reason


# What other recorders call the columns of poses.
_AXES = re.compile(
    r"(?:t|p|pos|p_|pos_|p_we_|p_rs_r_|((?:.*[./_])?)(?:position|translation)[./_])([xyz])"
)
_TURNS = re.compile(r"(?:q_|quat_|rot_|q_rs_|((?:.*[./_])?)(?:orientation|rotation)[./_])([xyzw])")


def pose_column(name: str) -> tuple[str, str]:
    """Return of what a column's name tells, and the column as it is called here: x or qw.

    Other names are in small letters, and of nothing.
    """
    bare = split_unit(name)[0].lower()
    for pattern, prefix in ((_AXES, ""), (_TURNS, "q")):
        if match := pattern.fullmatch(bare):
            return match[1] or "", prefix + match[2]
    return "", bare


def _tool_columns(table: Table) -> dict[str, dict[str, list[str]]]:
    """Return columns by what they are of, and by their names here; those of commands alone.

    A list of numbers is one thing, and so are the position and the orientation of a pose.
    """
    own: dict[str, dict[str, list[str]]] = {}
    for stem, columns in table.series.items():
        for name, inner in zip(columns, _inner(stem, columns), strict=True):
            own.setdefault(stem, {}).setdefault(split_unit(inner)[0].lower(), []).append(name)
    if commands := [stem for stem in own if _COMMAND.search(stem.lower())]:
        own = {stem: own[stem] for stem in commands}
    for name in table.names:
        of, each = pose_column(name)
        own.setdefault(of, {}).setdefault(each, []).append(name)
    return own


def _incomplete(names: Collection[str]) -> str:
    """Return which columns of the tool's targets are missing; empty if few or none are there."""
    for kind in ("poses", "twists"):
        whole = TARGET_KINDS[kind]
        missing = [name for name in whole if name not in names]
        if len(missing) <= len(whole) - _SOME:
            return f"must have the columns {', '.join(missing)} too: {kind} are {', '.join(whole)}"
    return ""


def _velocity_columns(table: Table, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of velocities by the names of joints or numbers; empty without them."""
    found: dict[str, str] = {}
    for name in table.names:
        bare = split_unit(name, joints)[0].lower()
        rest, count = _VELOCITY.subn("", bare, count=1)
        if count:
            found.setdefault(re.sub(r"[^a-z0-9]", "", rest), name)
    by_name = [re.sub(r"[^a-z0-9]", "", joint.lower()) for joint in joints]
    numbers = range(len(joints))
    for keys in (by_name, [str(k + 1) for k in numbers], [str(k) for k in numbers]):
        if set(keys) <= set(found) and (keys is by_name or len(found) == len(keys)):
            return tuple(found[key] for key in keys)
    return ()


def _columns_by_name(table: Table, n: int, choice: str | Sequence[str]) -> JointColumns | str:
    """Return the columns of n joints that are asked for, by a series or one by one."""
    names = table.names
    if isinstance(choice, str):
        series = {**_number_names(names), **table.series}
        columns = next((c for stem, c in series.items() if _bare(stem) == _bare(choice)), ())
        if len(columns) < n:
            count = plural(len(columns), "column")
            return f"columns: {choice}: has {count}, and the arm {plural(n, 'joint')}"
        return JointColumns(
            tuple(columns[:n]), tuple(x for x in names if x not in columns[:n]), True
        )
    missing = [name for name in choice if name not in names]
    if missing or len(choice) != n:
        text = f"no column {missing[0]!r}" if missing else f"must be {n}, one per joint"
        return f"columns: {text}; there are {short(list(names))}"
    return JointColumns(tuple(choice), tuple(x for x in names if x not in choice), True)


def _bare(stem: str) -> str:
    return stem.strip("_.[]/ ").lower()


def _rank(before: str, after: str) -> int:
    """Return how likely columns are the joints', by what is before and after names or numbers."""
    around = f"{before} {after}".lower()
    if _bare(before) in ("", "q", "j", "joint", "joints") and not _bare(after):
        return 0
    return 1 if _COMMAND.search(around) else 2


def _match_names(
    bare: Mapping[str, str], joints: Sequence[str]
) -> dict[tuple[str, str], tuple[str, ...]]:
    """Return columns that have the names of all joints in them, by what is around the names."""
    groups: dict[tuple[str, str], dict[str, str]] = {}
    for joint in joints:
        pattern = re.compile(rf"(?:(.*[^A-Za-z0-9]))?{re.escape(joint)}(?:([^A-Za-z0-9].*))?")
        for name, short_name in bare.items():
            if (match := pattern.fullmatch(short_name)) and not _OTHER.search(
                f"{match[1] or ''} {match[2] or ''}".lower()
            ):
                groups.setdefault((match[1] or "", match[2] or ""), {})[joint] = name
    return {
        around: tuple(match[joint] for joint in joints)
        for around, match in groups.items()
        if len(match) == len(joints)
    }


def _of_size(
    bare: Mapping[str, str], table: Table, n: int
) -> dict[tuple[str, str], tuple[str, ...]]:
    """Return columns that are numbered from 0 or 1, or of one series, as many as joints."""
    names = {short_name: name for name, short_name in bare.items()}
    return {
        (stem, ""): tuple(names.get(each, each) for each in columns)
        for stem, columns in {**_number_names(tuple(names)), **table.series}.items()
        if len(columns) == n and not _OTHER.search(stem.lower())
        if stem not in table.series or all(map(_ANY_JOINT.fullmatch, _inner(stem, columns)))
    }


def _number_names(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return columns that are numbered without a gap, by what is around the numbers."""
    groups: dict[tuple[str, str], dict[int, str]] = {}
    for name in names:
        if (match := _NUMBERED.fullmatch(name)) and len(match[2]) < 4:
            groups.setdefault((match[1], match[3]), {})[int(match[2])] = name
    return {
        f"{before} {after}".strip(): tuple(group[k] for k in sorted(group))
        for (before, after), group in groups.items()
        if sorted(group) in (list(range(len(group))), list(range(1, len(group) + 1)))
    }


# CSV.


def _of_rows(rows: list[Row], choice: Choice) -> Recording:
    """Return the table in the rows of a CSV file."""
    first = rows[0][0]
    names, rows = _split_titles(rows, choice.period is not None)
    for row, entries in rows:
        if len(entries) != len(names):
            raise ValueError(
                f"row {row}: must have {plural(len(names), 'entry', 'entries')}, one per "
                f"column, not {len(entries)}"
            )
    time_names = _time_names(first, rows, names, choice)
    if time_names:
        time, is_epoch = row_times(rows, names, time_names)
    else:
        assert choice.period is not None
        time, is_epoch = _even(len(rows), choice.period), False
    columns, texts = dict[str, Array](), dict[str, str]()
    for place, name in enumerate(names):
        if name not in time_names:
            try:
                columns[name] = np.array([_entry(row, cells, place) for row, cells in rows])
            except ValueError as error:
                columns[name], texts[name] = np.full(len(rows), np.nan), str(error)
    zero = sum(
        _time(*rows[0], names.index(name)) * scale
        for name, scale in zip(time_names, (1.0, 1e-9), strict=False)
    )
    columns = _with_chunks(columns, zero if is_epoch else None)
    _require_order(time, columns, [row for row, _ in rows], choice.begin)
    if not columns:
        raise ValueError(f"row {first}: must have the columns t, and one per joint")
    columns = _with_joints(columns, {name: _only(rows, names, name) for name in texts})
    table = Table(time, tuple(columns), np.column_stack(list(columns.values())), {}, texts)
    return Recording([table], None, [_SINCE_1970] if is_epoch else [])


def _only(rows: Sequence[Row], names: Sequence[str], name: str) -> str:
    """Return the text that is in all rows of a column; empty if they differ."""
    values = {cells[names.index(name)] for _, cells in rows}
    return values.pop() if len(values) == 1 else ""


def _with_joints(columns: dict[str, Array], texts: Mapping[str, str]) -> dict[str, Array]:
    """Return columns of positions under the names that other columns give: name0 of position0."""
    new_names: dict[str, str] = {}
    for name, text in texts.items():
        if match := _NAMES.fullmatch(name):
            position = f"{match[1]}position{match[2]}"
            if position in columns:
                if not text:
                    raise ValueError(f"column {name}: names several joints")
                new_names[position] = f"{match[1]}position.{text}"
    return {new_names.get(name, name): values for name, values in columns.items()}


def _split_titles(rows: list[Row], is_untimed: bool) -> tuple[list[str], list[Row]]:
    """Return the names of the columns, and the rows below them."""
    first, cells = rows[0]
    if len(cells) > _MOST_COLUMNS:
        raise ValueError(f"row {first}: has {len(cells)} columns, and may have {_MOST_COLUMNS}")
    if is_header(cells):
        names, rows = _header(first, cells), rows[1:]
    else:
        joints = len(cells) - (not is_untimed)
        names = [*(() if is_untimed else ("t",)), *(f"q{k + 1}" for k in range(joints))]
    if not rows:
        raise ValueError("has no targets")
    return names, rows


def _header(row: int, cells: Sequence[str]) -> list[str]:
    """Return the names of the columns."""
    names = [cell or f"column {k}" for k, cell in enumerate(cells, 1)]
    if (twice := given_twice(names)) is not None:
        raise ValueError(f"row {row}: column {twice} is given twice")
    return names


def _even(count: int, period: float) -> Array:
    return np.asarray(period * np.arange(count), dtype=float)


def _time_names(
    first: int, rows: Sequence[Row], names: Sequence[str], choice: Choice
) -> Sequence[str]:
    """Return the columns of times; none of rows that are a period apart."""
    if choice.period is not None:
        return ()
    try:
        time_names = time_columns(names)
    except ValueError as error:
        raise ValueError(f"row {first}: {error}") from None
    if not time_names and "-" in rows[0][1][0][1:] and names[0] == "column 1":
        # The index of a pandas frame has no name.
        return names[:1]
    if not time_names:
        raise ValueError(
            f"row {first}: has no column of times, such as t or timestamp, among {short(names)}; "
            "of rows at equal times give targets.period"
        )
    return time_names


def row_times(
    rows: Sequence[Row], names: Sequence[str], time_names: Sequence[str]
) -> tuple[Array, bool]:
    """Return the times in rows [s], from 0 on if they are since 1970, and whether they are.

    Args:
        rows: The rows, each with an entry for each column.
        names: Names of all columns.
        time_names: Those of times; see `time_columns`.
    """
    whole, *parts = (
        np.array([_time(row, cells, names.index(name)) for row, cells in rows])
        for name in time_names
    )
    if not parts:
        return seconds(whole, time_unit(time_names[0]))
    time, is_epoch = seconds(whole, 1.0)
    (part,) = parts
    return time + 1e-9 * (part - part[0] if is_epoch else part), is_epoch


def _time(row: int, cells: Sequence[str], place: int) -> float:
    """Return the time in a cell; a refusal names its row and column."""
    try:
        return time_in(cells[place])
    except ValueError:
        text = f"row {row}, column {place + 1}: {short(cells[place])} is not a finite number"
        raise ValueError(f"{text}, nor a date") from None


def _entry(row: int, cells: Sequence[str], place: int) -> float:
    cell = cells[place]
    if cell.lower() in ("", "nan"):
        return np.nan
    try:
        return decimal(cell)
    except ValueError:
        raise ValueError(
            f"row {row}, column {place + 1}: {short(cell)} is not a finite number, nor nan"
        ) from None


# Messages.


class _Message(NamedTuple):
    """A message of joints: a time [s], names, and numbers; of a trajectory its points.

    It may have come at another time than it was stamped with.
    """

    time: float
    names: tuple[str, ...]
    position: Sequence[float]
    points: Points | None = None
    stamp: float = 0.0


def _of_messages(messages: Sequence[_Message]) -> Recording:
    """Return rows of messages, a table for each set of names; or the points of one trajectory."""
    if not messages:
        raise ValueError("has no message with joint positions")
    require_few(len(messages), "messages", MOST_ROWS)
    if len(messages) == 1 and messages[0].points is not None:
        return Recording([], messages[0].points, messages[0].points.notes)
    if any(m.points is not None and len(m.points.time) > 1 for m in messages):
        return _of_trajectories(messages)
    stamps, is_epoch = seconds(np.array([message.time for message in messages]), 1.0)
    groups: dict[tuple[str, ...], list[int]] = {}
    for k, message in enumerate(messages):
        groups.setdefault(message.names, []).append(k)
    tables = []
    for names, numbers in groups.items():
        time = stamps[numbers]
        # Of messages of one time, the newest counts.
        last = np.append(np.diff(time) > 0.0, True)
        if (np.diff(time) < 0.0).any():
            raise ValueError("has messages whose times decrease")
        values = np.array([messages[k].position for k in numbers])[last]
        # Names decide which joint an entry is of; only data without names is in the arm's order.
        series = {"data": names} if names == _data_names(len(names)) else {}
        tables.append(Table(time[last], names, values, series, {}))
    return Recording(tables, None, [_SINCE_1970] if is_epoch else [])


def _of_trajectories(messages: Sequence[_Message]) -> Recording:
    """Return trajectories as chunks, each of which replaces what is left of the one before."""
    if len({message.time for message in messages}) == 1:
        raise ValueError(
            f"has {len(messages)} trajectories of several points; leave the one that is followed, "
            "or give each its header.stamp"
        )
    records = []
    for message in messages:
        if (points := message.points) is None:
            raise ValueError("has trajectories and other messages; leave either")
        times = (message.stamp or message.time) + points.time
        record = {"t": message.time, "times": times.tolist(), "joints": list(points.names)}
        records.append({**record, "positions": points.rows[0].tolist()})
    return _of_calls(records)


def _of_records(file: Path, choice: Choice) -> Recording:
    """Return what a YAML or JSON file of messages holds."""
    every = list(records_of(file, _MOST_RECORDS))
    calls = list(_calls_in(every))
    if calls:
        return _of_calls(calls)
    records, passed = list(_joint_records(every)), _passed_over(every)
    recording = _of_messages([_record(record, choice.period) for record in records])
    notes = [f"{', '.join(passed)}: ignored"] if passed else []
    return recording._replace(notes=[*recording.notes, *notes])


# No time is later than this [s], and no two targets of a chunk are farther apart.
_LATEST, _APART = 5e9, 10.0
# Keys of the record of a call besides its targets.
_CALL_KEYS = ("t", "start", "rate", "times", "joints")


def _calls_in(records: Sequence[Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the records of calls: each has one of `TARGET_KINDS` as a key."""
    for record in records:
        if isinstance(record, Mapping):
            if set(TARGET_KINDS) & set(record):
                yield record
            elif set(record) <= {"chunks", "calls"}:
                for inner in record.values():
                    yield from _calls_in(inner if isinstance(inner, list) else [])
        elif isinstance(record, list):
            yield from _calls_in(record)


def _of_calls(records: Sequence[Mapping[str, Any]]) -> Recording:
    """Return the calls of a source, in the order in which they came."""
    require_few(len(records), "chunks", MOST_ROWS)
    calls = []
    for number, record in enumerate(records, 1):
        try:
            calls.append(_call(record))
        except ValueError as error:
            raise ValueError(f"chunk {number}: {error}") from None
    when = np.array([call.time for call in calls])
    if (np.diff(when) < 0.0).any():
        k = int((np.diff(when) < 0.0).argmax()) + 1
        raise ValueError(f"chunk {k + 1}: t must not decrease, from {when[k - 1]:g} to {when[k]:g}")
    kinds = [call.kind for call in calls]
    if (others := [k for k, kind in enumerate(kinds) if kind != kinds[0]]) != []:
        raise ValueError(
            f"chunk {others[0] + 1}: has {kinds[others[0]]}, and the first {kinds[0]}; targets of "
            "a file must be of one kind"
        )
    times, is_epoch = seconds(when, 1.0)
    if not is_epoch and when[0] < 0.0:
        raise ValueError(f"chunk 1: t must be 0 or later, not {when[0]:g}")
    if not is_epoch and when[0] > _LATEST:
        raise ValueError(
            f"chunk 1: t must be in seconds, not {when[0]:g}, which looks like milli- or "
            "nanoseconds since 1970"
        )
    shift = when[0] if is_epoch else 0.0
    moved = [
        call._replace(time=float(t), times=call.times - shift)
        for call, t in zip(calls, times, strict=True)
    ]
    return Recording([], None, [_SINCE_1970] if is_epoch else [], moved)


def _call(record: Mapping[str, Any]) -> RecordedCall:
    """Return a call from its fields."""
    kinds = [kind for kind in TARGET_KINDS if kind in record]
    unknown = [key for key in record if key not in (*TARGET_KINDS, *_CALL_KEYS)]
    if len(kinds) > 1 or unknown:
        extra = f"no key {unknown[0]}" if unknown else f"has both {' and '.join(kinds)}"
        raise ValueError(f"{extra}; it may have {', '.join(_CALL_KEYS)} and one of the targets")
    if "t" not in record:
        raise ValueError("t: must be given, the time at which it came")
    t, value = _number(record, "t"), record[kinds[0]]
    rows = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    values = [_row(kinds[0], row) for row in rows]
    for k, row in enumerate(values, 1):
        if len(row) != len(values[0]):
            raise ValueError(
                f"{kinds[0]}: row {k} has {plural(len(row), 'number')}, and the first "
                f"{len(values[0])}"
            )
    joints = _distinct(record, "joints") if "joints" in record else ()
    if joints and (TARGET_KINDS[kinds[0]] or len(joints) != len(values[0])):
        raise ValueError(f"joints: must be the names of the {kinds[0]} of joints, one for each")
    times = _call_times(record, t, len(values))
    return RecordedCall(t, kinds[0], times, np.array(values), joints)


def _number(record: Mapping[str, Any], key: str) -> float:
    """Return a number of a record, which a refusal names."""
    try:
        return number_of(record[key])
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def _row(key: str, value: Any) -> list[float]:
    """Return the numbers of a target, NaN for those that are none: null or NaN."""
    if not isinstance(value, list):
        raise ValueError(f"{key}: must be a list of numbers, or of such lists, not {short(value)}")
    row = []
    for entry in value:
        is_none = entry is None or (isinstance(entry, float) and np.isnan(entry))
        try:
            row.append(np.nan if is_none else number_of(entry))
        except ValueError as error:
            raise ValueError(f"{key}: {error}") from None
    return row


def _call_times(record: Mapping[str, Any], t: float, count: int) -> Array:
    """Return the times that the targets of a call are for, shape (k,) [s]."""
    if "times" in record:
        times = np.array(_row("times", record["times"]))
        if len(times) != count or not (np.diff(times) > 0.0).all():
            raise ValueError(f"times: must be {count} times that increase, one per target")
        return times
    start = _number(record, "start") if "start" in record else t
    if count == 1:
        return np.array([start])
    if "rate" not in record:
        raise ValueError(f"rate: must be given for {count} targets, or times")
    rate = _number(record, "rate")
    if not 1.0 / _APART <= rate < np.inf:
        raise ValueError(
            f"rate: must be a number of targets a second, not {rate:g}, nor a time between two"
        )
    return start + _even(count, 1.0 / rate)


def _joint_records(records: Iterable[Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the messages of joints in records and in what these consist of."""
    waiting = list(records)[::-1]
    while waiting:
        record = waiting.pop()
        if isinstance(record, Mapping):
            if {"joint_names", "points"} <= set(record) or {"name", "position"} <= set(record):
                yield record
            else:
                waiting += [
                    each
                    for key, each in record.items()
                    if isinstance(each, (dict, list)) and key not in (*_PASSED_OVER, _FRAMES)
                ]
        elif isinstance(record, list):
            waiting += [each for each in record[::-1] if isinstance(each, dict)]


# Fields of messages that hold no targets: where a plan begins, and how exactly it is followed. A
# trajectory of frames is none of joints.
_PASSED_OVER = ("trajectory_start", "start_state", "path_tolerance", "goal_tolerance")
_FRAMES = "multi_dof_joint_trajectory"


def _passed_over(value: Any) -> list[str]:
    """Return the fields that are passed over in records, each once.

    Raises:
        ValueError: If a trajectory is one of frames, and not of joints.
    """
    names, waiting, seen = dict[str, None](), [value], set[int]()
    while waiting:
        each = waiting.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        if isinstance(each, Mapping):
            frames = each.get(_FRAMES)
            if isinstance(frames, Mapping) and frames.get("points"):
                raise ValueError(
                    f"{_FRAMES}: poses of frames are no joint positions; leave it empty, with the "
                    "joints in joint_trajectory"
                )
            names |= dict.fromkeys(name for name in _PASSED_OVER if each.get(name))
            waiting += [e for e in each.values() if isinstance(e, (dict, list))]
        elif isinstance(each, list):
            waiting += [e for e in each if isinstance(e, (dict, list))]
    return list(names)


def _record(record: Mapping[str, Any], period: float | None = None) -> _Message:
    """Return a message from its fields; points without times are a period apart [s]."""
    header = record.get("header")
    time = _duration(header.get("stamp")) if isinstance(header, Mapping) else 0.0
    if "points" not in record:
        names = _distinct(record, "name")
        position = _numbers_of_joints(record["position"], names, "position")
        return _require_sizes(_Message(time, names, position))
    names = _distinct(record, "joint_names")
    points = list_of(record, "points")
    if not points or not all(isinstance(point, Mapping) for point in points):
        raise ValueError("points: must be a list of mappings, at least one")
    times = np.array([_duration(point.get("time_from_start")) for point in points])
    if len(points) > 1 and not times.any():
        if period is None:
            raise ValueError("points: have no times; give targets.period, the time between two")
        times = _even(len(points), period)
    _require_later(times)
    rows, notes = _point_rows(points, names)
    points_read = Points(names, times, rows, notes)
    return _Message(time, names, rows[0][-1].tolist(), points_read, time)


def _distinct(record: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the names of joints of a message.

    Raises:
        ValueError: If one is there twice.
    """
    names = tuple(map(str, list_of(record, key)))
    if len(names) > _MOST_COLUMNS:
        raise ValueError(f"{key}: has {len(names)} joints, and may have {_MOST_COLUMNS}")
    if (twice := given_twice(names)) is not None:
        raise ValueError(f"{key}: {twice} is given twice")
    return names


def _numbers_of_joints(value: Any, names: Sequence[str], what: str) -> list[float]:
    """Return a list of numbers, one for each joint, which a refusal names."""
    if not isinstance(value, list) or len(value) != len(names):
        return numbers_of(value)
    for name, each in zip(names, value, strict=True):
        try:
            number_of(each)
        except ValueError as error:
            raise ValueError(f"{what} of {name}: {error}") from None
    return numbers_of(value)


def _point_rows(
    points: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[tuple[Array, ...], tuple[str, ...]]:
    """Return the rows that points give, of all joints each, and what is told of the rest.

    Raises:
        ValueError: If a list is not one number per joint; of what may be left out, it may be empty.
    """
    rows, ignored = list[Array](), list[str]()
    parts = ("positions", "velocities", "accelerations", "effort")
    for place, part in enumerate(parts):
        values = list[list[float]]()
        for k, point in enumerate(points, 1):
            entry = _numbers_of_joints(point.get(part) or [], names, f"point {k}: {part}")
            if len(entry) != len(names) and (entry or part == "positions"):
                raise ValueError(f"point {k}: must have {len(names)} {part}, one per joint")
            values.append(entry)
        if all(values) and len(rows) == place and part != "effort":
            rows.append(np.array(values))
        elif any(values):
            # Not all points have them, or not the derivatives below them.
            ignored.append(part)
    return tuple(rows), (f"{', '.join(ignored)} of its points: ignored",) * bool(ignored)


def _require_later(times: Array) -> None:
    """Raise a ValueError unless the times of points increase from 0 or later."""
    wrong = np.diff(times, prepend=min(times[0], 0.0) - (times[0] >= 0.0)) <= 0.0
    if wrong.any():
        k = int(wrong.argmax())
        raise ValueError(
            f"point {k + 1}: its time must be {'0 or later' if not k else 'after that before it'}, "
            f"not {times[k]:g} s"
        )


def _require_sizes(message: _Message) -> _Message:
    if len(message.position) != len(message.names):
        raise ValueError(
            f"a message has {plural(len(message.names), 'name')} and "
            f"{plural(len(message.position), 'position')}"
        )
    return message


def _duration(value: Any) -> float:
    """Return a time or duration of ROS [s]: seconds and nanoseconds, or a number."""
    if value is None:
        return 0.0
    if not isinstance(value, Mapping):
        return number_of(value)
    whole = next((value[key] for key in ("sec", "secs") if key in value), 0)
    part = next((value[key] for key in ("nanosec", "nsec", "nsecs") if key in value), 0)
    return number_of(whole) + 1e-9 * number_of(part)


# Types of messages that are read, without the part that is not the same in ROS 1 and 2.
_STATE, _TRAJECTORY = "sensor_msgs/JointState", "trajectory_msgs/JointTrajectory"
_ARRAY, _CHUNK = "std_msgs/Float64MultiArray", "drake_rnn/Chunk"
_MESSAGES = (_STATE, _TRAJECTORY, _ARRAY, _CHUNK)


# Size of a part of an MCAP file, which is unpacked at once, and of all messages of a topic [bytes].
_MOST_CHUNK, _MOST_MESSAGES = 100_000_000, 200_000_000


@contextmanager
def _bounded_chunks() -> Iterator[None]:
    """Have chunks of MCAP unpacked within bounds: a few bytes of one may be gigabytes."""
    reading: Any = import_module("mcap.stream_reader")
    stream_of = reading.get_chunk_data_stream

    def bounded(chunk: Any, validate_crc: bool = False) -> Any:
        size = chunk.uncompressed_size
        if size > _MOST_CHUNK:
            raise ValueError(
                f"has a chunk of {size / 1e6:.4g} MB, and may have {_MOST_CHUNK / 1e6:g} MB"
            )
        if chunk.compression in ("zstd", "lz4"):
            if chunk.compression == "zstd":
                unpacker = import_name("zstandard:ZstdDecompressor")()
                data = unpacker.stream_reader(chunk.data).read(size + 1)
            else:
                unpacker = import_name("lz4.frame:LZ4FrameDecompressor")()
                data = unpacker.decompress(chunk.data, max_length=size + 1)
            if len(data) != size:
                raise ValueError(f"has a chunk that is not of {size} bytes, as it says")
            chunk = replace(chunk, compression="", data=data)
        return stream_of(chunk, validate_crc)

    reading.get_chunk_data_stream = bounded
    try:
        yield
    finally:
        reading.get_chunk_data_stream = stream_of


def _of_mcap(file: Path, choice: Choice) -> Recording:
    """Return the messages of a topic of an MCAP file."""
    reading, ros2 = import_extra("targets.file", "mcap", "mcap.reader", "mcap_ros2.decoder")
    with open_regular(file, _MOST_BINARY) as stream, _bounded_chunks():
        try:
            reader, size = reading.make_reader(stream), 0
            summary = reader.get_summary()
            channels = {} if summary is None else summary.channels
            kinds = {
                channel.topic: summary.schemas[channel.schema_id].name.replace("/msg/", "/")
                for channel in channels.values()
                if channel.schema_id in summary.schemas
            }
            topic = _topic(kinds, choice.topic)
            decoders: dict[int, Callable[[bytes], Any]] = {}
            messages, calls = list[_Message](), list[Mapping[str, Any]]()
            for schema, channel, message in reader.iter_messages(topics=[topic]):
                if schema.id not in decoders:
                    decoders[schema.id] = _decoder(schema, channel, ros2.DecoderFactory())
                if len(messages) + len(calls) > MOST_ROWS:
                    break
                if (size := size + len(message.data)) > _MOST_MESSAGES:
                    raise ValueError(
                        f"topic: {topic} has more than {_MOST_MESSAGES / 1e6:g} MB of messages"
                    )
                content, came = decoders[schema.id](message.data), 1e-9 * message.log_time
                if kinds[topic] == _CHUNK:
                    calls.append(_chunk_message(content, came))
                else:
                    messages.append(_mcap_message(kinds[topic], content, came))
        except (OSError, ValueError):
            raise
        # What a damaged file raises in this library is not documented.
        except Exception as error:
            text = " ".join(f"{type(error).__name__} {error}".split())
            raise ValueError(
                f"cannot be read as MCAP: {text}; mcap recover mends some files"
            ) from None
    recording = _of_calls(calls) if calls else _of_messages(messages)
    return recording._replace(notes=[f"the topic is {topic}", *recording.notes])


def _topic(kinds: Mapping[str, str], choice: str | None) -> str:
    """Return the topic that is asked for, or the only one with joint positions."""
    readable = sorted(topic for topic, kind in kinds.items() if kind in _MESSAGES)
    preferred_topics = [topic for topic in readable if kinds[topic] != _ARRAY]
    if choice is not None:
        if choice not in kinds:
            raise ValueError(f"topic: no {choice}; there are {short(sorted(kinds))}")
        if choice not in readable:
            raise ValueError(
                f"topic: {choice} has messages {kinds[choice]}; {', '.join(_MESSAGES)} are read"
            )
        return choice
    candidates = preferred_topics or readable
    if len(candidates) != 1:
        text = (
            f"there are {', '.join(candidates)}"
            if candidates
            else f"there is none of {', '.join(_MESSAGES)}"
        )
        raise ValueError(f"topic: must be given; {text}")
    return candidates[0]


def _decoder(schema: Any, channel: Any, factory: Any) -> Callable[[bytes], Any]:
    """Return what makes a message of bytes."""
    if channel.message_encoding == "json":
        return json.loads
    decoder = factory.decoder_for(channel.message_encoding, schema)
    if decoder is None:
        raise ValueError(
            f"topic: {channel.topic} is encoded as {channel.message_encoding}; cdr of ROS 2 and "
            "json are read"
        )
    decode: Callable[[bytes], Any] = decoder
    return decode


def _chunk_message(content: Any, time: float) -> Mapping[str, Any]:
    """Return the record of a chunk, which by default came when it was received [s]."""
    if not isinstance(content, Mapping) or not set(TARGET_KINDS) & set(content):
        raise ValueError(
            f"a message of {_CHUNK} must have one of {', '.join(TARGET_KINDS)}, not "
            f"{short(content)}"
        )
    return {"t": time, **content}


def _mcap_message(kind: str, message: Any, time: float) -> _Message:
    """Return a message that was received at a time [s]."""
    if isinstance(message, Mapping):
        if kind != _ARRAY:
            return _record(message)._replace(time=time)
        data = numbers_of(message.get("data"))
    elif kind == _STATE:
        return _require_sizes(_Message(time, tuple(message.name), list(message.position)))
    elif kind == _TRAJECTORY:
        points = [_point(point) for point in message.points]
        stamp = message.header.stamp
        record = {
            "header": {"stamp": {"sec": stamp.sec, "nanosec": stamp.nanosec}},
            "joint_names": list(message.joint_names),
            "points": points,
        }
        return _record(record)._replace(time=time)
    else:
        data = list(message.data)
    return _Message(time, _data_names(len(data)), data)


def _data_names(count: int) -> tuple[str, ...]:
    """Return the names of the entries of messages without names."""
    return tuple(f"data[{k}]" for k in range(count))


def _point(point: Any) -> dict[str, Any]:
    """Return the fields of a trajectory_msgs/JointTrajectoryPoint."""
    after = point.time_from_start
    return {
        "positions": list(point.positions),
        "velocities": list(point.velocities),
        "accelerations": list(point.accelerations),
        "effort": list(point.effort),
        "time_from_start": {"sec": after.sec, "nanosec": after.nanosec},
    }


# Parquet.


def _of_parquet(file: Path, choice: Choice) -> Recording:
    """Return the columns of numbers, and of lists of numbers, of a Parquet file."""
    arrow, parquet = import_extra("targets.file", "parquet", "pyarrow", "pyarrow.parquet")
    with open_regular(file, _MOST_BINARY) as stream:
        try:
            source = parquet.ParquetFile(stream)
            field_names = [
                field.name
                for field in source.schema_arrow
                if _is_read(arrow, field.type) or _is_chunk(arrow, field.type)
            ]
            require_few(source.metadata.num_rows, "rows", 100 * MOST_ROWS)
            if (twice := given_twice(field_names)) is not None:
                raise _ContentError(f"column {twice} is given twice")
            _require_little(source.metadata, set(field_names))
            table, notes = _episode_of(source, field_names, choice.episode)
        except (OSError, ValueError, ArithmeticError, MemoryError) as error:
            if isinstance(error, _ContentError):
                raise ValueError(str(error)) from None
            raise ValueError(f"cannot be read as Parquet: {' '.join(str(error).split())}") from None
    require_few(table.num_rows, "rows", MOST_ROWS)
    if not table.num_rows:
        raise ValueError("has no rows")
    rate = _rate_beside(file)
    nested = [f.name for f in table.schema if _is_chunk(arrow, f.type)]
    columns, series = _number_columns(file, table.drop_columns(nested))
    stamps = [f.name for f in table.schema if arrow.types.is_timestamp(f.type)]
    if nested:
        _, time, _ = _column_times(columns, choice, stamps)
        return _of_nested(file, (table, nested), (time, rate), notes)
    recording = _of_columns(columns, series, choice, stamps)
    return recording._replace(notes=[*notes, *recording.notes])


def _of_arrays(file: Path, choice: Choice) -> Recording:
    """Return the arrays of a file of numpy.savez: times, and rows as long, such as t and q."""
    heads = heads_of(file)
    for name, head in heads.items():
        if head.kind == "b":
            raise ValueError(f"{name} must hold numbers, not true and false")
    shapes = {name: head.shape for name, head in heads.items()}
    lengths = {shape[:1] for shape in shapes.values()}
    if len(lengths) != 1 or any(len(shape) not in (1, 2) for shape in shapes.values()):
        text = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(
            "must hold times and rows of positions, such as t of shape (k,) and q of shape (k, n), "
            f"not {text or 'nothing'}"
        )
    ((count,),) = lengths
    require_few(count, "rows", MOST_ROWS)
    columns_there = sum(shape[1] if shape[1:] else 1 for shape in shapes.values())
    require_few(columns_there, "columns", _MOST_COLUMNS)
    require_few(count * columns_there, "numbers", _MOST_NUMBERS)
    if not count:
        raise ValueError("has no rows")
    arrays = {name: array.astype(float) for name, array in arrays_of(file).items()}
    columns, series = dict[str, Array](), dict[str, tuple[str, ...]]()
    for name, array in arrays.items():
        if array.ndim == 1:
            columns[name] = array
        else:
            bare, unit = split_unit(name)
            series[bare] = tuple(
                f"{bare}[{k}]" + f" [{unit}]" * bool(unit) for k in range(array.shape[1])
            )
            columns |= dict(zip(series[bare], array.T, strict=True))
    return _of_columns(columns, series, choice, [])


def _of_columns(
    columns: dict[str, Array],
    series: Mapping[str, tuple[str, ...]],
    choice: Choice,
    stamps: Sequence[str],
) -> Recording:
    """Return the table of columns of equal length.

    Args:
        columns: The columns, shape (k,) each.
        series: Columns that are one quantity, by its name.
        choice: What a user says of the file.
        stamps: Columns that are times by their type.
    """
    time_names, time, is_epoch = _column_times(columns, choice, stamps)
    columns = _with_chunks(columns, float(columns[time_names[0]][0]) if is_epoch else None)
    _require_order(time, columns, range(1, len(time) + 1), choice.begin)
    others = {name: values for name, values in columns.items() if name not in time_names}
    if not others:
        raise ValueError("has no columns of numbers beside times")
    table = Table(time, tuple(others), np.column_stack(list(others.values())), series, {})
    return Recording([table], None, [_SINCE_1970] if is_epoch else [])


class _ContentError(ValueError):
    """What is refused of a table that can be read."""


def _require_little(metadata: Any, names: Collection[str]) -> None:
    """Raise an error if a part of a Parquet file, which is decoded at once, has too many numbers.

    Args:
        metadata: What the file says of itself.
        names: Columns that are read.
    """
    for k in range(metadata.num_row_groups):
        part = metadata.row_group(k)
        columns = [part.column(each) for each in range(part.num_columns)]
        columns = [each for each in columns if each.path_in_schema.split(".")[0] in names]
        numbers = sum(each.num_values for each in columns)
        size = sum(each.total_uncompressed_size for each in columns)
        if numbers > _MOST_NUMBERS or size > _MOST_PACKED * _MOST_NUMBERS:
            raise _ContentError(
                f"its part {k + 1} has {numbers} numbers in {size / 1e6:.3g} MB to read at once, "
                f"and may have {_MOST_NUMBERS}; keep one of several rows, or the columns that are "
                "needed"
            )


def _episode_of(source: Any, names: Sequence[str], choice: int | None) -> tuple[Any, list[str]]:
    """Return the rows of an episode of a Parquet file, by default of the first one, and notes."""
    parts, notes, chosen, count = [], list[str](), None, 0
    if "episode_index" in names:
        chosen, notes = _chosen_episode(source.read(columns=["episode_index"]), choice)
    for k in range(source.num_row_groups):
        part = source.read_row_group(k, columns=names)
        if chosen is not None:
            part = part.filter((part.column("episode_index").to_numpy() == chosen).tolist())
        count += sum(_leaves(column) for column in part.columns)
        if count > _MOST_NUMBERS:
            raise _ContentError(f"its columns have more than {_MOST_NUMBERS} numbers")
        parts.append(part)
    if not parts:
        return source.schema_arrow.empty_table().select(names), notes
    return import_name("pyarrow:concat_tables")(parts), notes


def _leaves(column: Any) -> int:
    """Return how many numbers a column has, those of its lists included."""
    while "list" in str(column.type):
        column = import_name("pyarrow.compute:list_flatten")(column)
    return len(column)


def _number_columns(file: Path, table: Any) -> tuple[dict[str, Array], dict[str, tuple[str, ...]]]:
    """Return the columns of numbers, and those that are one quantity by its name."""
    names_of, columns, series = (
        _names_beside(file),
        dict[str, Array](),
        dict[str, tuple[str, ...]](),
    )
    for name in table.column_names:
        values = _column(name, table.column(name))
        if values.ndim == 1:
            columns[name] = values
            continue
        inner, width = names_of.get(name, ()), values.shape[1]
        if len(inner) not in (0, 1, width):
            raise ValueError(
                f"column {name}: has {plural(width, 'entry', 'entries')}, and meta/info.json names "
                f"{len(inner)}: {short(list(inner))}"
            )
        ends = [f".{each}" for each in inner]
        if len(inner) != width:
            # A single name is that of the whole list.
            ends = [f"[{k}]" for k in range(width)]
        series[name] = tuple(name + end for end in ends)
        columns |= dict(zip(series[name], values.T, strict=True))
    return columns, series


def _is_read(arrow: Any, kind: Any) -> bool:
    types = arrow.types
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        return bool(_is_read(arrow, kind.value_type)) and not types.is_list(kind.value_type)
    return bool(types.is_floating(kind) or types.is_integer(kind) or types.is_timestamp(kind))


def _is_chunk(arrow: Any, kind: Any) -> bool:
    """Return whether the entries of a column are lists of lists of numbers."""
    types = arrow.types

    def is_list(one: Any) -> bool:
        return bool(types.is_list(one) or types.is_large_list(one) or types.is_fixed_size_list(one))

    if not is_list(kind) or not is_list(kind.value_type):
        return False
    inner = kind.value_type.value_type
    return bool(types.is_floating(inner) or types.is_integer(inner))


def _of_nested(
    file: Path,
    chunks: tuple[Any, Sequence[str]],
    timing: tuple[Array, float | None],
    notes: Sequence[str],
) -> Recording:
    """Return the chunks of actions that LeRobot writes: one at each time, the targets from then on.

    Their rate is that of the data set, which ``meta/info.json`` states beside it, and so are the
    names of their entries.
    """
    (table, nested), (time, rate) = chunks, timing
    commands = [name for name in nested if _COMMAND.search(name.lower())]
    if len(commands) != 1:
        raise ValueError(f"has {len(commands)} columns of chunks of actions among {short(nested)}")
    (name,) = commands
    if rate is None:
        raise ValueError(
            f"column {name}: has chunks, whose rate is not known; state fps in meta/info.json, the "
            "number of targets a second"
        )
    names = tuple(_names_beside(file).get(name, ()))
    calls = []
    for k, (t, rows) in enumerate(zip(time.tolist(), table.column(name), strict=True)):
        values = _lists(f"row {k + 1}: column {name}", rows.values) if rows.is_valid else None
        if values is None or not values.size:
            raise ValueError(f"row {k + 1}: column {name}: must be rows of equally many numbers")
        times = t + _even(len(values), 1.0 / rate)
        joints = names if len(names) == values.shape[1] > 1 else ()
        calls.append(RecordedCall(t, "positions", times, values, joints))
    return Recording([], None, [*notes, f"{name} is read, at {rate:g} Hz"], calls)


def _column(name: str, column: Any) -> Array:
    """Return a column, shape (k,) or, of lists, (k, m)."""
    if "list" in str(column.type):
        return _lists(f"column {name}", column)
    values = column.to_numpy()
    if values.dtype.kind == "M":
        return np.asarray(values.astype("datetime64[ns]").astype(np.int64).astype(float))
    try:
        return np.array(values, dtype=float)
    except (ValueError, TypeError):
        raise ValueError(f"column {name}: must be numbers") from None


def _lists(what: str, column: Any) -> Array:
    """Return a column of lists of equally many numbers, shape (k, m).

    Raises:
        ValueError: If they are not, or too many.
    """
    compute = import_module("pyarrow.compute")
    lengths = compute.min_max(compute.list_value_length(column)).as_py()
    least, most = lengths["min"], lengths["max"]
    if column.null_count or least != most:
        raise ValueError(f"{what}: has lists of several lengths")
    if most is not None and most > _MOST_COLUMNS:
        raise ValueError(f"{what}: has lists of {most} numbers, and may have {_MOST_COLUMNS}")
    values = compute.list_flatten(column)
    return np.asarray(values, dtype=float).reshape(len(column), -1)


def _chosen_episode(table: Any, choice: int | None) -> tuple[int | None, list[str]]:
    """Return the number of the episode that is read, and what is told of the others."""
    numbers = table.column("episode_index").to_numpy()
    if numbers.dtype.kind not in "iu":
        raise _ContentError("column episode_index: must be whole numbers, one in each row")
    there = np.unique(numbers)
    if choice is not None and choice not in there:
        none = "there is none" if not there.size else f"there are {there[0]} to {there[-1]}"
        raise _ContentError(f"episode: no {choice}; {none}")
    episode = int(there[0]) if choice is None and there.size else choice
    notes = [f"of {there.size} episodes, {episode} is read"] if there.size > 1 else []
    return episode, notes


def _column_times(
    columns: Mapping[str, Array], choice: Choice, stamps: Sequence[str]
) -> tuple[list[str], Array, bool]:
    """Return the column of times, by its name or its type, the times [s] and whether of 1970."""
    if choice.period is not None:
        count = len(next(iter(columns.values())))
        return [], _even(count, choice.period), False
    time_names = list(time_columns([name for name in columns if name not in stamps]))
    if len(time_names) > 1:
        whole, part = (columns[name] for name in time_names)
        time, is_epoch = seconds(whole, 1.0)
        return time_names, time + 1e-9 * (part - part[0] * is_epoch), is_epoch
    if not (time_names or stamps):
        raise ValueError(
            f"has no column of times, such as timestamp, among {short(list(columns))}; of rows at "
            "equal times give targets.period"
        )
    name = [*time_names, *stamps][0]
    unit = 1e-9 if name in stamps else time_unit(name)
    return [name], *seconds(columns[name], unit)


def _stated_beside(file: Path) -> Mapping[str, Any]:
    """Return what a LeRobot data set states beside its data; nothing if there is no such file.

    Raises:
        ValueError: If that file cannot be read.
    """
    for folder in list(file.resolve().parents)[:4]:
        if is_file(info := folder / "meta" / "info.json"):
            try:
                stated = json_of(info)
            except OSError as error:
                raise ValueError(f"meta/info.json: cannot be read: {error.strerror}") from None
            except ValueError as error:
                raise ValueError(f"meta/info.json: {error}") from None
            return stated if isinstance(stated, dict) else {}
    return {}


def _rate_beside(file: Path) -> float | None:
    """Return the rate of a data set [Hz]; None if none is stated.

    Raises:
        ValueError: If it is no rate.
    """
    if (stated := _stated_beside(file).get("fps")) is None:
        return None
    rate = float(stated) if is_number(stated) else 0.0
    if not 0.0 < rate < np.inf:
        raise ValueError(
            f"meta/info.json: fps must be a number of frames a second, above 0, not {short(stated)}"
        )
    return rate


def _names_beside(file: Path) -> Mapping[str, Sequence[str]]:
    """Return the names of entries of the lists of a data set, where they are stated."""
    features = _stated_beside(file).get("features")
    names_by_key = {}
    for name, feature in features.items() if isinstance(features, dict) else ():
        names = _flat_names(feature.get("names")) if isinstance(feature, dict) else []
        if names:
            names_by_key[str(name)] = names
    return names_by_key


# Lists of names within each other.
_MOST_LISTS = 8


def _flat_names(names: Any, depth: int = 0) -> list[str]:
    """Return names that are a list, lists by what they are of, or places by name."""
    if depth > _MOST_LISTS:
        raise ValueError(f"meta/info.json: names: may be nested {_MOST_LISTS} deep")
    if isinstance(names, dict):
        if all(isinstance(place, int) for place in names.values()):
            return [str(name) for name in sorted(names, key=names.__getitem__)]
        return [name for each in names.values() for name in _flat_names(each, depth + 1)]
    return [str(each) for each in names] if isinstance(names, list) else []


_READERS: Mapping[str, Callable[[Path, Choice], Recording]] = {
    ".yaml": _of_records,
    ".yml": _of_records,
    ".json": _of_records,
    ".mcap": _of_mcap,
    ".parquet": _of_parquet,
    ".npz": _of_arrays,
    ".bag": _bag,
    ".db3": _bag,
}
