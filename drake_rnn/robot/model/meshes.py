"""The meshes that a model names, as files that Drake can read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlparse

import numpy as np

from ...errors import InvalidInputError
from .conversion import Colour, gltf_file, hull_file, obj_file, require_finite
from .packages import Packages


@dataclass(frozen=True)
class LostMesh:
    """A mesh of a link that cannot be read.

    Attributes:
        link: Name of the link.
        mesh: Name of the mesh in the model.
        fault: Why, as the end of a sentence about the mesh.
    """

    link: str
    mesh: str
    fault: str


class Meshes:
    """The meshes that a model names, converted where necessary.

    Args:
        packages: Packages that the model may name.
        for_distances: Whether the model is read for distances, with all of its collision meshes;
            else those stay that make contact.

    Attributes:
        for_distances: The same.
        lost: The meshes of links that were looked for and cannot be read.
    """

    def __init__(self, packages: Packages, for_distances: bool = False) -> None:
        self.for_distances = for_distances
        self.lost: list[LostMesh] = []
        self._packages = packages
        self._missing: list[str] = []
        self._broken: dict[str, str] = {}

    def shown(self, uri: str, colour: Colour | None = None) -> Path | None:
        """Return a mesh as a glTF file, for looks.

        Args:
            uri: Name of the mesh in the model.
            colour: Colour of the parts that have no material of their own.

        Returns:
            The file, or None if the mesh is missing or broken, which `warnings` then says.
        """
        return self._readable(uri, ".gltf", lambda file: gltf_file(file, colour))

    def plain(self, uri: str) -> Path | None:
        """Return a mesh as an OBJ file, for its shape; None as `shown`."""
        return self._readable(uri, ".obj", obj_file)

    def hull(self, uri: str, scale: str) -> Path | None:
        """Return the convex hull of a mesh, before it is scaled, as an OBJ file; None as `shown`.

        Args:
            uri: Name of the mesh in the model.
            scale: Its scale as the model has it, one number or three; empty for 1.
        """

        def convert(file: Path) -> Path:
            _require_scale(scale)
            return hull_file(file)

        return self._readable(uri, None, convert)

    def lose(self, link: str, uri: str) -> None:
        """Note that a mesh of a link could not be read."""
        file = self._packages.file(uri)
        fault = "is missing" if file is None else "cannot be read"
        if reason := self._broken.get(uri if file is None else str(file)):
            fault = f"cannot be read: {reason}"
        self.lost.append(LostMesh(link, uri, fault))

    def is_missing(self, uri: str) -> bool:
        """Return whether there is no file for a mesh."""
        return self._packages.file(uri) is None

    def touched(self, uri: str) -> Path | None:
        """Return a mesh that Drake reads as collision geometry; None if it does not."""
        file = self._packages.file(uri)
        if file is None or file.suffix.lower() not in {".obj", ".vtk", ".gltf"}:
            return None
        try:
            require_finite(file)
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            self._broken[str(file)] = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            return None
        return file

    def warnings(self) -> list[str]:
        """Return one warning about all missing meshes, and one about each broken mesh."""
        told = [
            f"the mesh {name} cannot be read: {fault}; the arm is drawn without it"
            for name, fault in self._broken.items()
        ]
        if self._missing:
            names = list(dict.fromkeys(self._missing))
            hint = self.hint(names)
            which = names[0] if len(names) == 1 else f"{len(names)} meshes, {names[0]} first,"
            verb = "is" if len(names) == 1 else "are"
            them = "it" if len(names) == 1 else "them"
            told.append(f"{which} {verb} missing; the arm is drawn without {them}{hint}")
        return told

    def hint(self, uris: Iterable[str]) -> str:
        """Return how packages of meshes that are not found are given, as the end of a sentence."""
        unknown = {urlparse(uri).netloc for uri in uris if uri.startswith("package://")}
        lost = sorted(name for name in unknown if self._packages.find(name) is None)
        return f"; give the folder of {', '.join(lost)} in arm.packages" if lost else ""

    def _readable(
        self, uri: str, suffix: str | None, convert: Callable[[Path], Path]
    ) -> Path | None:
        file = self._packages.file(uri)
        if file is None:
            if found := self._packages.what_else(uri):
                self._broken[uri] = found
            else:
                self._missing.append(uri)
            return None
        try:
            if file.suffix.lower() != suffix:
                return convert(file)
            if suffix == ".obj":
                _require_faces(file)
            require_finite(file)
            return file
        except InvalidInputError:
            raise
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            self._broken[str(file)] = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            return None


def _require_faces(file: Path) -> None:
    """Raise a ValueError for an OBJ file without faces, of which Drake says no name."""
    kinds = {line.split(maxsplit=1)[0] for line in file.read_bytes().splitlines() if line.strip()}
    if not {b"v", b"f"} <= kinds:
        raise ValueError("it contains no faces")


def _require_scale(scale: str) -> None:
    """Raise a ValueError for a scale that is neither one number nor three, or that leaves none."""
    numbers = [float(part) for part in scale.split()] or [1.0]
    if len(numbers) not in {1, 3} or not np.isfinite(numbers).all() or not all(numbers):
        raise ValueError(f"its scale is {scale!r}")
