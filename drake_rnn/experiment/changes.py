"""Changes of a document, by dotted keys such as ``law.kappa``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from ..errors import InvalidInputError
from ..inputs.complaints import plain, short
from ..inputs.documents import parse_yaml

#: Keys of which a document has one: to set it removes the other.
_RIVALS = {"period": "integrator", "integrator": "period"}


def parse_change(text: str) -> tuple[str, Any]:
    """Return key and value of ``KEY=VALUE``; the value is parsed as YAML.

    Raises:
        InvalidInputError: If key, ``=`` or value is missing, or the value is not valid YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        raise InvalidInputError(
            f"--set: must be KEY=VALUE, or KEY=null to remove a key, not {text!r}"
        )
    return key.strip(), parse_yaml(value, f"--set {key.strip()}")


def checked_changes(changes: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return changes of a document, an empty mapping for None.

    Raises:
        InvalidInputError: If they are not a mapping of dotted keys, or one change replaces the
            section that an earlier change is in.
    """
    if changes is None:
        return {}
    if not isinstance(changes, Mapping) or not all(isinstance(key, str) for key in changes):
        raise InvalidInputError(
            f"changes: must be a mapping of dotted keys to values, not {short(changes)}"
        )
    for key in changes:
        if not all(part.strip() for part in key.split(".")):
            raise InvalidInputError(f"{key!r}: must be a dotted key, e.g. law.kappa")
    require_none_lost(changes)
    return changes


def require_none_lost(changes: Mapping[str, Any], place: str = "changes") -> None:
    """Refuse changes that are made one after the other if one undoes another.

    Args:
        changes: New values by dotted key, in the order in which they are set; None removes a key.
        place: What names them, for messages.

    Raises:
        InvalidInputError: If a key is set, and then what it is in, or what takes its place.
    """
    keys = list(changes)
    for number, key in enumerate(keys):
        for later in keys[number + 1 :]:
            if key.startswith(f"{later}."):
                raise InvalidInputError(
                    f"{place}: {later} is set after {key} and replaces it; leave one of them out"
                )
    if {key.split(".")[0] for key in keys if changes[key] is not None} >= _RIVALS.keys():
        raise InvalidInputError("period: cannot be combined with integrator; change one of them")


def require_apart(keys: Iterable[str], place: str) -> None:
    """Refuse keys that vary if one is a part of another, whose values it would change silently.

    Args:
        keys: Dotted keys.
        place: What names them, for messages.

    Raises:
        InvalidInputError: If one is a part of another.
    """
    known = set(keys)
    for key in sorted(known):
        names = key.split(".")
        for count in range(1, len(names)):
            if (whole := ".".join(names[:count])) in known:
                raise InvalidInputError(
                    f"{place}: {key} is a part of {whole}, which varies too; give its values in "
                    f"those of {whole}"
                )


def require_distinct(place: str, values: Sequence[Any]) -> None:
    """Refuse values that vary if one is given twice: the same run would be counted twice.

    Args:
        place: What names them, for messages.
        values: The values.

    Raises:
        InvalidInputError: If one is given twice.
    """
    seen = set()
    for value in values:
        if (told := repr(_same(plain(value)))) in seen:
            raise InvalidInputError(f"{place}: has the value {short(value)} twice")
        seen.add(told)


def _same(value: Any) -> Any:
    """Return plain data in one form: whole numbers as floats, keys in order, no minus zero."""
    if isinstance(value, dict):
        return sorted(((str(key), _same(each)) for key, each in value.items()), key=lambda e: e[0])
    if isinstance(value, list):
        return [_same(entry) for entry in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        with suppress(OverflowError):
            return float(value) + 0.0 if float(value) == value else value
    return value


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a document in place; None removes it.

    Raises:
        InvalidInputError: If the key leads into a value that has no keys.
    """
    *folders, last = key.split(".")
    place = document
    for depth, folder in enumerate(folders):
        inner = place.setdefault(folder, {})
        if not isinstance(inner, dict):
            where = ".".join(folders[: depth + 1])
            raise InvalidInputError(f"{key}: {where} is {inner!r}, which has no keys")
        place = inner
    if value is None:
        place.pop(last, None)
    else:
        place[last] = value
    rival = _RIVALS.get(key.split(".")[0])
    if rival is not None and value is not None:
        document.pop(rival, None)
