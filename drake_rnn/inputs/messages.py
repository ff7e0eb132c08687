"""One-sentence messages about invalid arguments: the key, its value and what it may be.

- The fields of dataclasses by name.
- What is a number, in Python and in a text.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import is_dataclass
from difflib import get_close_matches
from math import isfinite
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin

from ..errors import InvalidInputError

T = TypeVar("T")


def field_names(cls: type) -> tuple[str, ...]:
    """Return the names of a dataclass's fields; an empty tuple for any other class."""
    # Only dataclasses have this attribute.
    return tuple(getattr(cls, "__dataclass_fields__", ()))


def replace_unchecked(value: Any, **fields: Any) -> Any:
    """Return a copy of a dataclass object with other values of some fields, which nothing checks.

    So a field is set to what is no argument, as an entry for each of many robots.
    """
    copy = object.__new__(type(value))
    copy.__dict__.update(fields_of(value) | fields)
    return copy


def fields_of(value: object) -> dict[str, Any]:
    """Return the fields of a dataclass object by name; an empty mapping for any other object."""
    # Not listed one by one, so that code that copies or writes an object covers new fields too.
    return {name: getattr(value, name) for name in field_names(type(value))}


# Names that a message tells if none is close: all up to this number, of more than that some.
_MOST_NAMES, _SOME_NAMES = 40, 8
# Errors that are looked at; each is compared with each other one.
_MOST_ERRORS = 200


def sentence(cls: type, error: Sequence[Any], key: str) -> str:
    """Return a message about the first error; the others often follow from it.

    Args:
        cls: Class that could not be constructed.
        error: Errors that pydantic found, see `ValidationError.errors`.
        key: Key of the values in a document; may be empty.
    """
    # A misspelt key often makes another one missing: report the misspelt one.
    unknown = [each for each in error if each["type"] in _UNKNOWN_KEY]
    errors = _fitting(cls, [*unknown[:1], *error[:_MOST_ERRORS]])
    first = next((e for e in errors if e["type"] in _UNKNOWN_KEY), errors[0])
    place = _place(cls, first)
    keys = place.keys
    where = ".".join([key, *keys] if key else keys)
    if first["type"] in _UNKNOWN_KEY:
        names = field_names(place.within)
        return f"{where}: no such key; " + nearest(keys[-1], list(names))
    if first["type"] in _MISSING:
        return f"{where}: must be given"
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InvalidInputError):
        # The message already names the invalid key.
        return str(cause)
    # All members of a union that were tried at this place.
    errors_here = [first]
    if first["type"] != "value_error":
        errors_here = [e for e in errors if _place(cls, e).keys == keys]
    message = " or ".join(dict.fromkeys(_message(e) for e in errors_here)).replace(
        " or must be ", " or "
    )
    if cause is not None and re.match(r"\w+: ", message):
        # The class itself named the invalid field.
        return f"{where}.{message}" if where else message
    prefix = f"{where}: " if where else ""
    # A message about a whole object needs no value, and some messages already contain it.
    if (cause is not None and is_dataclass(place.type)) or ", not " in message:
        return prefix + message
    return f"{prefix}{message}, not {short(first['input'])}"


_UNKNOWN_KEY = {"unexpected_keyword_argument", "extra_forbidden"}
_MISSING = {"missing", "missing_argument", "missing_keyword_only_argument"}
# Messages for pydantic's type errors, in the terms of a YAML file.
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
    "string_type": "must be text",
    "tuple_type": "must be a list",
}
# For a member of a union, these errors mean that another member was intended.
_OF_ANOTHER_KIND = {*_WORDS, "is_instance_of", "literal_error"}


def _message(error: Any) -> str:
    if error["type"] in _WORDS:
        return _WORDS[error["type"]]
    if error["type"] in {"too_long", "too_short"}:
        limits = error["ctx"]
        size = limits.get("max_length", limits.get("min_length"))
        return f"must have {plural(size, 'entry', 'entries')}, not {limits['actual_length']}"
    message = str(error["msg"]).removeprefix("Value error, ")
    message = message.replace("Input should be", "must be", 1)
    return message[:1].lower() + message[1:]


class _Place(NamedTuple):
    """Place of an error in a document.

    Attributes:
        keys: Keys that lead there.
        within: Type that the last key belongs to.
        type: Type of the value there.
        whole: Whether the error is about the whole value as one member of a union.
    """

    keys: list[str]
    within: Any
    type: Any
    whole: bool


def _place(cls: type, error: Any) -> _Place:
    keys: list[str] = []
    at: Any = cls
    within, whole = at, False
    for step in error["loc"]:
        members = _members(at)
        # For a union, except X | None, pydantic adds the name of the member that it tried.
        whole = len(members) > 1
        if whole:
            at = _member(members, step)
        elif step != "[key]":
            within = members[0]
            at = _inner(within, step)
            keys.append(str(step))
    return _Place(keys, within, _members(at)[0], whole)


def _fitting(cls: type, errors: list[Any]) -> list[Any]:
    """Return the errors without those of union members intended for other kinds of values."""

    def misfit(error: Any) -> bool:
        return error["type"] in _OF_ANOTHER_KIND and _place(cls, error).whole

    places = [error["loc"] for error in errors if not misfit(error)]

    def stays(error: Any) -> bool:
        union = error["loc"][:-1]
        return not misfit(error) or all(loc[: len(union)] != union for loc in places)

    return [error for error in errors if stays(error)]


