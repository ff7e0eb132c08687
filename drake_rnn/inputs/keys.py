"""The keys that a class of a document has: what each means, in which unit, and with what it acts.

That is metadata of the fields, which editors, ``drake-rnn laws``, the pages and warnings read::

    blend: Annotated[
        Positive,
        Meaning("Weight of the velocity's square.", only=(Only("cost", "largest_velocity"),)),
    ] = 0.1
    zone: Annotated[Positive, Meaning("Way before a limit.", unit="rad")] = 0.2

JSON schemas of documents are made from these classes. An editor with a YAML language server
completes keys by them, shows what keys mean and marks keys that there are not. What several keys
say together only the classes check.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from textwrap import wrap
from types import MappingProxyType
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
from pydantic import TypeAdapter
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic.json_schema import JsonSchemaMode as Mode

from .documents import EXTENSION
from .messages import fields_of, plain

#: What a key is said to act with if another one is a list.
LISTED = "a list of objectives"
# Marks of reStructuredText, which a terminal does not need.
_MARKS = re.compile(r"``|`")


@dataclass(frozen=True, init=False)
class Only:
    """What another key must be so that a key acts; beside anything else it does nothing.

    The other key is of the same section, of one around it, or of the document.

    Attributes:
        key: Name of the other key.
        values: What it may be; empty for anything but none, false and 0.
    """

    key: str
    values: tuple[str, ...]

    def __init__(self, key: str, *values: str) -> None:
        object.__setattr__(self, "key", key)
        object.__setattr__(self, "values", values)

    def holds(self, value: Any) -> bool:
        """Return whether the other key has such a value."""
        if self.values:
            word = LISTED if isinstance(value, (list, tuple)) else value
            return word in self.values
        if value is None or isinstance(value, str):
            return value not in (None, "none")
        return bool(np.any(value)) if isinstance(value, (bool, float, int, np.ndarray)) else True

    def __str__(self) -> str:
        *others, last = self.values or ("",)
        return f"{', '.join(others)} or {last}" if others else last


@dataclass(frozen=True)
class Meaning:
    """What a field means, as metadata of its annotation.

    Attributes:
        text: The meaning, in sentences.
        unit: Its unit; empty for a pure number, or for what is no number. It is written where the
            first clause ends, unless the text has it in brackets.
        only: What other keys must be so that the field acts.
    """

    text: str
    unit: str = ""
    only: tuple[Only, ...] = ()

    def __str__(self) -> str:
        text = self.text
        if self.unit and f"[{self.unit}]" not in text:
            ends = [end for end in (text.find(". "), text.find("; ")) if end >= 0]
            end = min(ends, default=len(text) - text.endswith("."))
            text = f"{text[:end]} [{self.unit}]{text[end:]}"
        conditions = (
            f"``{each.key}: {each}``" if each.values else f"``{each.key}``" for each in self.only
        )
        return f"{text} Acts only with {' and '.join(conditions)}." if self.only else text


_UNKNOWN = Meaning("")


@dataclass(frozen=True)
class Key:
    """A key of a document.

    Attributes:
        name: Its name.
        default: What it is if it is not given, as text; None if it must be given.
        meaning: What its field says of it, with its unit; empty if it says nothing.
        unit: Its unit; empty without one.
        only: What other keys must be so that it acts.
    """

    name: str
    default: str | None
    meaning: str
    unit: str = ""
    only: tuple[Only, ...] = ()


def keys_of(cls: type, without: tuple[str, ...] = ("kind",)) -> list[Key]:
    """Return the keys of a dataclass that a document describes.

    Args:
        cls: The class.
        without: Fields to leave out.
    """
    target: Any = cls
    keys = []
    for field in fields(target):
        if field.name not in without:
            meaning = meanings_of(cls).get(field.name, _UNKNOWN)
            text = _MARKS.sub("", str(meaning))
            keys.append(Key(field.name, _default(field), text, meaning.unit, meaning.only))
    return keys


@cache
def meanings_of(cls: type) -> Mapping[str, Meaning]:
    """Return the meanings of a dataclass's fields, by name; fields without one are left out.

    A field that a class declares anew means what it does in its bases, unless the class says it.
    """
    meanings = {}
    for each in reversed(cls.__mro__):
        for name, hint in get_type_hints(each, include_extras=True).items():
            meanings_in_hint = [part for part in get_args(hint)[1:] if isinstance(part, Meaning)]
            if meanings_in_hint:
                meanings[name] = meanings_in_hint[-1]
    return MappingProxyType(meanings)


def described_class(cls: type, field: str) -> type | None:
    """Return the class of a field's value, or of its entries; None if it is no dataclass."""
    hint = get_type_hints(cls).get(field)
    classes = [each for each in (hint, *get_args(hint)) if is_dataclass(each)]
    return classes[0] if classes and isinstance(classes[0], type) else None


