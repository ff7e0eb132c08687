"""Reading and writing of YAML documents, and construction of objects from them.

Keys that begin with ``x-`` hold what several keys share, as in files of Docker Compose::

    x-arm: &arm {model: panda, tool: {length: 0.1}}
    arm: *arm
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from functools import cache, lru_cache
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar
from warnings import catch_warnings

from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, SequenceNode
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from ..errors import InvalidInputError
from .files import content_of, is_file, with_keys_once
from .kinds import naming
from .messages import (
    decimal,
    field_names,
    given_twice,
    is_number,
    nearest,
    plain,
    sentence,
    short,
)

#: What their names begin with.
EXTENSION = "x-"


def without_extensions(document: Any) -> Any:
    """Return the other keys of a document; what is no mapping as it is."""
    if not isinstance(document, Mapping):
        return document
    return {key: value for key, value in document.items() if not is_extension(key)}


def is_extension(key: Any) -> bool:
    """Return whether a key only holds what others share."""
    return isinstance(key, str) and key.startswith(EXTENSION)


T = TypeVar("T")

#: Values that a document may hold when its aliases are expanded.
_MOST_VALUES = 1_000_000
# Lines and commas of a document: of a list, each takes 35 us to read, and of a mapping twice that.
_MOST_PARTS = 50_000
# Size of a document [bytes].
_MOST_BYTES = 1_000_000
# Values within each other; all that goes through a document can recurse so deep.
_DEEPEST = 100
_TOO_DEEP = f"nested too deeply: it may have {_DEEPEST} values within each other"
# Size of a whole number, which is beyond that of any other number [bits].
_MOST_BITS = 1024
_TOO_LONG = "holds a number of too many digits"
#: What a value is of which a tag, such as ``!degrees``, stands before the text: tag by tag.
Tags = tuple[tuple[str, Callable[[str], Any]], ...]


def parse_yaml(text: str, source: str, tags: Tags = ()) -> Any:
    """Return the contents of a YAML 1.2 document.

    Args:
        text: The document.
        source: Name of the document in messages.
        tags: Tags that it may have besides those of YAML itself.

    Raises:
        InvalidInputError: If it is not YAML, holds a key twice, is nested or long without measure,
            or refers to itself.
    """
    return deepcopy(_parsed_yaml(text, source, tags))


@lru_cache(maxsize=64)
def _parsed_yaml(text: str, source: str, tags: Tags) -> Any:
    """Return what `parse_yaml` does, of which nothing may be changed; the reader is slow."""
    if sum(map(text.count, ",\n\r")) > _MOST_PARTS:
        raise InvalidInputError(
            f"{source}: has more than {_MOST_PARTS} lines and commas; a long list of numbers "
            "belongs into a CSV file"
        )
    # Anchors may be used again, and version 1.1 of YAML has other ways to write numbers.
    with _refusals(source), catch_warnings(action="ignore"):
        if "<<" in text:
            _require_few_merges(YAML(typ="safe", pure=True).compose(text), source)
        content = _reader(tags).load(text)
    try:
        require_measure(content, _MOST_VALUES)
    except ValueError as error:
        raise InvalidInputError(f"{source}: {error}") from None
    return content


def _reader(tags: Tags) -> YAML:
    """Return a reader of YAML that knows some tags besides those of YAML itself."""
    reader = YAML(typ="safe", pure=True)
    if tags:
        constructor_type: Any = type("_Constructor", (SafeConstructor,), {})
        for tag, value_of in tags:
            constructor_type.add_constructor(
                tag, lambda constructor, node, f=value_of: f(constructor.construct_scalar(node))
            )
        reader.Constructor = constructor_type
    return reader


def records_of(file: Path, most: int) -> Iterator[Any]:
    """Yield the records in a YAML or JSON file of another tool, such as messages of ROS.

    Args:
        file: The file; ``---`` stands between records.
        most: Size that it may have [bytes].

    Raises:
        OSError: If it cannot be opened or read.
        ValueError: If it is too large, no text, neither YAML nor JSON, nested or long without
            measure, or refers to itself.
    """
    try:
        text = content_of(file, most).decode("utf-8-sig")
        if file.suffix.lower() == ".json":
            records = iter((json.loads(text, object_pairs_hook=with_keys_once),))
        else:
            records = _yaml_records(text)
        for record in records:
            # Each value takes a letter, unless aliases repeat it.
            require_measure(record, len(text))
            yield record
    except UnicodeDecodeError:
        raise ValueError("is not a text file") from None
    except RecursionError:
        raise ValueError(f"is {_TOO_DEEP}") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"is no JSON: {error}") from None


def _yaml_records(text: str) -> Iterator[Any]:
    # Its parser in C is a hundred times as fast as that of documents; few files need it.
    yaml: Any = import_module("yaml")
    if "<<" in text:
        raise ValueError("has merges (<<), which are not read here")
    try:
        for record in yaml.load_all(text, Loader=_record_loader(yaml)):
            if record is not None:
                yield record
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
        raise ValueError(f"is no YAML: {place}{error.problem}") from None
    except yaml.YAMLError as error:
        raise ValueError(f"is no YAML: {' '.join(str(error).split())}") from None


@cache
def _record_loader(yaml: Any) -> type:
    """Return a reader of YAML whose every complaint has a place in the text."""
    base = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader

    class Loader(base):  # type: ignore[misc, valid-type]
        """A reader that takes no key twice, of which it would keep the last."""

        def construct_object(self, node: Any, deep: bool = False) -> Any:
            try:
                return super().construct_object(node, deep)
            except (ValueError, LookupError, AttributeError, TypeError):
                # A whole number or a date that is none, for one.
                problem = f"{short(node.value)} is not as its form or tag says"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from None

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            mapping = super().construct_mapping(node, deep)
            if len(mapping) != len(node.value):
                # Two keys may be one in other words, such as 1 and 01.
                twice = given_twice(key.value for key, _ in node.value) or node.value[-1][0].value
                problem = f"the key {twice!r} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
            return mapping

    return Loader


def list_of(record: Mapping[str, Any], key: str) -> list[Any]:
    """Return the list of a record, empty if there is none.

    Raises:
        ValueError: If it is something else.
    """
    value = record.get(key)
    if value is None:
        return []
    if not isinstance(value, list):
        raise ValueError(f"{key}: must be a list, not {short(value)}")
    return value


def numbers_of(value: Any, names: str = "") -> list[float]:
    """Return the finite numbers of a list of a record.

    Args:
        value: The list, or a mapping of names to numbers.
        names: These names, a letter each.

    Raises:
        ValueError: If it is none.
    """
    if isinstance(value, Mapping) and names:
        value = [value.get(name, 0.0) for name in names]
    if not isinstance(value, list) or len(value) > _MOST_VALUES:
        raise ValueError(f"must be a list of numbers, not {short(value)}")
    return [number_of(each) for each in value]


def number_of(value: Any) -> float:
    """Return a finite number of a record; 1e-05 is a text to YAML 1.1.

    Raises:
        ValueError: If it is none.
    """
    if is_number(value):
        return float(value)
    if not isinstance(value, str):
        raise ValueError(f"must be a finite number, not {short(value)}")
    return decimal(value)


@contextmanager
def _refusals(source: str) -> Iterator[None]:
    """Turn what a reader of YAML raises into a sentence that names the document."""
    try:
        yield
    except RecursionError:
        raise InvalidInputError(f"{source}: {_TOO_DEEP}") from None
    except DuplicateKeyError as error:
        key = str(error.problem).split('"')[1]
        raise InvalidInputError(f"{source}: the key {key!r} is given twice") from None
    except InvalidInputError:
        raise
    except (ValueError, KeyError) as error:
        # Python reads no whole number of more than 4300 digits; a tag may not fit its value.
        text = _TOO_LONG if "digits" in str(error) else f"a value is not as its tag says: {error}"
        raise InvalidInputError(f"{source}: {text}") from None
    except YAMLError as error:
        raise InvalidInputError(f"{source}: not a YAML document: {_problem(error)}") from None


def _problem(error: YAMLError) -> str:
    """Return what is wrong with a document, and where."""
    place, problem = "", str(error)
    if isinstance(error, MarkedYAMLError):
        problem = error.problem or problem
        if (mark := error.problem_mark) is not None:
            place = f"line {mark.line + 1}, column {mark.column + 1}: "
    return place + " ".join(problem.split()).removeprefix("but ")


def _require_few_merges(document: Any, source: str) -> None:
    """Raise an InvalidInputError if merges (<<) of merges repeat keys beyond measure.

    Args:
        document: Node of the document, of which nothing is merged yet.
        source: Name of the document in messages.
    """
    counts: dict[int, int] = {}

    def count(node: Any) -> int:
        """Return the number of keys that a mapping, or a list of mappings, has when merged."""
        if id(node) not in counts:
            # One that merges itself is told of elsewhere.
            counts[id(node)] = 0
            if isinstance(node, MappingNode):
                keys = (count(v) if key.value == "<<" else 1 for key, v in node.value)
                counts[id(node)] = sum(keys)
                for _, value in node.value:
                    count(value)
            elif isinstance(node, SequenceNode):
                counts[id(node)] = sum(map(count, node.value))
        return counts[id(node)]

    count(document)
    if sum(counts.values()) > _MOST_VALUES:
        raise InvalidInputError(f"{source}: its merges (<<) repeat more than {_MOST_VALUES} keys")


def require_measure(content: Any, most: int) -> None:
    """Raise a ValueError if a document or a number in it has no end, or hardly one.

    Args:
        content: What the document holds.
        most: Number of values that it may hold when its aliases are expanded.
    """
    values, count = [(content, 0)], 0
    while values:
        value, depth = values.pop()
        count += 1
        if count > most:
            raise ValueError(f"refers to itself, or holds more than {most} values")
        if depth > _DEEPEST:
            raise ValueError(f"refers to itself, or is {_TOO_DEEP}")
        if isinstance(value, (dict, list, tuple)):
            inner = value.values() if isinstance(value, dict) else value
            values += ((each, depth + 1) for each in inner)
        elif isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise ValueError(_TOO_LONG)


def read_yaml(file: Path, tags: Tags = ()) -> Any:
    """Return the contents of a YAML 1.2 file.

    Args:
        file: The file.
        tags: See `parse_yaml`.

    Raises:
        InvalidInputError: If the file is missing, unreadable, not YAML, or holds a key twice.
    """
    try:
        text = content_of(file, _MOST_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise InvalidInputError(f"{file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InvalidInputError(f"{file}: not a text file") from None
    except ValueError as error:
        raise InvalidInputError(f"{file}: {error}") from None
    return parse_yaml(text, str(file), tags)


def _campaign_hint(folder: Path) -> str:
    """Return what is done with the folder of a campaign where a document is asked for."""
    if is_file(folder / "table.csv"):
        return (
            "is the folder of a campaign; `drake-rnn campaign` and `compare` take it, and "
            f"{folder / 'experiment.yaml'} is its experiment"
        )
    return (
        "is the folder of a campaign that was stopped; "
        f"`drake-rnn campaign {folder / 'campaign.yaml'} --out {folder.parent}` goes on with it"
    )


def read_named(
    name: str, files: Mapping[str, Path], section: str, cls: type
) -> tuple[dict[str, Any], Path]:
    """Return the contents of a shipped document or of a YAML file, and the file.

    Args:
        name: Name of a shipped document, or of a ``.yaml`` or ``.yml`` file.
        files: Files of the shipped documents by name.
        section: Kind of document, for messages.
        cls: Class that the document describes.

    Raises:
        InvalidInputError: If there is no such document, the file is not a YAML mapping, or has a
            key that only holds what others refer to.
    """
    file = files.get(name, Path(name))
    if is_file(file / "campaign.yaml"):
        raise InvalidInputError(f"{section}: {name} {_campaign_hint(file)}")
    if is_file(file / f"{section}.yaml"):
        raise InvalidInputError(
            f"{section}: {name} is the folder of a run; its document is {file / section}.yaml, and "
            f"`drake-rnn plot`, `replay`, `film` and `compare` take the folder"
        )
    if file.suffix not in {".yaml", ".yml"}:
        shown_by = "drake-rnn list" if section == "experiment" else ""
        hint = nearest(name, sorted(files), shown_by)
        raise InvalidInputError(f"{section}: no {section} {name!r}; {hint}, or a .yaml file")
    document = read_yaml(file)
    if not isinstance(document, dict):
        raise InvalidInputError(f"{file}: must be a mapping of keys to values")
    _require_no_store(document, cls)
    # A copy for each alias: a later change of one key must change no other.
    return plain(without_extensions(document)), file


def _require_no_store(document: Mapping[str, Any], cls: type) -> None:
    """Raise an InvalidInputError for an unknown key to whose value others refer by an alias."""
    users: dict[int, set[str]] = {}
    for name, value in document.items():
        inside = [value]
        while inside:
            each = inside.pop()
            if isinstance(each, (dict, list)):
                users.setdefault(id(each), set()).add(name)
                inside += each.values() if isinstance(each, dict) else each
    for key in without_extensions(document).keys() - set(field_names(cls)):
        if users.get(id(document[key]), set()) - {key}:
            raise InvalidInputError(
                f"{key}: no such key; give what several keys share under a key that begins "
                f"with {EXTENSION}, such as {EXTENSION}{key}"
            )


def to_yaml(document: Mapping[str, Any]) -> str:
    """Return plain data and arrays as YAML; reading it gives the same numbers, bit for bit."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 100
    stream = StringIO()
    yaml.dump(_quote(plain(document)), stream)
    return stream.getvalue()


