"""Keys of a document that do nothing beside its other keys.

What a key acts with is said once, where its class explains it, and where editors, ``drake-rnn
laws`` and the pages read it too::

    blend: Weight of the velocity's square. Acts only with ``cost: largest_velocity``.
    limits_zone: Way before a position limit [rad]. Acts only with ``limits``.

The other key is of the same section, of one around it, or of the document. Several values are
joined by "or"; without one the key acts with any but none, false and 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np

from ..inputs.complaints import plain
from ..inputs.dataclass_fields import field_names, fields_of
from ..inputs.explained import default_of, keys_of, written

#: How a docstring says it, without its marks.
SAID = re.compile(r"Acts only with (\w+)(?:: (\w+(?:(?:, | or )\w+)*))?[.;,]")


@dataclass(frozen=True)
class Condition:
    """What another key must be so that a key acts.

    Attributes:
        key: Name of the other key.
        values: What it may be; empty for anything but none, false and 0.
    """

    key: str
    values: tuple[str, ...]

    def holds(self, value: Any) -> bool:
        """Return whether the other key has such a value."""
        if self.values:
            return value in self.values
        if value is None or isinstance(value, str):
            return value not in (None, "none")
        return bool(np.any(value)) if isinstance(value, (bool, float, int, np.ndarray)) else True

    def __str__(self) -> str:
        *others, last = self.values or ("",)
        return f"{', '.join(others)} or {last}" if others else last


@cache
def conditions(cls: type) -> dict[str, tuple[Condition, ...]]:
    """Return what the keys of a class act with, by name; keys that always act are left out."""
    found = {}
    for key in keys_of(cls, ()):
        # The last sentence of a docstring may lack its point.
        told = SAID.findall(f"{key.meaning}.")
        if told:
            found[key.name] = tuple(
                Condition(other, tuple(re.split(", | or ", values)) if values else ())
                for other, values in told
            )
    return found


#: A section with its dotted name, which ends in a point unless it is the document's own.
_Scope = tuple[str, Any]


def idle_keys(document: Any, **sections: Any) -> Iterator[str]:
    """Yield a sentence for each key of a document that does nothing beside the others.

    Args:
        document: The document.
        sections: What was made of sections that it holds as plain data, by name.
    """
    for name, value in fields_of(document).items():
        made = sections.get(name, value)
        given = value if isinstance(value, Mapping) else _changed(value)
        yield from _idle(given, [(f"{name}.", made), ("", document)])


def _changed(section: Any) -> dict[str, Any]:
    """Return the fields of a section that differ from their defaults, and those within them."""
    found = {}
    for field in fields(section) if field_names(type(section)) else ():
        name, default = field.name, default_of(field)
        value = fields_of(section)[name]
        if type(value) is type(default) and field_names(type(value)):
            if within := _changed(value):
                found[name] = within
        elif plain(value) != plain(default):
            found[name] = value
    return found


def _idle(given: Mapping[str, Any], scopes: Sequence[_Scope]) -> Iterator[str]:
    """Yield a sentence for each idle key of a section, the first of the scopes."""
    place, made = scopes[0]
    for key, value in given.items():
        if (unmet := _first_unmet(key, scopes)) is not None:
            yield f"{place}{key}: does nothing here; it acts only with {unmet}"
        elif isinstance(value, Mapping):
            yield from _idle(value, [(f"{place}{key}.", fields_of(made).get(key)), *scopes])


def _unmet(condition: Condition, key: str, scopes: Sequence[_Scope]) -> str | None:
    """Return what a condition is, and what there is instead; None if it holds.

    It does not hold either if the other key does nothing itself.
    """
    for number, (place, made) in enumerate(scopes):
        # No key is its own condition: it may be called as a section further out.
        known = fields_of(made)
        if condition.key not in known or (not number and condition.key == key):
            continue
        value = known[condition.key]
        if condition.holds(value):
            return _first_unmet(condition.key, scopes[number:])
        wanted = f": {condition}" if condition.values else ""
        instead = "is not given" if value is None else f"is {written(plain(value))}"
        return f"{place}{condition.key}{wanted}, which {instead}"
    return None


def _first_unmet(key: str, scopes: Sequence[_Scope]) -> str | None:
    """Return what a key of the first scope lacks to act; None if it acts."""
    cls: Any = type(scopes[0][1])
    needed = conditions(cls).get(key, ()) if field_names(cls) else ()
    unmet = (_unmet(each, key, scopes) for each in needed)
    return next((each for each in unmet if each is not None), None)
