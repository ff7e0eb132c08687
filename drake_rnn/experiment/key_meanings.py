"""What the keys of a document mean, and their units: from the docstrings of the classes they make.

This is the one place where units of keys are looked up; they are written where the fields are
explained.
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
_UNIT = re.compile(r"\[((?:(?:rad|kg|Nm?|mm?|s|Hz|W|1)(?:\^\d)?|[ /()])+)\]")


def key_meanings() -> dict[str, str]:
    """Return what the keys of a document mean, in their order."""
    return _meanings(ExperimentDocument)


def section_meanings(name: str, value: Any) -> dict[str, str]:
    """Return what the keys within a section mean; empty if it has none.

    Args:
        name: The section.
        value: What the document says there.

    Raises:
        InvalidInputError: If the section names a kind that there is not.
    """
    if not isinstance(value, Mapping):
        return {}
    if name == "accept":
        return {metric.name: f"{metric.meaning} [{metric.unit}]" for metric in METRICS}
    if name == "limits":
        return {limit: f"[{unit}]" for limit, unit in FIELD_UNITS.items()}
    if name == "arm":
        return _meanings(ArmDescription)
    if name in _KINDS:
        cls = _KINDS[name].named_by(value, modules=True)
        return _meanings(cls) | {"kind": ""}
    found = _described(ExperimentDocument, name)
    return _meanings(found) if found else {}


def unit_of_key(document: Mapping[str, Any], key: str) -> str:
    """Return the unit of a key such as ``law.kappa``; empty if none is told.

    Args:
        document: The document that has the key, whose kinds of law, path and environment count.
        key: The dotted key, which may end with the place of an entry, as in ``start[0]``.
    """
    section, *inner = re.sub(r"\[\d+\]", "", key).split(".")
    try:
        meaning = _meaning(section, document.get(section, {}), inner)
    except InvalidInputError:  # of a kind that there is not
        meaning = ""
    found = _UNIT.search(meaning)
    return found[1] if found else ""


def _meaning(section: str, value: Any, inner: list[str]) -> str:
    """Return what a section means, or a key within it at any depth; empty if nothing is told."""
    if not inner:
        return key_meanings().get(section, "")
    if len(inner) == 1:
        return section_meanings(section, value).get(inner[0], "")
    cls: type | None = ArmDescription
    if section in _KINDS:
        cls = _KINDS[section].named_by(value, modules=True)
    elif section != "arm":
        cls = _described(ExperimentDocument, section)
    for part in inner[:-1]:
        cls = _described(cls, part) if cls else None
    return _meanings(cls).get(inner[-1], "") if cls else ""


def _described(cls: type, field: str) -> type | None:
    """Return the class of the parts of a field, if it has any."""
    hint = get_type_hints(cls).get(field)
    classes = [each for each in (hint, *get_args(hint)) if is_dataclass(each)]
    return classes[0] if classes and isinstance(classes[0], type) else None


def _meanings(cls: type) -> dict[str, str]:
    return {key.name: key.meaning for key in keys_of(cls, ())}