def _quote(value: Any) -> Any:
    """Return ``value`` with quotes around texts that YAML may misread by their first character."""
    if isinstance(value, dict):
        return {_quote(key): _quote(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_quote(entry) for entry in value]
    if isinstance(value, str) and not value[:1].isalnum():
        return DoubleQuotedScalarString(value)
    return value


def construct(cls: type[T], values: Any, key: str) -> T:
    """Return an object of a validated class.

    Args:
        cls: The class.
        values: Its arguments by name.
        key: Key of the values in the document, for messages.

    Raises:
        InvalidInputError: If a value is invalid; in one line, the key, the value and what it
            may be.
    """
    place = key or "document"
    if not isinstance(values, Mapping):
        raise InvalidInputError(
            f"{place}: must be a mapping of keys to values, not {short(values)}"
        )
    try:
        # A user's own class may fail in ways of its own.
        with naming(f"{place}: {cls.__name__}", but=ValidationError):
            target: Any = cls
            value: T = _adapter(target).validate_python(dict(values))
            return value
    except ValidationError as error:
        raise InvalidInputError(sentence(cls, error.errors(include_url=False), key)) from None


@lru_cache(maxsize=256)
def _adapter(cls: Any) -> TypeAdapter[Any]:
    # It takes milliseconds to make, and a sequence may have thousands of parts of one class.
    return TypeAdapter(cls)


def without_kind(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section without its ``kind``."""
    return {name: value for name, value in document.items() if name != "kind"}


# A file system takes 255 bytes, and commands put a word before a name or after it.
_MOST_NAME_BYTES = 200
_NO_FOLDER = re.compile(r"[/\\\x00-\x1f\x7f\ud800-\udfff]|^\.+$|^\s|\s$")


def require_folder_name(key: str, name: str) -> None:
    """Raise a ValueError unless a folder can be called by a name, or the name is empty.

    Args:
        key: Key of the name, for the message.
        name: The name.
    """
    if _NO_FOLDER.search(name):
        raise ValueError(f"{key}: must be a valid folder name, not {name!r}")
    if name.startswith("-"):
        raise ValueError(
            f"{key}: must not begin with -, as options of a command do, not {short(name)}"
        )
    if (size := len(name.encode())) > _MOST_NAME_BYTES:
        raise ValueError(f"{key}: may have {_MOST_NAME_BYTES} bytes, and has {size}: {short(name)}")