def with_arguments(cls: type) -> str | None:
    """Return a class's docstring with the meanings of its fields; None if it has no docstring."""
    if cls.__doc__ is None:
        return None
    lines = []
    for name, meaning in meanings_of(cls).items():
        lines += wrap(f"{name}: {meaning}", 96, initial_indent=" " * 4, subsequent_indent=" " * 8)
    above, *below = re.split(
        r"\n\n(?=Attributes:|Raises:)", inspect.cleandoc(cls.__doc__), maxsplit=1
    )
    arguments = ["\n".join(("Args:", *lines))] if lines and "\nArgs:" not in above else []
    return "\n\n".join((above, *arguments, *below))


def summary_of(cls: type) -> str:
    """Return what a class is in a sentence: its own ``summary``, or the docstring's first one."""
    return str(vars(cls).get("summary") or first_sentence(cls))


def first_sentence(thing: object) -> str:
    """Return the first sentence of a docstring, in one line without marks."""
    paragraph = (inspect.getdoc(thing) or "").split("\n\n")[0]
    return shorten(" ".join(_MARKS.sub("", paragraph).split()))


def shorten(text: str) -> str:
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
    return None if value is MISSING else format_value(plain(value))


def format_value(value: Any) -> str:
    """Return a value of a key as a document could write it, in one line."""
    if value is None or value in ("", {}, []):
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if parts := fields_of(value):
        return (
            "{" + ", ".join(f"{name}: {format_value(part)}" for name, part in parts.items()) + "}"
        )
    return f"{value:g}" if isinstance(value, float) else str(value)


#: What the language servers of editors know.
DIALECT = "http://json-schema.org/draft-07/schema#"
_MODE: Literal["validation"] = "validation"

Schema = dict[str, Any]
#: Returns what a document may have in place of what the class says of a field; None for that.
MeaningOf = Callable[[type, str], "Schema | None"]


class Classes:
    """The schemas of classes that documents describe, which may refer to one another.

    Args:
        classes: The classes.
        meaning_of: Fields whose class says less than what reads the document, such as a section
            whose ``kind`` names its class.
        without: Fields of a class that a document does not give.

    Attributes:
        definitions: The schemas by name, those of the classes of their fields among them.
    """

    def __init__(
        self,
        classes: Sequence[type],
        meaning_of: MeaningOf,
        without: Callable[[type], Sequence[str]],
    ) -> None:
        class Generator(GenerateJsonSchema):
            """Pydantic's generator, with what docstrings and readers say of the fields."""

            def generate(self, schema: Any, mode: Mode = _MODE) -> JsonSchemaValue:
                return super().generate(schema, mode)

            def is_instance_schema(self, schema: Any) -> JsonSchemaValue:
                # What is no list is read from something else, which the key's class tells.
                return {"type": "array"} if schema["cls"] is np.ndarray else {}

            def tuple_schema(self, schema: Any) -> JsonSchemaValue:
                schema_of_tuple = super().tuple_schema(schema)
                if (entries := schema_of_tuple.pop("prefixItems", None)) is not None:
                    schema_of_tuple["items"] = entries
                return schema_of_tuple

            def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
                cls, left_out = schema["cls"], {*without(schema["cls"])}
                inner = schema["schema"]
                while "fields" not in inner:
                    inner = inner["schema"]
                fields_left = [field for field in inner["fields"] if field["name"] not in left_out]
                keys: Any = {**schema, "schema": {**inner, "fields": fields_left}}
                schema_of_class = super().dataclass_schema(keys)
                return _explain(schema_of_class, cls, meaning_of)

        adapters: Any = [(each, _MODE, TypeAdapter(each)) for each in classes]
        places, whole = TypeAdapter.json_schemas(
            adapters, schema_generator=Generator, ref_template="#/$defs/{model}"
        )
        self.definitions = _without_aliases(_drop_titles(whole.get("$defs", {})))
        self._names = {cls: places[cls, _MODE]["$ref"] for cls in classes}

    def ref(self, cls: type) -> Schema:
        """Return a reference to the schema of a class."""
        return {"$ref": self._names[cls]}

    def of(self, cls: type) -> Schema:
        """Return the schema of a class itself, which may be changed."""
        return self.definitions[self._names[cls].rpartition("/")[2]]


