"""Digests of all that the numbers of a run depend on: equal digests mean equal numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..inputs.files import is_file
from ..inputs.messages import plain
from ..inputs.packages import versions

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

    Files that such a file includes, and modules that such a module imports, do not count.

    Args:
        document: Contents of an experiment's document.
    """
    files = {name: _digest(name) for name in sorted(set(_files(document)))}
    return _hashed([files, stamp()])


def row_key(document: Mapping[str, Any], around: str, what: str) -> str:
    """Return the name under which a row is kept, a digest of all that its run depends on.

    Args:
        document: Contents of the experiment's document.
        around: The document's `surroundings`.
        what: Kind of outcome that is kept.
    """
    told = {key: value for key, value in document.items() if key not in _WORDS}
    return _hashed([plain(told), around, what])


def _hashed(contents: Any) -> str:
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
