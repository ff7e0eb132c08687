"""YAML files in and out, and errors that name the key, its value and what it may be."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import YAMLError

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
        problem = " ".join(str(error).split())
        raise InvalidInputError(f"{source}: not a YAML document: {problem}") from None


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
    yaml.dump(plain(document), stream)
    return stream.getvalue()


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
    first = error.errors(include_url=False)[0]
    steps = [str(step) for step in first["loc"] if not _is_type_name(step)]
    where = ".".join(step for step in (key, *steps) if step)
    if first["type"] in {"unexpected_keyword_argument", "extra_forbidden"}:
        names = list(getattr(cls, "__dataclass_fields__", None) or getattr(cls, "model_fields", {}))
        return f"{where}: no such key; " + nearest(steps[-1], names)
    if first["type"] in {"missing", "missing_argument", "missing_keyword_only_argument"}:
        return f"{where}: must be given"
    message = first["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    if where == key and isinstance(first["input"], Mapping):
        return f"{where}: {message}" if where else message
    return f"{where}: {message}, not {_short(first['input'])}"


def _is_type_name(step: object) -> bool:
    # Pydantic adds the tried member of a union to the location of an error.
    return isinstance(step, str) and ("[" in step or step in {"float", "int", "str", "bool"})


def _short(value: Any) -> str:
    text = repr(plain(value))
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(name: str, names: list[str]) -> str:
    """What to try instead of ``name``: the closest of ``names``, or all of them."""
    close = get_close_matches(name, names, n=3, cutoff=0.5)
    return "nearest: " + ", ".join(close) if close else "it may be " + ", ".join(names)
