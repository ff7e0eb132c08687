"""Meanings and units of a document's keys, and keys that do nothing beside its other keys.

Both are told where a field is declared, by `drake_rnn.inputs.keys.Meaning`, and looked up here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from ..environments import ENVIRONMENTS
from ..errors import InvalidInputError
from ..inputs.complaints import plain
from ..inputs.dataclass_fields import field_names, fields_of
from ..inputs.keys import Key, Only, default_of, described_class, keys_of, meanings_of, written
from ..inputs.kinds import Kinds
from ..laws import LAWS
from ..measures import METRICS
from ..paths import PATHS
from ..robot.arm_description import ArmDescription
from ..robot.limits import FIELD_UNITS
from .document import ExperimentDocument

_KINDS: dict[str, Kinds[Any]] = {"law": LAWS, "path": PATHS, "environment": ENVIRONMENTS}


def key_meanings() -> dict[str, str]:
    """Return the meanings of a document's keys, in order."""
    return {key.name: key.meaning for key in keys_of(ExperimentDocument, ())}


def section_meanings(name: str, value: Any) -> dict[str, str]:
    """Return the meanings of the keys of a section; empty if it has no keys.

    Args:
        name: Name of the section.
        value: The section's contents in the document.

    Raises:
        InvalidInputError: If the section names a kind that there is not.
    """
    return {key: known.meaning for key, known in _section_keys(name, value).items()}


def unit_of_key(document: Mapping[str, Any], key: str) -> str:
    """Return the unit of a key such as ``law.kappa``; empty if it has none, or is not known.

    Args:
        document: Document with the key; its kinds of law, path and environment decide the meaning.
        key: The dotted key, perhaps with the index of an entry, as in ``start[0]``.
    """
    section, *inner = re.sub(r"\[\d+\]", "", key).split(".")
    try:
        known = _key(section, document.get(section, {}), inner)
    except InvalidInputError:  # The document names an unknown kind.
        known = None
    return "" if known is None else known.unit


def _key(section: str, value: Any, inner: list[str]) -> Key | None:
    """Return a section's key, or a key within it; None if there is no such key."""
    if not inner:
        return _keys(ExperimentDocument).get(section)
    if len(inner) == 1:
        return _section_keys(section, value).get(inner[0])
    cls = _class_of(section, value)
    for part in inner[:-1]:
        cls = described_class(cls, part) if cls else None
    return _keys(cls).get(inner[-1]) if cls else None


def _section_keys(name: str, value: Any) -> dict[str, Key]:
    if not isinstance(value, Mapping):
        return {}
    if name == "accept":
        return {
            metric.name: Key(metric.name, None, f"{metric.meaning} [{metric.unit}]", metric.unit)
            for metric in METRICS
        }
    if name == "limits":
        return {limit: Key(limit, None, f"[{unit}]", unit) for limit, unit in FIELD_UNITS.items()}
    cls = _class_of(name, value)
    if cls is None:
        return {}
    return _keys(cls) | ({"kind": Key("kind", None, "")} if name in _KINDS else {})


def _class_of(section: str, value: Any) -> type | None:
    """Return the class that a section of a document describes; None if it has no keys."""
    if section in _KINDS:
        return _KINDS[section].named_by(value, modules=True)
    if section == "arm":
        return ArmDescription
    return described_class(ExperimentDocument, section)


def _keys(cls: type) -> dict[str, Key]:
    return {key.name: key for key in keys_of(cls, ())}


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


def _unmet(condition: Only, key: str, scopes: Sequence[_Scope]) -> str | None:
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
    needed = _conditions(cls, key)
    unmet = (_unmet(each, key, scopes) for each in needed)
    return next((each for each in unmet if each is not None), None)


def _conditions(cls: type, key: str) -> tuple[Only, ...]:
    """Return what a key of a class acts with; empty if it always acts."""
    known = meanings_of(cls).get(key) if field_names(cls) else None
    return () if known is None else known.only
