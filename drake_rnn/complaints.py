"""What is wrong with an argument, in one sentence: the key, its value and what it may be."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from difflib import get_close_matches
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError
from pydantic_core import ArgsKwargs

from .errors import InvalidInputError


def sentence(cls: type, error: ValidationError, key: str) -> str:
    """Of the first thing wrong; the rest is often its consequence.

    Args:
        cls: That was to be constructed.
        error: Why it was not.
        key: Where its values stand in a document; may be empty.
    """
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
    if (
        cause is not None and isinstance(first["input"], (Mapping, ArgsKwargs))
    ) or ", not " in message:
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


def plain(value: Any) -> Any:
    """``value`` with arrays as lists and NumPy numbers as Python's."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return value