def whole_document(schema: Schema, title: str, definitions: Mapping[str, Schema]) -> Schema:
    """Return the schema of a whole document, whose extensions editors leave alone.

    Args:
        schema: Schema of its keys.
        title: What the document is.
        definitions: What it refers to.
    """
    keys = {**schema, "patternProperties": {f"^{EXTENSION}": True}}
    used: dict[str, Schema] = {}
    waiting = _references_in(keys)
    while waiting:
        if (name := waiting.pop()) not in used:
            used[name] = definitions[name]
            waiting |= _references_in(used[name])
    return {"$schema": DIALECT, "title": title, **keys, "$defs": dict(sorted(used.items()))}


def _references_in(schema: Any) -> set[str]:
    """Return the names of the definitions that a schema refers to."""
    if isinstance(schema, dict):
        own = {schema["$ref"].rpartition("/")[2]} if isinstance(schema.get("$ref"), str) else set()
        return own.union(*map(_references_in, schema.values()))
    return set().union(*map(_references_in, schema)) if isinstance(schema, list) else set()


def of_kinds(refs: Mapping[str, Schema], kinds: Mapping[str, type], own: bool) -> Schema:
    """Return the schema of a section that names its class by its ``kind``.

    Args:
        refs: Schemas of the classes by kind.
        kinds: The classes by kind.
        own: Whether a class of another module may be named, ``module:Class``, with any keys.
    """
    may_be: Schema = {"type": "string", "pattern": ":"}
    if refs:
        descriptions = [summary_of(kinds[kind]) for kind in refs]
        schema = {"enum": [*refs], "markdownEnumDescriptions": descriptions}
        may_be = {"anyOf": [schema, may_be]} if own else schema
    branches = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": ref,
        }
        for kind, ref in refs.items()
    ]
    return {
        "type": "object",
        "required": ["kind"],
        "properties": {"kind": may_be},
        "allOf": branches,
    }


def with_kind(schema: Schema, kind: str) -> None:
    """Let the schema of a class have its ``kind`` beside its other keys."""
    schema["properties"] = {**schema.get("properties", {}), "kind": {"const": kind}}


def or_null(schema: Schema) -> Schema:
    """Return the schema of a value that may be left open."""
    return {"anyOf": [schema, {"type": "null"}]}


def _explain(schema: Schema, cls: type, meaning_of: MeaningOf) -> Schema:
    """Return the schema of a class with the meanings and defaults of its fields."""
    schema["description"] = summary_of(cls)
    properties = schema.get("properties", {})
    meanings = {key.name: key.meaning for key in keys_of(cls, ())}
    defaults = {field.name: default_of(field) for field in _fields(cls)}
    for name, property_schema in properties.items():
        property_schema.pop("default", None)
        if (other := meaning_of(cls, name)) is not None:
            property_schema.clear()
            property_schema.update(deepcopy(other))
        if meaning := meanings.get(name):
            property_schema["description"] = meaning
        default = _as_json(defaults.get(name))
        if default is not None:
            property_schema["default"] = default
    schema["properties"] = {name: properties[name] for name in meanings if name in properties}
    return schema


def _fields(cls: Any) -> Sequence[Any]:
    return fields(cls) if is_dataclass(cls) else ()


def _as_json(value: Any) -> Any:
    """Return a default that a document could give; None for one that it could not."""
    data = plain(value)
    if isinstance(data, list):
        return data if data and all(isinstance(each, (int, float)) for each in data) else None
    return data if isinstance(data, (bool, int, float, str)) and data != "" else None


def _without_aliases(definitions: dict[str, Schema]) -> dict[str, Schema]:
    """Return definitions with arrays where they stand: newer NumPy has NDArray as an alias."""
    arrays = {f"#/$defs/{name}": definitions[name] for name in definitions if "NDArray" in name}

    def replaced(value: Any) -> Any:
        if isinstance(value, list):
            return [replaced(entry) for entry in value]
        if not isinstance(value, dict):
            return value
        if isinstance(ref := value.get("$ref"), str) and ref in arrays:
            return {**arrays[ref], **{key: value[key] for key in value if key != "$ref"}}
        return {key: replaced(entry) for key, entry in value.items()}

    kept = {name: each for name, each in definitions.items() if f"#/$defs/{name}" not in arrays}
    return {name: replaced(each) for name, each in kept.items()}


def _drop_titles(value: Any) -> Any:
    """Return a schema without the titles that pydantic makes of names."""
    if isinstance(value, list):
        return [_drop_titles(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    # A property may be called title.
    return {
        key: {name: _drop_titles(entry) for name, entry in inner.items()}
        if key == "properties"
        else _drop_titles(inner)
        for key, inner in value.items()
        if not (key == "title" and isinstance(inner, str))
    }
