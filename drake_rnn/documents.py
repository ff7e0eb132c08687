"""YAML files in and out, and errors that name the key, its value and what it may be."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from difflib import get_close_matches
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np
from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import YAMLError
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from .errors import InvalidInputError

T = TypeVar("T")


def parse_yaml(text: str, source: str) -> Any:
    """Contents of a YAML 1.2 document; duplicate keys are refused."""
    try:
        return YAML(typ="safe", pure=True).load(text)
    except DuplicateKeyError as error:
        key = str(error.problem).split('"')[1]
        raise InvalidInputError(f"{source}: the key {key!r} stands twice") from None
    except YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""
        problem = " ".join(str(problem or error).split()).removeprefix("but ")
        raise InvalidInputError(f"{source}: not a YAML document: {place}{problem}") from None


def read_yaml(file: Path) -> Any:
    """Contents of a YAML 1.2 file.

    Raises:
        InvalidInputError: If it is missing, unreadable or holds a key twice.
    """
    try:
        text = file.read_text()
    except OSError as error:
        raise InvalidInputError(f"{file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InvalidInputError(f"{file}: not a text file") from None
    return parse_yaml(text, str(file))


def to_yaml(document: Mapping[str, Any]) -> str:
    """YAML text of plain data and arrays; reading it gives the same numbers, bit for bit."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 100
    stream = StringIO()
    yaml.dump(_quoted(plain(document)), stream)
    return stream.getvalue()


def _quoted(value: Any) -> Any:
    """``value`` with texts in quotes whose first sign may mean something else to YAML."""
    if isinstance(value, dict):
        return {_quoted(key): _quoted(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_quoted(entry) for entry in value]
    if isinstance(value, str) and not value[:1].isalnum():
        return DoubleQuotedScalarString(value)
    return value


def plain(value: Any) -> Any:
    """``value`` with arrays as lists and NumPy numbers as Python's."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return value


def construct(cls: type[T], values: Any, key: str) -> T:
    """An object of a validated class; ``key`` is where ``values`` stand in the document.

    Raises:
        InvalidInputError: In one line: the key, the value and what it may be.
    """
    if not isinstance(values, Mapping):
        raise InvalidInputError(f"{key}: must be a mapping of keys to values, not {values!r}")
    try:
        return TypeAdapter(cls).validate_python(dict(values))
    except ValidationError as error:
        raise InvalidInputError(_sentence(cls, error, key)) from None


def _sentence(cls: type, error: ValidationError, key: str) -> str:
    """The first thing wrong; the rest is often its consequence."""
    errors = error.errors(include_url=False)
    # Behind a misspelt key there is often one that is missing.
    first = next((e for e in errors if e["type"] in _UNKNOWN_KEY), errors[0])
    steps = _steps(first)
    where = ".".join([key, *steps] if key else steps)
    if first["type"] in _UNKNOWN_KEY:
        return f"{where}: no such key; " + nearest(steps[-1], _names_at(cls, steps[:-1]))
    if first["type"] in _MISSING:
        return f"{where}: must be given"
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InvalidInputError):
        # It says itself which key is to blame.
        return str(cause)
    # The members of a union that have been tried at this place.
    tried = [e for e in errors if _steps(e) == steps] if first["type"] != "value_error" else [first]
    message = " or ".join(dict.fromkeys(_message(e) for e in tried)).replace(" or must be ", " or ")
    if cause is not None and re.match(r"\w+: ", message):
        # A class names the field of its own that is wrong.
        return f"{where}.{message}" if where else message
    prefix = f"{where}: " if where else ""
    if (cause is not None and isinstance(first["input"], Mapping)) or ", not " in message:
        return prefix + message
    return f"{prefix}{message}, not {_short(first['input'])}"


_UNKNOWN_KEY = {"unexpected_keyword_argument", "extra_forbidden"}
_MISSING = {"missing", "missing_argument", "missing_keyword_only_argument"}
# What pydantic says of a type, in the words of a YAML file.
_WORDS = {
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "dataclass_type": "must be a mapping of keys to values",
    "dict_type": "must be a mapping of keys to values",
    "float_parsing": "must be a number",
    "float_type": "must be a number",
    "int_from_float": "must be an integer",
    "int_parsing": "must be an integer",
    "int_type": "must be an integer",
    "list_type": "must be a list",
    "string_type": "must be a text",
    "tuple_type": "must be a list",
}


def _message(error: Any) -> str:
    if error["type"] in _WORDS:
        return _WORDS[error["type"]]
    if error["type"] in {"too_long", "too_short"}:
        limits = error["ctx"]
        size = limits.get("max_length", limits.get("min_length"))
        return f"must have {size} entries, not {limits['actual_length']}"
    message = str(error["msg"]).removeprefix("Value error, ")
    message = message.replace("Input should be", "must be", 1)
    return message[:1].lower() + message[1:]


def _steps(error: Any) -> list[str]:
    return [str(step) for step in error["loc"] if not _is_type_name(step)]


def _is_type_name(step: object) -> bool:
    # Pydantic adds the tried member of a union to the location of an error.
    return isinstance(step, str) and ("[" in step or step in {"float", "int", "str", "bool"})


def _names_at(cls: type, steps: list[str]) -> list[str]:
    """The fields of the class that stands at ``steps`` within ``cls``."""
    for step in steps:
        field = getattr(cls, "__pydantic_fields__", {}).get(step)
        classes = (
            [] if field is None else [t for t in _members(field.annotation) if is_dataclass(t)]
        )
        cls = classes[0] if classes else cls  # type: ignore[assignment]
    return list(getattr(cls, "__dataclass_fields__", {}))


def _members(annotation: Any) -> Iterator[Any]:
    """``annotation`` and the types it is composed of."""
    yield annotation
    for member in get_args(annotation):
        yield from _members(member)


def _short(value: Any) -> str:
    try:
        text = repr(plain(value))
    except RecursionError:
        # A YAML alias may stand within what it stands for.
        text = f"a {type(value).__name__} within itself"
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(name: str, names: list[str]) -> str:
    """What to try instead of ``name``: the closest of ``names``, or all of them."""
    close = get_close_matches(name, names, n=3, cutoff=0.5)
    return "nearest: " + ", ".join(close) if close else "it may be " + ", ".join(names)
