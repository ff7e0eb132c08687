"""Colours and textures of a model: what cannot be read of them is left out; no motion needs it."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from xml.etree.ElementTree import Element

from ...inputs.complaints import short
from ...inputs.numbers import decimal
from .geometry import about
from .packages import Packages

# Files of textures that Drake and a playback read.
_PICTURES = {".png", ".jpg", ".jpeg", ".ktx2"}
_SDF_COLOURS = {"ambient", "diffuse", "specular", "emissive"}
_SDF_TEXTURE = "drake:diffuse_map"


def mend_materials(root: Element, packages: Packages) -> list[str]:
    """Leave out colours and textures that Drake refuses, and name textures by their files.

    Args:
        root: The model, which is changed in place.
        packages: Where its textures are looked for.

    Returns:
        Warnings about what is left out.
    """
    mend: dict[str, Callable[[Element, _Materials], None]] = {
        "robot": _mend_urdf,
        "sdf": _mend_sdf,
        "mujoco": _mend_mjcf,
    }
    materials = _Materials(packages)
    mend[root.tag](root, materials)
    return materials.warnings()


class _Materials:
    """What is said of materials, and left out of them."""

    def __init__(self, packages: Packages) -> None:
        self._packages = packages
        self._colours: list[str] = []
        self._textures: list[str] = []
        self.undefined: list[str] = []
        self.unreadable: set[str] = set()

    def is_colour(self, text: str | None, *sizes: int) -> bool:
        """Return whether a text is a colour of so many numbers; one that is none is noted."""
        try:
            numbers = [decimal(part) for part in (text or "").split()]
        except ValueError:
            numbers = []
        found = len(numbers) in sizes and all(0.0 <= number <= 1.0 for number in numbers)
        if not found:
            self._colours.append(short(text or ""))
        return found

    def texture(self, name: str | None) -> str | None:
        """Return the file of a texture as a URI; None if there is none, which is noted."""
        name = (name or "").strip()
        file = self._packages.file(name) if name else None
        if file is None or file.suffix.lower() not in _PICTURES:
            self._textures.append(short(name))
            return None
        return file.as_uri()

    def warnings(self) -> list[str]:
        """Return one warning for each kind of what is left out."""
        undefined = [name for name in self.undefined if name not in self.unreadable]
        return [
            *about(self._colours, "colours that are not numbers from 0 to 1 are left out:"),
            *about(self._textures, "textures that are no picture or missing are left out:"),
            *about(undefined, "materials that are not defined are left out:"),
        ]


def _mend_urdf(root: Element, materials: _Materials) -> None:
    visuals = root.findall("link/visual")
    for material in [*root.findall("material"), *root.findall("link/visual/material")]:
        for colour in material.findall("color"):
            if not materials.is_colour(colour.get("rgba"), 4):
                material.remove(colour)
                materials.unreadable.add(material.get("name", ""))
        for texture in material.findall("texture"):
            if (uri := materials.texture(texture.get("filename"))) is None:
                material.remove(texture)
                materials.unreadable.add(material.get("name", ""))
            else:
                texture.set("filename", uri)
    _define(root, visuals, materials)


def _define(root: Element, visuals: list[Element], materials: _Materials) -> None:
    """Give each material that is only named what defines it, which Drake must have read before."""
    # Drake reads those of the robot first.
    known: set[str] = set()
    for material in root.findall("material"):
        if (name := material.get("name")) and len(material):
            known.add(name)
        else:
            root.remove(material)
    defined = {m.get("name"): list(m) for v in visuals for m in v.findall("material") if len(m)}
    for visual in visuals:
        for material in visual.findall("material"):
            name = material.get("name", "")
            if not name or name in known:
                continue
            if not len(material):
                if name not in defined:
                    visual.remove(material)
                    materials.undefined.append(name)
                    continue
                material.extend(deepcopy(defined[name]))
            known.add(name)


def _mend_sdf(root: Element, materials: _Materials) -> None:
    for material in root.iter("material"):
        for child in list(material):
            if child.tag in _SDF_COLOURS:
                if child.text and not materials.is_colour(child.text, 3, 4):
                    material.remove(child)
            elif child.tag == _SDF_TEXTURE and child.text:
                if (uri := materials.texture(child.text)) is None:
                    material.remove(child)
                else:
                    child.text = uri


def _mend_mjcf(root: Element, materials: _Materials) -> None:
    for element in root.iter():
        if "rgba" in element.attrib and not materials.is_colour(element.get("rgba"), 4):
            del element.attrib["rgba"]
