"""Meanings and units of a document's keys, read from the docstrings of the classes they describe.

Units are written once, where a field is explained, and looked up here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from ..environments import ENVIRONMENTS
from ..errors import InvalidInputError
from ..inputs.explained import keys_of
from ..inputs.kinds import Kinds
from ..laws import LAWS
from ..measures import METRICS
from ..paths import PATHS
from ..robot.arm_description import ArmDescription
from ..robot.limits import FIELD_UNITS
from .document import ExperimentDocument

_KINDS: dict[str, Kinds[Any]] = {"law": LAWS, "path": PATHS, "environment": ENVIRONMENTS}
#: A unit in brackets, and not a range or a list; a shape stands in parentheses.
_UNIT = re.compile(r"\[((?:(?:rad|kg|Nm?|mm?|s|Hz|W|px|1)(?:\^\d)?|[ /()])+)\]")


def key_meanings() -> dict[str, str]:
    """Return the meanings of a document's keys, in order."""
    return _meanings(ExperimentDocument)


def section_meanings(name: str, value: Any) -> dict[str, str]:
    """Return the meanings of the keys of a section; empty if it has no keys.

    Args:
        name: Name of the section.
        value: The section's contents in the document.

    Raises:
        InvalidInputError: If the section names a kind that there is not.
    """
    if not isinstance(value, Mapping):
        return {}
    if name == "accept":
        return {metric.name: f"{metric.meaning} [{metric.unit}]" for metric in METRICS}
    if name == "limits":
        return {limit: f"[{unit}]" for limit, unit in FIELD_UNITS.items()}
    found = _class_of(name, value)
    return _meanings(found) | ({"kind": ""} if name in _KINDS else {}) if found else {}


def unit_of_key(document: Mapping[str, Any], key: str) -> str:
    """Return the unit of a key such as ``law.kappa``; empty if the unit is not documented.

    Args:
        document: Document with the key; its kinds of law, path and environment decide the meaning.
        key: The dotted key, perhaps with the index of an entry, as in ``start[0]``.
    """
    section, *inner = re.sub(r"\[\d+\]", "", key).split(".")
    try:
        meaning = _meaning(section, document.get(section, {}), inner)
    except InvalidInputError:  # The document names an unknown kind.
        meaning = ""
    found = _UNIT.search(meaning)
    return found[1] if found else ""


def _meaning(section: str, value: Any, inner: list[str]) -> str:
    """Return the meaning of a section or of a key within it; empty if it is not documented."""
    if not inner:
        return key_meanings().get(section, "")
    if len(inner) == 1:
        return section_meanings(section, value).get(inner[0], "")
    cls = _class_of(section, value)
    for part in inner[:-1]:
        cls = _described(cls, part) if cls else None
    return _meanings(cls).get(inner[-1], "") if cls else ""


def _class_of(section: str, value: Any) -> type | None:
    """Return the class that a section of a document describes; None if it has no keys."""
    if section in _KINDS:
        return _KINDS[section].named_by(value, modules=True)
    return ArmDescription if section == "arm" else _described(ExperimentDocument, section)


def _described(cls: type, field: str) -> type | None:
    """Return the class of a field's value, or of its entries; None if it is no dataclass."""
    hint = get_type_hints(cls).get(field)
    classes = [each for each in (hint, *get_args(hint)) if is_dataclass(each)]
    return classes[0] if classes and isinstance(classes[0], type) else None


def _meanings(cls: type) -> dict[str, str]:
    return {key.name: key.meaning for key in keys_of(cls, ())}
