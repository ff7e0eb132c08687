"""The fields of dataclasses by name."""

from __future__ import annotations

from typing import Any


def field_names(cls: type) -> tuple[str, ...]:
    """Return the names of a dataclass's fields; an empty tuple for any other class."""
    # Only dataclasses have this attribute.
    return tuple(getattr(cls, "__dataclass_fields__", ()))


def unchecked(value: Any, **fields: Any) -> Any:
    """Return a copy of a dataclass object with other values of some fields, which nothing checks.

    So a field is set to what is no argument, as an entry for each of many robots.
    """
    made = object.__new__(type(value))
    made.__dict__.update(fields_of(value) | fields)
    return made


def fields_of(value: object) -> dict[str, Any]:
    """Return the fields of a dataclass object by name; an empty mapping for any other object."""
    # Not listed one by one, so that code that copies or writes an object covers new fields too.
    return {name: getattr(value, name) for name in field_names(type(value))}
