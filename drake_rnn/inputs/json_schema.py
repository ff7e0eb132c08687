"""JSON schemas of documents, made from the classes that check them, for editors.

An editor with a YAML language server completes keys by them, shows what keys mean and marks keys
that there are not. What several keys say together only the classes check.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, is_dataclass
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic.json_schema import JsonSchemaMode as Mode

from .complaints import plain
from .extensions import EXTENSION
from .keys import default_of, keys_of, summary_of

#: What the language servers of editors know.
DIALECT = "http://json-schema.org/draft-07/schema#"
_MODE: Literal["validation"] = "validation"

Schema = dict[str, Any]
#: Returns what a document may have in place of what the class says of a field; None for that.
Told = Callable[[type, str], "Schema | None"]


class Classes:
    """The schemas of classes that documents describe, which may refer to one another.

    Args:
        classes: The classes.
        told: Fields whose class says less than what reads the document, such as a section whose
            ``kind`` names its class.
        without: Fields of a class that a document does not give.

    Attributes:
        definitions: The schemas by name, those of the classes of their fields among them.
    """

    def __init__(
        self, classes: Sequence[type], told: Told, without: Callable[[type], Sequence[str]]
    ) -> None:
        class Generator(GenerateJsonSchema):
            """Pydantic's generator, with what docstrings and readers say of the fields."""

            def generate(self, schema: Any, mode: Mode = _MODE) -> JsonSchemaValue:
                return super().generate(schema, mode)

            def is_instance_schema(self, schema: Any) -> JsonSchemaValue:
                # What is no list is read from something else, which the key's class tells.
                return {"type": "array"} if schema["cls"] is np.ndarray else {}

            def tuple_schema(self, schema: Any) -> JsonSchemaValue:
                found = super().tuple_schema(schema)
                if (entries := found.pop("prefixItems", None)) is not None:
                    found["items"] = entries
                return found

            def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
                cls, left_out = schema["cls"], {*without(schema["cls"])}
                inner = schema["schema"]
                while "fields" not in inner:
                    inner = inner["schema"]
                kept = [field for field in inner["fields"] if field["name"] not in left_out]
                given: Any = {**schema, "schema": {**inner, "fields": kept}}
                found = super().dataclass_schema(given)
                return _explained(found, cls, told)

        adapters: Any = [(each, _MODE, TypeAdapter(each)) for each in classes]
        places, whole = TypeAdapter.json_schemas(
            adapters, schema_generator=Generator, ref_template="#/$defs/{model}"
        )
        self.definitions: dict[str, Schema] = _untitled(whole.get("$defs", {}))
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
    waiting = _referred(keys)
    while waiting:
        if (name := waiting.pop()) not in used:
            used[name] = definitions[name]
            waiting |= _referred(used[name])
    return {"$schema": DIALECT, "title": title, **keys, "$defs": dict(sorted(used.items()))}


def _referred(schema: Any) -> set[str]:
    """Return the names of the definitions that a schema refers to."""
    if isinstance(schema, dict):
        own = {schema["$ref"].rpartition("/")[2]} if isinstance(schema.get("$ref"), str) else set()
        return own.union(*map(_referred, schema.values()))
    return set().union(*map(_referred, schema)) if isinstance(schema, list) else set()


def of_kinds(refs: Mapping[str, Schema], kinds: Mapping[str, type], own: bool) -> Schema:
    """Return the schema of a section that names its class by its ``kind``.

    Args:
        refs: Schemas of the classes by kind.
        kinds: The classes by kind.
        own: Whether a class of another module may be named, ``module:Class``, with any keys.
    """
    may_be: Schema = {
        "enum": [*refs],
        "markdownEnumDescriptions": [summary_of(kinds[kind]) for kind in refs],
    }
    if own:
        may_be = {"anyOf": [may_be, {"type": "string", "pattern": ":"}]}
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


def _explained(schema: Schema, cls: type, told: Told) -> Schema:
    """Return the schema of a class with the meanings and defaults of its fields."""
    schema["description"] = summary_of(cls)
    properties = schema.get("properties", {})
    meanings = {key.name: key.meaning for key in keys_of(cls, ())}
    defaults = {field.name: default_of(field) for field in _fields(cls)}
    for name, found in properties.items():
        found.pop("default", None)
        if (other := told(cls, name)) is not None:
            found.clear()
            found.update(deepcopy(other))
        if meaning := meanings.get(name):
            found["description"] = meaning
        default = _as_json(defaults.get(name))
        if default is not None:
            found["default"] = default
    schema["properties"] = {name: properties[name] for name in meanings if name in properties}
    return schema


def _fields(cls: Any) -> Sequence[Any]:
    return fields(cls) if is_dataclass(cls) else ()


def _as_json(value: Any) -> Any:
    """Return a default that a document could give; None for one that it could not."""
    found = plain(value)
    if isinstance(found, list):
        return found if found and all(isinstance(each, (int, float)) for each in found) else None
    return found if isinstance(found, (bool, int, float, str)) and found != "" else None


def _untitled(value: Any) -> Any:
    """Return a schema without the titles that pydantic makes of names."""
    if isinstance(value, list):
        return [_untitled(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    # A property may be called title.
    return {
        key: {name: _untitled(entry) for name, entry in inner.items()}
        if key == "properties"
        else _untitled(inner)
        for key, inner in value.items()
        if not (key == "title" and isinstance(inner, str))
    }
