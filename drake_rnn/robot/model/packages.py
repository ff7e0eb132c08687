"""The folders of the packages that a model names."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote, urlparse

from pydrake.multibody.parsing import PackageMap

from ...inputs.given_file import is_file
from .xml_text import parse_xml

# ROS packages of models are often renamed by adding or removing one of these.
_ENDINGS = ("_description", "_support")


class Packages:
    """The packages that a model's ``package://`` names may refer to.

    A package is looked for, in this order, among the folders that are given; in the folders above
    the model, by their name or their ``package.xml``; in ``ROS_PACKAGE_PATH`` and among Drake's
    own; and in ``AMENT_PREFIX_PATH``. Above the model it is also found under a name with
    ``_description`` or ``_support`` added or removed.

    Args:
        given: Folders by package.
        model: Model file.
    """

    def __init__(self, given: Mapping[str, str], model: Path) -> None:
        self._given = {name: Path(folder) for name, folder in given.items()}
        self._folder = model.resolve().parent

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
    def _known(self) -> PackageMap:
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
        if self._known.Contains(name):
            # Drake downloads its own models when they are first asked for.
            with suppress(RuntimeError):
                yield Path(self._known.GetPath(name))
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
            if prefix and (folder := Path(prefix) / "share" / name).is_dir():
                yield folder

    def _above(self, name: str) -> Iterator[Path]:
        """Yield folders above the model that are, contain or declare the package."""
        for folder in (self._folder, *self._folder.parents):
            if folder.name == name or _declared(folder) == name:
                yield folder
            if (inner := folder / name).is_dir():
                yield inner


def _variants(name: str) -> Iterator[str]:
    for ending in _ENDINGS:
        if name.endswith(ending):
            yield name.removesuffix(ending)
        yield name + ending


def _declared(folder: Path) -> str | None:
    """Return the package that a folder's ``package.xml`` declares."""
    try:
        root = parse_xml((folder / "package.xml").read_bytes())
    except (OSError, ValueError):
        return None
    return None if root is None else (root.findtext("name") or "").strip()
