"""The keys that a class of a document has, explained by its own fields and docstring."""

from __future__ import annotations

import inspect
import re
from dataclasses import MISSING, dataclass, fields
from typing import Any

from pydantic.fields import FieldInfo

from .complaints import plain
from .dataclass_fields import fields_of

# "    name, other: Meaning" of a docstring's Args; further lines are indented deeper.
_ENTRY = re.compile(r"    (\w+(?:, \w+)*): (.*)")
# Marks of reStructuredText, which a terminal does not need.
_MARKS = re.compile(r"``|`")


@dataclass(frozen=True)
class Key:
    """A key of a document.

    Attributes:
        name: Its name.
        default: What it is if it is not given, as text; None if it must be given.
        meaning: What the docstring says of it; empty if it says nothing.
    """

    name: str
    default: str | None
    meaning: str


def keys_of(cls: type, without: tuple[str, ...] = ("kind",)) -> list[Key]:
    """Return the keys of a dataclass that a document describes.

    Args:
        cls: The class.
        without: Fields to leave out.
    """
    meanings = _meanings(cls)
    described: Any = cls
    return [
        Key(field.name, _default(field), meanings.get(field.name, ""))
        for field in fields(described)
        if field.name not in without
    ]


def first_sentence(thing: object) -> str:
    """Return the first sentence of a docstring, in one line without marks."""
    paragraph = (inspect.getdoc(thing) or "").split("\n\n")[0]
    return shortened(" ".join(_MARKS.sub("", paragraph).split()))


def shortened(text: str) -> str:
    """Return the first sentence of a text; a dot within brackets or a number ends none."""
    return re.split(r"(?<=[^.\s]\.)\s+(?=[A-Z])", text, maxsplit=1)[0]


def default_of(field: Any) -> Any:
    """Return the default of a dataclass's field; ``dataclasses.MISSING`` if it must be given."""
    value = field.default
    if isinstance(value, FieldInfo):
        return value.get_default(call_default_factory=True, validated_data={})
    if field.default_factory is not MISSING:
        return field.default_factory()
    return value


def _default(field: Any) -> str | None:
    value = default_of(field)
    return None if value is MISSING else written(plain(value))


def written(value: Any) -> str:
    """Return a value of a key as a document could write it, in one line."""
    if value is None or value in ("", {}, []):
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if parts := fields_of(value):
        return "{" + ", ".join(f"{name}: {written(part)}" for name, part in parts.items()) + "}"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _meanings(cls: type) -> dict[str, str]:
    """Return what docstrings say of each field; a class's own before those of its bases."""
    found: dict[str, str] = {}
    for each in cls.__mro__:
        for name, meaning in _arguments(each).items():
            # "See `Base`." leaves it to the base.
            if not meaning.startswith("See "):
                found.setdefault(name, meaning)
    return found


def _arguments(cls: type) -> dict[str, str]:
    text = inspect.cleandoc(vars(cls).get("__doc__") or "")
    _, _, block = text.partition("\nArgs:\n")
    found: dict[str, str] = {}
    names: list[str] = []
    for line in block.splitlines():
        if line and not line.startswith(" "):
            break
        if entry := _ENTRY.fullmatch(line):
            names = entry[1].split(", ")
        text = entry[2] if entry else line
        for name in names:
            found[name] = f"{found.get(name, '')} {_MARKS.sub('', text).strip()}".strip()
    return found
