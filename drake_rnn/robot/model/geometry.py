"""Meshes of links, as URDF and SDF have them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from .conversion import Colour
from .meshes import Meshes


@dataclass(frozen=True)
class MeshName:
    """Where a model names a mesh.

    Attributes:
        element: Element that holds the name.
        attribute: Its attribute that is the name; None if its text is.
    """

    element: Element
    attribute: str | None = None

    @property
    def uri(self) -> str:
        """The name."""
        held = self.element.text if self.attribute is None else self.element.get(self.attribute)
        return (held or "").strip()

    def change(self, file: Path) -> None:
        """Name another file."""
        if self.attribute is None:
            self.element.text = file.as_uri()
        else:
            self.element.set(self.attribute, file.as_uri())


def mend_geometry(
    root: Element,
    meshes: Meshes,
    mesh_of: Callable[[Element], MeshName | None],
    colour_of: Callable[[Element], Colour | None],
) -> list[str]:
    """Make the meshes of all links readable, and leave out those that nothing needs.

    Collision meshes are left out, because only the tool makes contact. One with properties that
    only Drake reads is meant for contact in Drake, and stays.

    Args:
        root: The model, which is changed in place.
        meshes: The meshes that it names.
        mesh_of: Returns the mesh of a visual or collision element; None for another shape.
        colour_of: Returns the colour that a visual element gives to its mesh.

    Returns:
        Warnings about what is left out.
    """
    dropped = []
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            if (mesh := mesh_of(visual)) is None:
                continue
            if (file := meshes.shown(mesh.uri, colour_of(visual))) is None:
                link.remove(visual)
            else:
                mesh.change(file)
        for collision in link.findall("collision"):
            if (mesh := mesh_of(collision)) is None:
                continue
            file = meshes.touched(mesh.uri)
            if file is None or collision.find("drake:proximity_properties") is None:
                link.remove(collision)
                dropped.append(link.get("name", ""))
            else:
                mesh.change(file)
    return about(dropped, "collision meshes are left out, of")


def about(names: Iterable[str], what: str) -> list[str]:
    """Return one warning, ``what`` and some names; none if there are no names."""
    unique = list(dict.fromkeys(names))
    if not unique:
        return []
    shown = ", ".join(unique[:4]) + (f" and {len(unique) - 4} more" if len(unique) > 4 else "")
    return [f"{what} {shown}"]
