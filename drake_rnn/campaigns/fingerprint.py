"""What the numbers of a run depend on, as a text that differs wherever they may differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..inputs.complaints import plain
from ..inputs.versions import versions

#: Rooms and files of this package that no number of a run depends on.
_AFTERWARDS = {"cli", "claims", "figures", "film", "playback", "campaigns", "report"}
_ONLY_SEEN = {"colours.py"}
#: Keys of an experiment's document that no number of a run depends on.
_WORDS = {"name", "paper", "expect", "over"}


@cache
def stamp() -> str:
    """Return the versions of the packages, with a digest of this package's own files.

    So a change of the code is noticed before its version is.
    """
    package = Path(__file__).parents[1]
    digest = sha256()
    rooms = [package, *(each for each in package.iterdir() if each.is_dir())]
    for room in sorted(room for room in rooms if room.name not in _AFTERWARDS):
        found = room.iterdir() if room == package else room.rglob("*")
        code = sorted(file for file in found if file.suffix in {".py", ".urdf"})
        for file in code:
            if room != package or file.name not in _ONLY_SEEN:
                digest.update(file.read_bytes())
        for file in sorted(room.glob("*/*.yaml")) if room.name == "models" else ():
            digest.update(file.read_bytes())
    numbers = ", ".join(f"{name} {number}" for name, number in versions().items())
    return f"{numbers}, code {digest.hexdigest()[:12]}"


def surroundings(document: Mapping[str, Any]) -> str:
    """Return a digest of the versions, and of the files and modules that a document names.

    What such a file includes, and what such a module imports, is not looked at.

    Args:
        document: Contents of an experiment's document.
    """
    files = {name: _digest(name) for name in sorted(set(_files(document)))}
    return _hashed([files, stamp()])


def row_key(document: Mapping[str, Any], around: str, what: str) -> str:
    """Return the name under which the row of a run is kept; it stands for all the run depends on.

    Args:
        document: Contents of the experiment's document.
        around: Its `surroundings`.
        what: What is kept of the run.
    """
    told = {key: value for key, value in document.items() if key not in _WORDS}
    return _hashed([plain(told), around, what])


def _hashed(contents: Any) -> str:
    return sha256(json.dumps(contents, sort_keys=True, default=repr).encode()).hexdigest()[:32]


def forget_files() -> None:
    """Forget digests of files, which may have changed since."""
    _digest.cache_clear()
    _file_of.cache_clear()


def _files(value: Any) -> Iterator[str]:
    """Yield the files, and the files of the modules, that texts of a document name."""
    if isinstance(value, Mapping):
        for entry in value.values():
            yield from _files(entry)
    elif isinstance(value, (list, tuple)):
        # Lists of numbers may be long, and their entries are alike.
        if value and not isinstance(value[0], (int, float)):
            for entry in value:
                yield from _files(entry)
    elif isinstance(value, str) and (file := _file_of(value)):
        yield file


@cache
def _file_of(text: str) -> str:
    """Return the file that a text names, itself or as ``module:Class``; empty if none."""
    if ":" in text and text.partition(":")[0].replace(".", "").isidentifier():
        try:
            spec = find_spec(text.partition(":")[0])
        except (ImportError, ValueError):
            return ""
        return "" if spec is None or spec.origin is None else str(spec.origin)
    try:
        return text if Path(text).is_file() else ""
    except OSError:
        # Too long for the name of a file.
        return ""


@cache
def _digest(file: str) -> str:
    try:
        return sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ""
