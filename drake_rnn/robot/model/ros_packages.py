"""Model files before their format counts: XML, the packages that they name, and xacro.

- XML as robot models use it, with prefixes that are not declared.
- The folders of the packages that a model names.
- Expansion of xacro, the macro language of ROS models.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element, TreeBuilder, tostring
from xml.parsers import expat

from pydrake.multibody.parsing import PackageMap

from ...errors import InvalidInputError
from ...inputs.files import content_of, is_file
from ...inputs.messages import nearest, printable
from ...inputs.packages import late_import, packages_of

#: Size of a model file; its meshes are files of their own [bytes].
MOST_BYTES = 20_000_000
# Elements within each other; a body of MJCF is within the one that carries it.
_DEEPEST = 200


def parse_xml(text: bytes) -> Element | None:
    """Return the root element of a document; None if it is not well-formed.

    Prefixes stay part of the names, as in ``drake:acceleration``: models use them undeclared, which
    a parser that knows of namespaces refuses. Comments are left out.

    Raises:
        ValueError: If it has a document type, whose entities could be other files or without end,
            or more than 200 elements within each other.
    """
    builder, depth = TreeBuilder(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        if depth == _DEEPEST:
            raise ValueError(_TOO_DEEP)
        depth += 1
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return None
    return builder.close()


_TOO_DEEP = f"is nested too deeply: it may have {_DEEPEST} elements within each other"


def require_shallow(root: Element) -> None:
    """Raise a ValueError if a document of several files is nested deeper than one may be."""
    elements, depth = [root], 0
    while elements:
        if (depth := depth + 1) > _DEEPEST:
            raise ValueError(_TOO_DEEP)
        elements = [child for element in elements for child in element]


def _refuse_document_type(*_: object) -> None:
    raise ValueError("has a document type, <!DOCTYPE ...>; write out what its entities stand for")


def write_xml(root: Element) -> str:
    """Return a document as text."""
    return tostring(root, encoding="unicode")


# ROS packages of models are often renamed by adding or removing one of these.
_ENDINGS = ("_description", "_support")


class Packages:
    """The packages that a model's ``package://`` names may refer to.

    A package is looked for, in this order, among the folders that are given; in the folders above
    the model, by their name or their ``package.xml``; in ``ROS_PACKAGE_PATH`` and among Drake's
    own; and in ``AMENT_PREFIX_PATH``. Above the model it is also found under a name with
    ``_description`` or ``_support`` added or removed.

    Args:
        folders: Folders by package.
        model: Model file.
    """

    def __init__(self, folders: Mapping[str, str], model: Path) -> None:
        self._given = {name: Path(folder) for name, folder in folders.items()}
        self._folder = model.resolve().parent

    def beside(self, model: Path) -> Packages:
        """Return the packages that another model file may refer to, where the same are given."""
        return Packages({name: str(folder) for name, folder in self._given.items()}, model)

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None if there is none."""
        return next(self._candidates(name), None)

    def file(self, uri: str) -> Path | None:
        """Return the file that a model means by ``uri``; None if there is no such file.

        Args:
            uri: ``package://`` or ``model://`` and a package, ``file://`` and an absolute name, or
                a name relative to the model.
        """
        return next((place.resolve() for place in self._places(uri) if is_file(place)), None)

    def what_else(self, uri: str) -> str:
        """Return what there is instead of a file that a model means; empty for nothing."""
        place = next((each for each in self._places(uri) if each.exists()), None)
        if place is None:
            return ""
        return "it is a folder" if place.is_dir() else "it is no regular file"

    def _places(self, uri: str) -> Iterator[Path]:
        """Yield where a model may mean a file to be."""
        parts = urlparse(uri)
        if parts.scheme in {"package", "model"}:
            inside = unquote(parts.path).lstrip("/")
            yield from (folder / inside for folder in self._candidates(parts.netloc))
        elif parts.scheme == "file":
            yield Path(unquote(parts.netloc + parts.path))
        else:
            yield self._folder / uri

    @cached_property
    def _package_map(self) -> PackageMap:
        """Drake's own packages and those in ``ROS_PACKAGE_PATH``."""
        packages = PackageMap()
        packages.PopulateFromRosPackagePath()
        return packages

    def _candidates(self, name: str) -> Iterator[Path]:
        if name in self._given:
            yield self._given[name]
            return
        for other in (name, *_variants(name)):
            yield from self._above(other)
        if self._package_map.Contains(name):
            # Drake downloads its own models when they are first asked for.
            with suppress(RuntimeError):
                yield Path(self._package_map.GetPath(name))
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
            if prefix and (folder := Path(prefix) / "share" / name).is_dir():
                yield folder

    def _above(self, name: str) -> Iterator[Path]:
        """Yield folders above the model that are, contain or declare the package."""
        for folder in (self._folder, *self._folder.parents):
            if folder.name == name or _declared_name(folder) == name:
                yield folder
            if (inner := folder / name).is_dir():
                yield inner


