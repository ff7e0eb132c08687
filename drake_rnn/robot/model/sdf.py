"""Changes to SDF where Drake cannot read its meshes."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from .conversion import Colour
from .geometry import MeshName, mend_geometry
from .meshes import Meshes
from .packages import Packages


def mend_sdf(root: Element, meshes: Meshes, packages: Packages) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.
        packages: Where the models are that it includes.

    Returns:
        Warnings about changes that alter the physics or the looks.
    """
    warnings = mend_geometry(root, meshes, _mesh, _colour)
    for uri in root.iterfind(".//include/uri"):
        if (file := packages.file((uri.text or "").strip())) is not None:
            uri.text = file.as_uri()
    return [*warnings, *meshes.warnings()]


def _mesh(geometry: Element) -> MeshName | None:
    uri = geometry.find("geometry/mesh/uri")
    scale = geometry.findtext("geometry/mesh/scale", "")
    return None if uri is None else MeshName(uri, scale=scale)


def _colour(visual: Element) -> Colour | None:
    numbers = [float(part) for part in visual.findtext("material/diffuse", "").split()]
    if len(numbers) not in {3, 4}:
        return None
    return (numbers[0], numbers[1], numbers[2], numbers[3] if len(numbers) == 4 else 1.0)
