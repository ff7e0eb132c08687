"""The meshes that a model names, as files that Drake can read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlparse

from ...errors import InvalidInputError
from .conversion import Colour, gltf_file, obj_file
from .packages import Packages


class Meshes:
    """The meshes that a model names, converted where necessary.

    Args:
        packages: Packages that the model may name.
    """

    def __init__(self, packages: Packages) -> None:
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

    def touched(self, uri: str) -> Path | None:
        """Return a mesh that Drake reads as collision geometry; None if it does not."""
        file = self._packages.file(uri)
        readable = file is not None and file.suffix.lower() in {".obj", ".vtk", ".gltf"}
        return file if readable else None

    def warnings(self) -> list[str]:
        """Return one warning about all missing meshes, and one about each broken mesh."""
        told = [
            f"the mesh {name} cannot be read: {fault}; the arm is drawn without it"
            for name, fault in self._broken.items()
        ]
        if self._missing:
            names = list(dict.fromkeys(self._missing))
            unknown = {urlparse(name).netloc for name in names if name.startswith("package://")}
            lost = sorted(name for name in unknown if self._packages.find(name) is None)
            hint = f"; give the folder of {', '.join(lost)} in arm.packages" if lost else ""
            which = names[0] if len(names) == 1 else f"{len(names)} meshes, {names[0]} first,"
            verb = "is" if len(names) == 1 else "are"
            them = "it" if len(names) == 1 else "them"
            told.append(f"{which} {verb} missing; the arm is drawn without {them}{hint}")
        return told

    def _readable(self, uri: str, suffix: str, convert: Callable[[Path], Path]) -> Path | None:
        file = self._packages.file(uri)
        if file is None:
            if found := self._packages.what_else(uri):
                self._broken[uri] = found
            else:
                self._missing.append(uri)
            return None
        if file.suffix.lower() == suffix:
            return file
        try:
            return convert(file)
        except InvalidInputError:
            raise
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            self._broken[str(file)] = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            return None
