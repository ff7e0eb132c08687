"""Reading of experiments, shipped ones or YAML files, with changes by dotted keys.

- Changes of a document, by dotted keys such as ``law.kappa``.
- The comments at the head of documents that are written: their schema, and the versions.
- Digests of all that the numbers of a run depend on: equal digests mean equal numbers.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import is_dataclass
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from pathlib import Path as File
from types import NoneType
from typing import Any

from ..diagrams import EXPERIMENTS, SCHEMAS
from ..errors import InvalidInputError
from ..inputs.documents import parse_yaml, read_named, require_measure, without_extensions
from ..inputs.files import is_file
from ..inputs.kinds import look_beside
from ..inputs.messages import field_names, fields_of, nearest, plain, require_type, short
from ..inputs.packages import versions
from ..robot.limits_file import limits_beside
from ..robot.load_arm import shipped_arms
from .components import Arms
from .document import ExperimentDocument
from .experiment import Experiment, make_experiment

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


# Names in a dotted key, and values of one.
_MOST_NAMES, _MOST_VALUES = 20, 10_000_000


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
        if key.count(".") >= _MOST_NAMES:
            raise InvalidInputError(f"{short(key)}: may have {_MOST_NAMES} names with dots")
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
    other_names = set(keys)
    for key in sorted(other_names):
        names = key.split(".")
        for count in range(1, len(names)):
            if (whole := ".".join(names[:count])) in other_names:
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
    files_visited = set()
    for value in values:
        if (text := repr(_same(plain(value)))) in files_visited:
            raise InvalidInputError(f"{place}: has the value {short(value)} twice")
        files_visited.add(text)


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


# Sections that may be a text alone, and the key that it stands for.
_SHORT = {"arm": "model"}


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a document in place; None removes it.

    An entry of a list has its number as a key, from 0 on.

    Raises:
        InvalidInputError: If the key leads into a value that has no keys.
    """
    *folders, last = key.split(".")
    place: Any = document
    for depth, folder in enumerate(folders):
        where = ".".join(folders[: depth + 1])
        if isinstance(place, list):
            inner = place[_number(place, folder, key)]
        else:
            inner = place.setdefault(folder, {})
            if where in _SHORT and isinstance(inner, str):
                inner = place[folder] = {_SHORT[where]: inner}
        if not isinstance(inner, (dict, list)):
            raise InvalidInputError(f"{key}: {where} is {inner!r}, which has no keys")
        place = inner
    if isinstance(place, list):
        k = _number(place, last, key)
        place[k : k + 1] = [] if value is None else [value]
    elif value is None:
        place.pop(last, None)
    else:
        place[last] = value
    rival = _RIVALS.get(key.split(".")[0])
    if rival is not None and value is not None:
        document.pop(rival, None)


def _number(entries: list[Any], name: str, key: str) -> int:
    """Return the number of an entry of a list that a part of a key names."""
    if not (name.isdecimal() and int(name) < len(entries)):
        raise InvalidInputError(
            f"{key}: {name} names no entry of {short(entries)}; entries are numbered, 0 to "
            f"{len(entries) - 1}"
        )
    return int(name)


#: A shipped name, a YAML file, a document, its contents as plain data, or an experiment.
ExperimentSource = str | File | Mapping[str, Any] | ExperimentDocument | Experiment


def shipped_experiments() -> list[str]:
    """Return the names of the shipped experiments.

    All can be run except ``state_adjustment_printed``: its target, as printed in the paper, cannot
    be reached.
    """
    return sorted(_shipped_files())


@cache
def _shipped_files() -> Mapping[str, File]:
    """Return the files of the shipped experiments by name."""
    return {file.stem: file for file in EXPERIMENTS.glob("*/*.yaml")}


def load_experiment(
    experiment: ExperimentSource,
    changes: Mapping[str, Any] | None = None,
    *,
    arms: Arms | None = None,
) -> Experiment:
    """Return an experiment by its shipped name or from a YAML file, checked as a whole.

    Args:
        experiment: A name from `shipped_experiments`, a file, or a document to change.
        changes: New values by dotted key, e.g. ``{"law.kappa": 8}``; None removes a key. Setting
            ``period`` removes ``integrator`` and vice versa; a duration that ends before the
            document's window removes ``window`` and ``accept``.
        arms: Arms that were loaded for other experiments; one that is missing is added.

    Raises:
        InvalidInputError: If a key is wrong; the message names it, its value and what it may be.
    """
    require_type("arms", arms, Arms, NoneType)
    loaded_experiment = make_experiment(read_document(experiment, changes), arms=arms)
    keys = [key for key, value in (changes or {}).items() if value is None]
    if keys:
        before, _ = _contents(experiment)
        for key in keys:
            # Together with a new kind, keys of the former kind may be removed.
            if not _holds(before, key):
                _require_known(loaded_experiment, key)
    return loaded_experiment


def _holds(document: Mapping[str, Any], key: str) -> bool:
    place: Any = document
    for name in key.split("."):
        if not isinstance(place, Mapping) or name not in place:
            return False
        place = place[name]
    return True


