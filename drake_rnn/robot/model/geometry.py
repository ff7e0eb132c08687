"""Meshes of links, as URDF and SDF have them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
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
        scale: Scale of the mesh, as the model has it; empty if it has none.
    """

    element: Element
    attribute: str | None = None
    scale: str = ""

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
    only Drake reads is meant for contact in Drake, and stays. If the model is read for distances,
    all meshes stay as their convex hulls.

    Args:
        root: The model, which is changed in place.
        meshes: The meshes that it names.
        mesh_of: Returns the mesh of a visual or collision element; None for another shape.
        colour_of: Returns the colour that a visual element gives to its mesh.

    Returns:
        Warnings about what is left out.
    """
    dropped, missing = list[str](), list[tuple[str, str]]()
    for link in root.iter("link"):
        if meshes.for_distances:
            _keep_hulls(link, meshes, mesh_of)
            continue
        _show(link, meshes, mesh_of, colour_of)
        name = link.get("name", "")
        for uri in _drop_collisions(link, meshes, mesh_of):
            if meshes.is_missing(uri):
                missing.append((name, uri))
            else:
                dropped.append(name)
    return [
        *about(dropped, "collision meshes count for distances, but make no contact: those of"),
        *_missing(missing, meshes),
    ]


def _show(
    link: Element,
    meshes: Meshes,
    mesh_of: Callable[[Element], MeshName | None],
    colour_of: Callable[[Element], Colour | None],
) -> None:
    """Make the drawn meshes of a link readable, and leave out those that are not."""
    for visual in link.findall("visual"):
        if (mesh := mesh_of(visual)) is None:
            continue
        if (file := meshes.shown(mesh.uri, colour_of(visual))) is None:
            link.remove(visual)
        else:
            mesh.change(file)


def _drop_collisions(
    link: Element, meshes: Meshes, mesh_of: Callable[[Element], MeshName | None]
) -> Iterator[str]:
    """Leave out the collision meshes of a link that are not meant for Drake, and yield them."""
    for collision in link.findall("collision"):
        if (mesh := mesh_of(collision)) is None:
            continue
        file = meshes.touched(mesh.uri)
        if file is None or collision.find("drake:proximity_properties") is None:
            link.remove(collision)
            yield mesh.uri
        else:
            mesh.change(file)


def _keep_hulls(
    link: Element, meshes: Meshes, mesh_of: Callable[[Element], MeshName | None]
) -> None:
    """Put convex hulls in the places of a link's meshes, and leave out those that have none."""
    for number, shape in enumerate((*link.findall("visual"), *link.findall("collision"))):
        # Drake refuses a name that is given twice.
        shape.set("name", f"shape_{number}")
        for material in shape.findall("material"):
            shape.remove(material)
        if (mesh := mesh_of(shape)) is None:
            continue
        if (file := meshes.hull(mesh.uri, mesh.scale)) is None:
            link.remove(shape)
            meshes.lose(link.get("name", ""), mesh.uri)
        else:
            mesh.change(file)


def _missing(missing: Iterable[tuple[str, str]], meshes: Meshes) -> list[str]:
    """Return a warning about collision meshes that are missing, from their links and names."""
    hint = meshes.hint(uri for _, uri in missing)
    told = about((f"{uri} of {link!r}" for link, uri in missing), "collision meshes are missing:")
    return [warning + hint for warning in told]


def about(names: Iterable[str], what: str) -> list[str]:
    """Return one warning, ``what`` and some names; none if there are no names."""
    unique = list(dict.fromkeys(names))
    if not unique:
        return []
    shown = ", ".join(unique[:4]) + (f" and {len(unique) - 4} more" if len(unique) > 4 else "")
    return [f"{what} {shown}"]
