"""Model files before their format counts: XML, the packages that they name, and xacro.

- XML as robot models use it, with prefixes that are not declared.
- The folders of the packages that a model names.
- Expansion of xacro, the macro language of ROS models.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element, TreeBuilder, tostring
from xml.parsers import expat

from pydrake.multibody.parsing import PackageMap

from ...errors import InvalidInputError
from ...inputs.files import is_file
from ...inputs.messages import nearest
from ...inputs.packages import late_import, packages_of

#: Size of a model file; its meshes are files of their own [bytes].
MOST_BYTES = 20_000_000


def parse_xml(text: bytes) -> Element | None:
    """Return the root element of a document; None if it is not well-formed.

    Prefixes stay part of the names, as in ``drake:acceleration``: models use them undeclared, which
    a parser that knows of namespaces refuses. Comments are left out.

    Raises:
        ValueError: If it has a document type, whose entities could be other files or without end.
    """
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return None
    return builder.close()


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
        root = parse_xml((folder / "package.xml").read_bytes())
    except (OSError, ValueError):
        return None
    return None if root is None else (root.findtext("name") or "").strip()


xacro = late_import("xacro")
substitution: Any = None if xacro is None else late_import("xacro.substitution_args")


def is_xacro(root: Element) -> bool:
    """Return whether a document contains macros."""
    return any(element.tag.startswith("xacro:") for element in root.iter())


class _Arguments(dict[str, str]):
    """Arguments of macros that note which of them are asked for."""

    def __init__(self, folders: Mapping[str, object]) -> None:
        words = {True: "true", False: "false"}
        texts = {k: words[v] if isinstance(v, bool) else str(v) for k, v in folders.items()}
        super().__init__(texts)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


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
    mappings = _Arguments(arguments or {})
    stem = file.name.removesuffix(".xacro").removesuffix(".urdf")
    if xacro is None:
        by_hand = f"expand it with `xacro {file.name} > {stem}.urdf`"
        raise InvalidInputError(
            f"{key}: {file} is a xacro file; {by_hand}, or pip install {packages_of('xacro')}"
        )
    with _finding(packages) as missing:
        try:
            contents = bytes(
                xacro.process_file(str(file), mappings=mappings).toxml(encoding="utf-8")
            )
        # What macros raise is not known: they may contain Python.
        except Exception as error:
            if missing:
                raise InvalidInputError(
                    f"{key}: {file} names the unknown package {missing[0]!r}; give its folder in "
                    "arm.packages"
                ) from None
            text = " ".join(str(error).split())
            if (match := _UNDEFINED.search(text)) is not None:
                raise InvalidInputError(
                    f"{key}: {file} needs the argument {match[1]!r}; give it in "
                    f"arm.xacro_arguments: {{{match[1]}: ...}}"
                ) from None
            hint = ""
            if names_asked := ", ".join(sorted(mappings.asked)[:12]):
                hint = f"; its arguments are given in arm.xacro_arguments: {names_asked}"
            raise InvalidInputError(f"{key}: {file} cannot be expanded: {text}{hint}") from None
    if unknown := [name for name in mappings if name not in mappings.asked]:
        raise InvalidInputError(
            f"arm.xacro_arguments.{unknown[0]}: {file.name} has no such argument; "
            + nearest(unknown[0], sorted(mappings.asked))
        )
    return contents


@contextmanager
def _finding(packages: Packages) -> Iterator[list[str]]:
    """Have xacro find packages as we do; by itself it needs an installed ROS.

    Yields:
        The packages that were not found.
    """
    missing: list[str] = []

    def find(package: str) -> str:
        folder = packages.find(package)
        if folder is None:
            missing.append(package)
            raise LookupError(package)
        return str(folder)

    of_ros = substitution._eval_find
    substitution._eval_find = find
    try:
        yield missing
    finally:
        substitution._eval_find = of_ros
