"""The fields of dataclasses by name."""

from __future__ import annotations

from typing import Any


def field_names(cls: type) -> tuple[str, ...]:
    """Return the names of a dataclass's fields; none of another class."""
    # What makes a class a dataclass is this attribute; others do not have it.
    return tuple(getattr(cls, "__dataclass_fields__", ()))


def fields_of(value: object) -> dict[str, Any]:
    """Return the fields of a dataclass's object, by name."""
    # By name, so that what copies or writes an object takes every field, future ones too.
    return {name: getattr(value, name) for name in field_names(type(value))}
