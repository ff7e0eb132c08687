"""Targets of two arms in one recording: the columns of each begin with its name, ``left/q1``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..inputs.messages import nearest
from ..inputs.units import split_unit
from .recordings import CHUNK, ISSUED, Points, RecordedCall, Recording, Table, target_columns

# Columns that are named in a message.
_TOLD = 8


def split_by_arm(recording: Recording, joints: Mapping[str, Sequence[str]]) -> dict[str, Recording]:
    """Return what a recording holds of each arm, under names without the arm's; empty for nothing.

    An arm's name is followed by ``/``, ``.`` or ``_``. It begins the name of a column, or what
    follows a list's name: ``left/q1`` is ``q1``, ``action.left_x`` is ``action.x``. The numbers of
    chunks may be of each arm or of both.

    Args:
        recording: The recording.
        joints: Names of the joints of each arm, by its name.

    Raises:
        ValueError: If a column may be of an arm and does not name one of these.
    """
    parts = {}
    for arm in joints:
        rename = _Rename(arm, joints)
        tables = [own for table in recording.tables if (own := _table(table, rename))]
        points = None if recording.points is None else _points(recording.points, rename)
        calls = [named for call in recording.calls if (named := _call(call, rename))]
        if tables or points or calls:
            parts[arm] = recording._replace(tables=tables, points=points, calls=calls)
    if parts:
        for names in _names_of(recording):
            _require_clear(names, joints)
    return parts


class _Rename:
    """Takes an arm's name out of the name of a column.

    Args:
        arm: The arm's name.
        arms: Names of all arms; what begins with a longer one is not of this arm.
    """

    def __init__(self, arm: str, arms: Iterable[str]) -> None:
        self._arm = arm
        longer = [re.escape(name) for name in arms if name != arm and name.startswith(arm)]
        none = "".join(f"(?!{name}[./_])" for name in longer)
        self._pattern = re.compile(rf"((?:.*?[./])?){none}{re.escape(arm)}[./_](.+)")

    def __call__(self, name: str) -> str | None:
        """Return the name without the arm's; None for a column of another arm, or of none."""
        match = self._pattern.fullmatch(name)
        return None if match is None else match[1] + match[2]

    def columns(self, names: Sequence[str]) -> dict[str, str]:
        """Return the columns of the arm, by their names without its own.

        Raises:
            ValueError: If two columns have one name.
        """
        found: dict[str, str] = {}
        for name in names:
            if (own := self(name)) is None:
                continue
            if own in found:
                raise ValueError(f"columns: {found[own]} and {name} are both {own} of {self._arm}")
            found[own] = name
        return found


def _table(table: Table, rename: _Rename) -> Table | None:
    """Return the columns of an arm; None without any."""
    columns = rename.columns(table.names)
    if not columns:
        return None
    shared = {name: name for name in (CHUNK, ISSUED) if name in table.names}
    columns = {**shared, **columns}
    own = {name: bare for bare, name in columns.items()}
    series = {
        stem: tuple(own[name] for name in names if name in own)
        for stem, names in table.series.items()
    }
    return replace(
        table,
        names=tuple(columns),
        values=table.values[:, [table.names.index(name) for name in columns.values()]],
        series={stem: names for stem, names in series.items() if names},
        texts={own[name]: text for name, text in table.texts.items() if name in own},
    )


def _points(points: Points, rename: _Rename) -> Points | None:
    columns = rename.columns(points.names)
    places = [points.names.index(name) for name in columns.values()]
    rows = tuple(row[:, places] for row in points.rows)
    return points._replace(names=tuple(columns), rows=rows) if columns else None


def _call(call: RecordedCall, rename: _Rename) -> RecordedCall | None:
    columns = rename.columns(call.joints)
    places = [call.joints.index(name) for name in columns.values()]
    own = call._replace(joints=tuple(columns), values=call.values[:, places])
    return own if columns else None


def _names_of(recording: Recording) -> list[tuple[str, ...]]:
    """Return lists of names of columns."""
    names = [table.names for table in recording.tables]
    names += [] if recording.points is None else [recording.points.names]
    return list(dict.fromkeys([*names, *(call.joints for call in recording.calls)]))


def _require_clear(names: Sequence[str], joints: Mapping[str, Sequence[str]]) -> None:
    """Raise a ValueError for columns that are like those of an arm, and name none of these."""
    renames = [_Rename(arm, joints) for arm in joints]
    bare = {split_unit(name)[0] for rename in renames for name in rename.columns(names)}
    shared = {CHUNK, ISSUED}.union(*(rename.columns(names).values() for rename in renames))
    others = [name for name in names if name not in shared]
    for name in others:
        match = re.fullmatch(r"(.+?)[/._](.+)", split_unit(name)[0])
        if match and match[2] in bare:
            raise ValueError(f"column {name}: no arm {match[1]!r}; {nearest(match[1], [*joints])}")
    table = Table(np.zeros(0), tuple(others), np.zeros((0, len(others))), {}, {})
    for each in joints.values():
        if not isinstance(found := target_columns(table, each, None), str):
            text, arms = ", ".join(found[1].names[:_TOLD]), " or ".join(f"{x}/" for x in joints)
            raise ValueError(f"columns {text}: are of no arm; must begin with {arms}, as others do")
