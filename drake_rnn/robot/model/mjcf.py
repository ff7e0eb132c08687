"""Changes to MJCF, MuJoCo's format, where Drake cannot read it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ...errors import InvalidInputError
from ...inputs.given_file import content_of
from .meshes import Meshes
from .packages import Packages
from .xml_text import MOST_BYTES, parse_xml


def mend_mjcf(root: Element, meshes: Meshes, packages: Packages) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.
        packages: Where its files are.

    Returns:
        Warnings about changes that alter the physics or the looks.

    Raises:
        InvalidInputError: If a file that it includes cannot be read.
    """
    _include(root, packages)
    _read_meshes(root, meshes)
    _place_by_ends(root)
    _sites_as_bodies(root)
    _state_motors(root)
    return meshes.warnings()


def _include(root: Element, packages: Packages) -> None:
    """Put the content of included files in the place of their names, as MuJoCo does."""
    for parent in list(root.iter()):
        for place, element in reversed(list(enumerate(parent))):
            if element.tag != "include":
                continue
            name = element.get("file", "")
            file = packages.file(name)
            try:
                included = None if file is None else parse_xml(content_of(file, MOST_BYTES))
            except ValueError as error:
                raise InvalidInputError(f"arm.model: the file {name!r} {error}") from None
            if included is None:
                raise InvalidInputError(
                    f"arm.model: the file {name!r} that it includes cannot be read"
                )
            _include(included, packages)
            if root.get("model") is None and included.get("model") is not None:
                root.set("model", included.get("model", ""))
            parent[place : place + 1] = list(included)


def _read_meshes(root: Element, meshes: Meshes) -> None:
    folders = [c.get("meshdir") or c.get("assetdir") for c in root.findall("compiler")]
    folder = next((name for name in folders if name), ".")
    lost = dict[str, str]()
    for assets in root.findall("asset"):
        for mesh in assets.findall("mesh"):
            if (name := mesh.get("file")) is None:
                continue
            mesh.set("name", mesh.get("name") or Path(name).stem)
            file = meshes.plain(uri := str(Path(folder) / name))
            if file is None:
                assets.remove(mesh)
                lost[mesh.get("name", "")] = uri
            else:
                mesh.set("file", str(file))
    if lost:
        _drop_geometries(root, lost, meshes)


def _drop_geometries(root: Element, lost: Mapping[str, str], meshes: Meshes) -> None:
    """Leave out the geometries of meshes that cannot be read, also of those that classes name."""
    for body, geometry, known in _geometries(root):
        if (mesh := known.get("mesh", "")) in lost:
            body.remove(geometry)
            meshes.lose(body.get("name", ""), lost[mesh])
    for geometry in root.iterfind(".//default/geom"):
        if geometry.get("mesh") in lost:
            del geometry.attrib["mesh"]


def _geometries(root: Element) -> list[tuple[Element, Element, dict[str, str]]]:
    """Return each geometry with its body, and its attributes with those of its class."""
    found = list[tuple[Element, Element, dict[str, str]]]()
    named = {
        name: tags.get("geom", {})
        for top in root.findall("default")
        for name, tags in _classes(top, "main", {})
    }

    def look(body: Element, inherited: str) -> None:
        for geometry in body.findall("geom"):
            known = named.get(geometry.get("class", inherited), {})
            found.append((body, geometry, {**known, **geometry.attrib}))
        for child in body.findall("body"):
            look(child, child.get("childclass", inherited))

    for world in root.findall("worldbody"):
        look(world, "main")
    return found


def _place_by_ends(root: Element) -> None:
    """Give boxes and ellipsoids from one point to another a pose and sizes, as MuJoCo does."""
    for _, geometry, known in _geometries(root):
        if known.get("type") not in {"box", "ellipsoid"} or "fromto" not in known:
            continue
        ends = np.array([float(part) for part in known["fromto"].split()]).reshape(2, 3)
        width = float(known.get("size", "0").split()[0])
        half = 0.5 * float(np.linalg.norm(ends[1] - ends[0]))
        geometry.attrib.pop("fromto", None)
        geometry.set("pos", " ".join(map(repr, ends.mean(axis=0).tolist())))
        # The way from the second to the first end is z.
        geometry.set("zaxis", " ".join(map(repr, (ends[0] - ends[1]).tolist())))
        geometry.set("size", f"{width!r} {width!r} {half!r}")


def _sites_as_bodies(root: Element) -> None:
    """Turn named sites, which Drake leaves out, into bodies without mass: frames of that name."""
    taken = {body.get("name") for body in root.iter("body")}
    pose = {"name", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"}
    for parent in root.iter("body"):
        for site in parent.findall("site"):
            if site.get("name") is None or site.get("name") in taken:
                continue
            site.tag = "body"
            for attribute in set(site.keys()) - pose:
                del site.attrib[attribute]


def _state_motors(root: Element) -> None:
    """Turn what drives a joint into one motor with its limit: Drake does not know the others."""
    defaults = {
        name: tags for top in root.findall("default") for name, tags in _classes(top, "main", {})
    }
    for actuators in root.findall("actuator"):
        driven = set()
        for drive in list(actuators):
            joint = drive.get("joint")
            actuators.remove(drive)
            if joint is None or joint in driven:
                continue
            driven.add(joint)
            known = {**defaults.get(drive.get("class", "main"), {}).get(drive.tag, {})}
            known.update(drive.attrib)
            limit = known.get("forcerange")
            if limit is None and drive.tag == "motor":
                limit = known.get("ctrlrange")
            motor = SubElement(actuators, "motor", name=f"{joint}_motor", joint=joint)
            if limit is not None:
                motor.set("forcerange", limit)


def _classes(
    element: Element, name: str, inherited: Mapping[str, Mapping[str, str]]
) -> Iterator[tuple[str, dict[str, dict[str, str]]]]:
    """Yield each class below an element with the attributes that it sets, inherited ones too."""
    tags = {tag: dict(values) for tag, values in inherited.items()}
    for child in element:
        if child.tag != "default":
            tags.setdefault(child.tag, {}).update(child.attrib)
    yield element.get("class", name), tags
    for child in element.findall("default"):
        yield from _classes(child, "", tags)