def _require_known(experiment: Experiment, key: str) -> None:
    """Raise an InvalidInputError if the document can have no such key, as if misspelt."""
    *folders, last = key.split(".")
    sections: dict[str, Any] = {"law": experiment.law, "path": experiment.path}
    sections = fields_of(experiment.document) | sections
    if len(folders) > 1 or (folders and not is_dataclass(sections.get(folders[0]))):
        return
    within = type(sections[folders[0]] if folders else experiment.document)
    if last not in (names := field_names(within)):
        raise InvalidInputError(f"{key}: no such key; {nearest(last, list(names))}")


def read_document(
    experiment: ExperimentSource, changes: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the contents of an experiment's document with ``changes``, not yet checked.

    Raises:
        InvalidInputError: If there is no such experiment, the file is not a YAML mapping, or
            ``changes`` is not a mapping of dotted keys.
    """
    changes = checked_changes(changes)
    document, name = _contents(experiment)
    for key, value in changes.items():
        # A copy, because a later key may change something inside the caller's value.
        set_key(document, key, _copy(value, key))
    if isinstance(experiment, (str, File)) and is_file(experiment):
        look_beside(document, File(experiment).resolve().parent)
    _name_limits(document)
    _cut_short(document, changes)
    return {**document, "name": name if document.get("name") in (None, "") else document["name"]}


def _contents(experiment: ExperimentSource) -> tuple[dict[str, Any], str]:
    """Return a copy of a document's contents, and the name to use if they give none."""
    if isinstance(experiment, Experiment):
        return experiment.document.contents(), ""
    if isinstance(experiment, ExperimentDocument):
        return experiment.contents(), ""
    if isinstance(experiment, Mapping):
        return _copy(without_extensions(experiment), "experiment"), ""
    require_type("experiment", experiment, str, File, Mapping, ExperimentDocument, Experiment)
    return _read(str(experiment))


def _read(name: str) -> tuple[dict[str, Any], str]:
    """Return the contents of a shipped document or of a YAML file, and the file's name."""
    document, file = read_named(name, _shipped_files(), "experiment", ExperimentDocument)
    # Names of models and CSV files are relative to the document's folder.
    resolve_files(document, file.parent)
    return document, file.stem


def _cut_short(document: dict[str, Any], changes: Mapping[str, Any]) -> None:
    if "duration" not in changes or "window" in changes:
        return
    duration, window, numbers = document.get("duration"), document.get("window"), (int, float)
    until = window[-1] if isinstance(window, list) and window else None
    if isinstance(duration, numbers) and isinstance(until, numbers) and until > duration:
        document.pop("window")
        if not any(key.split(".")[0] == "accept" for key in changes):
            document.pop("accept", None)


def named_files(document: dict[str, Any]) -> list[tuple[str, dict[str, Any], str]]:
    """Return where a document may name files and folders: the key as users read it, section, key.

    Args:
        document: Contents of an experiment's document.
    """
    entries = []
    for prefix, each in (("", document), ("second.", _section(document, "second"))):
        arm, targets = _section(each, "arm"), _section(each, "targets")
        environment, other = _section(each, "environment"), _section(_section(arm, "pair"), "arm")
        arms = [(f"{prefix}arm", arm), (f"{prefix}arm.pair.arm", other)]
        arms += [(f"{place}.gripper", _section(section, "gripper")) for place, section in arms]
        entries += [
            *(
                (f"{place}.{key}", section, key)
                for place, section in arms
                for key in ("model", "limits", "capsules", "srdf", "looks")
            ),
            *((f"{prefix}{key}.file", path, "file") for key, path in _path_sections("path", each)),
            (f"{prefix}targets.file", targets, "file"),
            (f"{prefix}environment.model", environment, "model"),
            *(
                (f"{place}.packages.{key}", packages, key)
                for place, section in arms
                for packages in (_section(section, "packages"),)
                for key in packages
            ),
        ]
    for number, obstacle in enumerate(_obstacle_sections(document)):
        moving = _path_sections(f"obstacles[{number}].moves", obstacle)
        entries += [(f"obstacles[{number}].file", obstacle, "file")]
        entries += [(f"{key}.file", path, "file") for key, path in moving]
    return entries


def resolve_files(document: dict[str, Any], folder: File) -> None:
    """Make names of files absolute, in place, where they are relative to a document's folder.

    Args:
        document: Contents of an experiment's document.
        folder: Folder of the document.
    """
    for name, section, key in named_files(document):
        value = section.get(key)
        # Not `exists`, because a folder may have the name of a shipped arm.
        exists = File.is_dir if ".packages." in name else File.is_file
        if isinstance(value, str) and exists(folder / value):
            # Absolute, so that the document means the same wherever it is saved.
            section[key] = str((folder / value).resolve())


def _path_sections(key: str, document: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Return the section of a path and, in a sequence, those of its parts, with their keys."""
    path = document.get(key.rpartition(".")[2])
    if not isinstance(path, dict):
        return []
    parts = path.get("parts")
    entries = enumerate(parts) if isinstance(parts, list) else ()
    inner = [
        each
        for number, part in entries
        if isinstance(part, dict)
        for each in _path_sections(f"{key}.parts.{number}.path", part)
    ]
    return [(key, path), *inner]


def _obstacle_sections(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the sections of the obstacles."""
    section = document.get("obstacles")
    return [each for each in section if isinstance(each, dict)] if isinstance(section, list) else []


def _name_limits(document: dict[str, Any]) -> None:
    """Name the limits found beside a model, so that the document names all files that it uses."""
    arms = [_section(document, "arm"), _section(_section(document, "second"), "arm")]
    arms += [_section(_section(arm, "pair"), "arm") for arm in arms]
    for arm in arms:
        model = arm.get("model")
        if not isinstance(model, str) or "limits" in arm or model in shipped_arms():
            continue
        if (beside := limits_beside(File(model))) is not None:
            arm["limits"] = str(beside.resolve())


def _section(document: dict[str, Any], key: str) -> dict[str, Any]:
    section = document.get(key)
    return section if isinstance(section, dict) else {}


def _copy(value: Any, key: str) -> Any:
    """Return a copy of a value of a document, which a key names in messages."""
    try:
        require_measure(value, _MOST_VALUES)
    except ValueError as error:
        raise InvalidInputError(f"{key}: {error}") from None
    return deepcopy(value)


def schema_line(document: str, place: str | None = None) -> str:
    """Return the line by which language servers of editors find the schema of a document.

    Args:
        document: ``experiment``, ``campaign`` or ``claims``.
        place: The schema's file, relative to the document; by default that of this installation.
    """
    place = (SCHEMAS / f"{document}.json").as_uri() if place is None else place
    return f"# yaml-language-server: $schema={place}\n"


def written_head(document: str) -> str:
    """Return the head of a document that a run writes: its schema, and what the run was made by."""
    made_by = "".join(f"# {package} {number}\n" for package, number in versions().items())
    return schema_line(document) + made_by


#: Subpackages and files on which no number of a run depends.
_AFTERWARDS = {"cli", "claims", "figures", "film", "playback", "jobs", "report"}
_ONLY_SEEN = {"colours.py"}
#: Keys of an experiment's document on which no number of a run depends.
_WORDS = {"name", "paper", "expect", "over"}


@cache
def stamp() -> str:
    """Return the versions of the packages, with a digest of this package's own files.

    The digest reveals a change of the code even if its version stays the same.
    """
    package = Path(__file__).parents[1]
    digest = sha256()
    rooms = [package, *(each for each in package.iterdir() if each.is_dir())]
    for room in sorted(room for room in rooms if room.name not in _AFTERWARDS):
        files = room.iterdir() if room == package else room.rglob("*")
        code = sorted(file for file in files if file.suffix in {".py", ".urdf"})
        for file in code:
            if room != package or file.name not in _ONLY_SEEN:
                digest.update(file.read_bytes())
        for file in sorted(room.glob("*/*.yaml")) if room.name == "models" else ():
            digest.update(file.read_bytes())
    numbers = ", ".join(f"{name} {number}" for name, number in versions().items())
    return f"{numbers}, code {digest.hexdigest()[:12]}"


def surroundings(document: Mapping[str, Any]) -> str:
    """Return a digest of the versions, and of the files and modules that a document names.

    Files that such a file includes, and modules that such a module imports, do not count.

    Args:
        document: Contents of an experiment's document.
    """
    files = {name: _digest(name) for name in sorted(set(_files(document)))}
    return _hash([files, stamp()])


def row_key(document: Mapping[str, Any], around: str, what: str) -> str:
    """Return the name under which a row is kept, a digest of all that its run depends on.

    Args:
        document: Contents of the experiment's document.
        around: The document's `surroundings`.
        what: Kind of outcome that is kept.
    """
    contents = {key: value for key, value in document.items() if key not in _WORDS}
    return _hash([plain(contents), around, what])


def _hash(contents: Any) -> str:
    return sha256(json.dumps(contents, sort_keys=True, default=repr).encode()).hexdigest()[:32]


def forget_files() -> None:
    """Forget the digests of files, because the files may have changed."""
    _digest.cache_clear()
    _file_of.cache_clear()


def _files(value: Any) -> Iterator[str]:
    """Yield the files that texts of a document name, and the files of modules that they name."""
    if isinstance(value, Mapping):
        for entry in value.values():
            yield from _files(entry)
    elif isinstance(value, (list, tuple)):
        # A list of numbers names no files, and it may be long.
        if value and not isinstance(value[0], (int, float)):
            for entry in value:
                yield from _files(entry)
    elif isinstance(value, str) and (file := _file_of(value)):
        yield file


@cache
def _file_of(text: str) -> str:
    """Return the file that a text names, or whose module it names; empty for other texts."""
    if ":" in text and text.partition(":")[0].replace(".", "").isidentifier():
        try:
            spec = find_spec(text.partition(":")[0])
        except (ImportError, ValueError):
            return ""
        return "" if spec is None or spec.origin is None else str(spec.origin)
    try:
        return text if is_file(text) else ""
    except OSError:
        # The text is too long for a file name.
        return ""


@cache
def _digest(file: str) -> str:
    try:
        return sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ""