def _members(annotation: Any) -> list[Any]:
    """Return the members of a union except None; for any other type, the type itself."""
    if get_origin(annotation) is Annotated:
        return _members(get_args(annotation)[0])
    if get_origin(annotation) not in {Union, UnionType}:
        return [annotation]
    return [member for member in get_args(annotation) if member is not NoneType]


def _member(members: list[Any], name: object) -> Any:
    """Return the union member that pydantic calls ``name``.

    If no class has this name, it is the first member that is no dataclass.
    """
    # An annotation that is not a class may have no name.
    matches = [member for member in members if getattr(member, "__name__", None) == name]
    return (matches or [m for m in members if not is_dataclass(m)] or members)[0]


def _inner(annotation: Any, step: object) -> Any:
    """Return the type of the value at ``step`` within a value; Any if it is not known."""
    # Only classes that pydantic validates have this attribute.
    fields = getattr(annotation, "__pydantic_fields__", {})
    if step in fields:
        return fields[step].annotation
    types = get_args(annotation)
    if isinstance(step, int) and step < len(types) and get_origin(annotation) is tuple:
        return types[step]
    return types[-1] if get_origin(annotation) in {dict, list} else Any


def short(value: Any) -> str:
    """Return ``value`` as a text of at most 60 characters."""
    try:
        text = repr(plain(value))
    except RecursionError:
        # A YAML alias may refer to a value that contains it.
        text = f"a {type(value).__name__} that contains itself"
    except ValueError:
        # Python writes no whole number of more than 4300 digits.
        text = "a number of too many digits"
    # Arrays of some kinds are written in several lines.
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def printable(text: str) -> str:
    """Return a text of a file without what commands a terminal, which is written as an escape.

    Tabs and ends of lines stay.
    """
    return "".join(
        each if each.isprintable() or each in "\n\t" else each.encode("unicode_escape").decode()
        for each in text
    )


@contextmanager
def drawn_of(what: str) -> Iterator[None]:
    """Refuse numbers that no picture can be made of, such as those of a run that has diverged.

    Args:
        what: What is drawn within the block, for messages.

    Raises:
        InvalidInputError: If a library cannot take the numbers.
    """
    try:
        yield
    except InvalidInputError:
        raise
    except (ValueError, ArithmeticError, LookupError, MemoryError) as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise InvalidInputError(f"{what}: cannot be drawn of these numbers: {text}") from error


def require_type(key: str, value: object, *kinds: type) -> None:
    """Raise an InvalidInputError unless ``value`` is an instance of one of ``kinds``.

    Args:
        key: Name of the value in the message.
        value: Value to check.
        kinds: Classes that it may be of.
    """
    if not isinstance(value, kinds):
        names = ["None" if kind is NoneType else kind.__name__ for kind in kinds]
        raise wrong_class(key, value, *names)


def wrong_class(key: str, value: object, *names: str) -> InvalidInputError:
    """Return the error of a value that is of none of the classes that it may be of.

    Args:
        key: Name of the value in the message.
        value: The value.
        names: Names of the classes.
    """
    text = short(value) if type(value).__module__ == "builtins" else type(value).__name__
    return InvalidInputError(f"{key}: must be of class {' or '.join(names)}, not {text}")


def require_several(key: str, value: object) -> None:
    """Raise an InvalidInputError unless a value is a list or a tuple.

    Args:
        key: Name of the value, for the message.
        value: The value.
    """
    if not isinstance(value, (list, tuple)):
        raise InvalidInputError(f"{key}: must be a list, not {short(value)}")


# Lengths that only a slip of the unit explains [m].
_FAR = 10.0


def metres_hint(length: float) -> str:
    """Return what to ask about a length [m] that is hardly meant so; empty for any other."""
    return "; lengths are in metres: are these millimetres?" if length > _FAR else ""


def given_twice(names: Iterable[T]) -> T | None:
    """Return the first name that is there for the second time; None if there is none."""
    seen = set[T]()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def plural(count: int, one: str, several: str = "") -> str:
    """Return a count of things, as 1 pair or 2 pairs.

    Args:
        count: How many there are.
        one: What one of them is called.
        several: What others are called; by default the same with an s.
    """
    return f"{count} {one if count == 1 else several or f'{one}s'}"


def nearest(name: str, names: list[str], shown_by: str = "") -> str:
    """Return a hint what to use instead of ``name``: the closest of ``names``, or which there are.

    Args:
        name: What was given.
        names: What it may be; of more than 40 the first few are told.
        shown_by: Command that shows all of them.
    """
    close = get_close_matches(name, names, n=3, cutoff=0.5)
    if close:
        return "nearest: " + ", ".join(close)
    if len(names) > _MOST_NAMES:
        others = f"or another of {len(names)}{f' that {shown_by} shows' if shown_by else ''}"
        names = [*names[:_SOME_NAMES], others]
    return "it may be " + ", ".join(names)


def plain(value: Any) -> Any:
    """Return ``value`` with arrays as lists and NumPy numbers as Python numbers."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    # NumPy is slow to import; where nothing has imported it, no value is of it.
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, (numpy.ndarray, numpy.generic)):
        return value.tolist()
    return value


# As files of any program have them: Python would also take 1_000 and the digits of any script.
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def is_number(value: Any) -> bool:
    """Return whether a value is a finite number; true and false are none."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        # A whole number that is larger than any other.
        return False


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number, of Python or NumPy; true and false are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def decimal(text: str) -> float:
    """Return the number that a text is.

    Raises:
        ValueError: If it is none, or none that is finite.
    """
    digits = text.strip()
    if not _DECIMAL.fullmatch(digits) or not isfinite(number := float(digits)):
        raise ValueError(f"must be a finite decimal number, not {text!r}")
    return number