def _variants(name: str) -> Iterator[str]:
    for ending in _ENDINGS:
        if name.endswith(ending):
            yield name.removesuffix(ending)
        yield name + ending


def _declared_name(folder: Path) -> str | None:
    """Return the package that a folder's ``package.xml`` declares."""
    try:
        root = parse_xml(content_of(folder / "package.xml", MOST_BYTES))
    except (OSError, ValueError):
        return None
    return None if root is None else (root.findtext("name") or "").strip()


xacro = late_import("xacro")
# What the process that expands macros may take [bytes, s of the processor, bytes]. The largest
# public files take 2 s.
_BOUNDS = {"most_memory": 10**9, "most_seconds": 10, "most_bytes": MOST_BYTES}
# Letters of what xacro says of a fault, which holds the expression.
_MOST_TEXT = 300


def is_xacro(root: Element) -> bool:
    """Return whether a document contains macros."""
    return any(element.tag.startswith("xacro:") for element in root.iter())


_COLOUR = re.compile(r"\x1b\[[\d;]*m")
_UNDEFINED = re.compile(r"[Uu]ndefined substitution argument '?(\w+)'?")


def expand_xacro(
    file: Path,
    packages: Packages,
    arguments: Mapping[str, object] | None = None,
    key: str = "arm.model",
) -> bytes:
    """Return a document with its macros expanded.

    Args:
        file: The document.
        packages: The packages that its ``$(find ...)`` name.
        arguments: Arguments of the macros; the others have their default values.
        key: Key of the file, for messages.

    Raises:
        InvalidInputError: If xacro is not installed or cannot expand the document, or it has no
            such argument.
    """
    stem = file.name.removesuffix(".xacro").removesuffix(".urdf")
    by_hand = f"expand it with `xacro {file.name} > {stem}.urdf`"
    if xacro is None:
        raise InvalidInputError(
            f"{key}: {file} is a xacro file; {by_hand}, or pip install {packages_of('xacro')}"
        )
    words = {True: "true", False: "false"}
    texts = {
        name: words[value] if isinstance(value, bool) else str(value)
        for name, value in (arguments or {}).items()
    }
    result, missing = _expanded(file, packages, texts)
    asked, fault = result["asked"], result["fault"]
    if said := result["said"].strip():
        # What the file says by itself, as a warning of it; xacro colours it.
        print(printable(_COLOUR.sub("", said)), file=sys.stderr)
    if missing:
        raise InvalidInputError(
            f"{key}: {file} names the unknown package {missing[0]!r}; give its folder in "
            "arm.packages"
        )
    if fault:
        text = " ".join(fault.split())
        if (match := _UNDEFINED.search(text)) is not None:
            raise InvalidInputError(
                f"{key}: {file} needs the argument {match[1]!r}; give it in "
                f"arm.xacro_arguments: {{{match[1]}: ...}}"
            )
        hint = f"; its arguments are given in arm.xacro_arguments: {', '.join(asked[:12])}"
        text = text if len(text) <= _MOST_TEXT else f"{text[:_MOST_TEXT]}..."
        raise InvalidInputError(f"{key}: {file} cannot be expanded: {text}{hint if asked else ''}")
    if unknown := [name for name in texts if name not in asked]:
        raise InvalidInputError(
            f"arm.xacro_arguments.{unknown[0]}: {file.name} has no such argument; "
            + nearest(unknown[0], asked)
        )
    return bytes(result["text"], "utf-8")


def _expanded(
    file: Path, packages: Packages, arguments: Mapping[str, str]
) -> tuple[dict[str, Any], list[str]]:
    """Return what `xacro_process` says of a file, and the packages that were not found.

    Macros are computed in a process of their own: only there can be bounded what they take.
    """
    task = {"file": str(file), "arguments": arguments, "path": sys.path, **_BOUNDS}
    command = [sys.executable, "-I", str(Path(__file__).with_name("xacro_process.py"))]
    missing: list[str] = []
    with (
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as process,
        # It may end at any time.
        suppress(BrokenPipeError),
    ):
        assert process.stdin is not None
        assert process.stdout is not None
        print(json.dumps(task), file=process.stdin, flush=True)
        for line in process.stdout:
            message = json.loads(line)
            if "find" not in message:
                return message, missing
            if (folder := packages.find(message["find"])) is None:
                missing.append(message["find"])
            answer = None if folder is None else str(folder)
            print(json.dumps(answer), file=process.stdin, flush=True)
    seconds, memory = _BOUNDS["most_seconds"], _BOUNDS["most_memory"] / 1e9
    fault = f"takes more than {seconds} s of the processor, or {memory:g} GB of memory"
    return {"fault": fault, "asked": [], "said": ""}, missing
