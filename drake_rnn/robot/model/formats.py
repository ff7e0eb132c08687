"""Changes to URDF and SDF where Drake cannot read them.

- Changes to URDF where Drake cannot read it, or reads it differently from its meaning.
- Moments of inertia that a body can have.
- Changes to SDF where Drake cannot read its meshes.
- Joints that follow other joints, as URDF and SDF state them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ...errors import InvalidInputError
from ...inputs.messages import decimal
from .meshes import Colour, Meshes, MeshName, about, mend_geometry
from .ros_packages import Packages


def nearest_possible(entries: Sequence[float]) -> tuple[float, ...] | None:
    """Return the physically possible rotational inertia nearest to an impossible one.

    The principal moments of a body are positive, and none exceeds the sum of the other two. Where
    one does, it becomes that sum; a negative one first becomes a thousandth of the largest.

    Args:
        entries: Moments and products of inertia xx, yy, zz, xy, xz, yz [kg m^2].

    Returns:
        Entries in the same order; None if those given are possible, or all zero.
    """
    xx, yy, zz, xy, xz, yz = entries
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    # Drake accepts the same rounding error.
    rounding = 10.0 * np.finfo(float).eps * abs(moments).max()
    if moments[0] >= -rounding and moments[2] <= moments[0] + moments[1] + rounding:
        return None
    moments = np.maximum(moments, 1e-3 * moments[2])
    if moments[2] <= 0.0:
        return None
    # A little less than the sum, so that rounding cannot exceed it.
    moments[2] = min(moments[2], (moments[0] + moments[1]) * (1.0 - 1e-9))
    possible = axes @ np.diag(moments) @ axes.T
    return tuple(float(possible[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


_SIMPLE = "SimpleTransmission"
#: Types of joints that move.
MOVING = frozenset({"revolute", "continuous", "prismatic"})
_POSITIONS = ("lower", "upper")
# Position limits between two turns in radians and in degrees are suspected to be degrees.
_TURNS, _DEGREES = 4.0 * math.pi + 0.1, 720.0


def mend_urdf(root: Element, meshes: Meshes) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.

    Returns:
        Warnings about changes that alter the physics or the looks.
    """
    _check_limits(root)
    _rename_materials(root)
    missing = _drop_lost_mimics(root)
    _state_motors(root)
    colours = _named_colours(root)
    return [
        *missing,
        *mend_geometry(root, meshes, _mesh, lambda visual: _colour(visual, colours)),
        *_fix_floating_joints(root),
        *_drop_zero_limits(root),
        *_suspected_degrees(root),
        *_mend_inertias(root),
        *meshes.warnings(),
    ]


def _mesh(geometry: Element) -> MeshName | None:
    mesh = geometry.find("geometry/mesh")
    return None if mesh is None else MeshName(mesh, "filename", mesh.get("scale", ""))


def _named_colours(root: Element) -> dict[str, Colour]:
    return {
        name: colour
        for material in _materials(root)
        if (name := material.get("name")) and (colour := _own_colour(material)) is not None
    }


def _rename_materials(root: Element) -> None:
    """Take the name from a material that was defined in another colour before: Drake refuses it."""
    colours: dict[str, Colour] = {}
    for material in _materials(root):
        name, colour = material.get("name", ""), _own_colour(material)
        if name and colour is not None and colours.setdefault(name, colour) != colour:
            material.set("name", "")


def _materials(root: Element) -> list[Element]:
    return [*root.findall("material"), *root.findall("link/visual/material")]


def _own_colour(material: Element) -> Colour | None:
    colour = material.find("color")
    numbers = [] if colour is None else [float(part) for part in colour.get("rgba", "").split()]
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if len(numbers) == 4 else None


def _colour(visual: Element, colours: Mapping[str, Colour]) -> Colour | None:
    if (material := visual.find("material")) is None:
        return None
    return _own_colour(material) or colours.get(material.get("name", ""))


def _fix_floating_joints(root: Element) -> list[str]:
    floating = [joint for joint in root.findall("joint") if joint.get("type") == "floating"]
    for joint in floating:
        joint.set("type", "fixed")
    return about(_names(floating), "floating joints are fixed:")


def _drop_lost_mimics(root: Element) -> list[str]:
    """Leave out what Drake refuses: fixed joints that follow or are followed."""
    joints = root.findall("joint")
    names = {joint.get("name") for joint in joints}
    moving = {joint.get("name") for joint in joints if joint.get("type") != "fixed"}
    dropped_names = []
    for joint in joints:
        for mimic in joint.findall("mimic"):
            if mimic.get("joint") not in names:
                dropped_names.append(joint.get("name", ""))
            if not {joint.get("name"), mimic.get("joint")} <= moving:
                joint.remove(mimic)
    return about(
        dropped_names, "joints that should follow one that there is not move on their own:"
    )


def _limits(root: Element) -> Iterator[tuple[Element, Element]]:
    """Yield the joints that move and their limits."""
    for joint in root.findall("joint"):
        if joint.get("type") in MOVING and (limit := joint.find("limit")) is not None:
            yield joint, limit


def _check_limits(root: Element) -> None:
    """Raise an InvalidInputError for limits that no joint has; Drake's errors name no joint."""
    for joint, limit in _limits(root):
        where = f"arm.model: the limits of {joint.get('name')!r}"
        if joint.get("type") != "continuous":
            lower, upper = (_limit(where, limit, name) for name in ("lower", "upper"))
            if lower > upper:
                raise InvalidInputError(f"{where}: lower is {lower:g}, above upper, {upper:g}")
        for name in ("velocity", "effort"):
            if (value := _limit(where, limit, name)) < 0.0:
                raise InvalidInputError(f"{where}: {name} must not be negative, as {value:g} is")


def _limit(where: str, limit: Element, name: str) -> float:
    """Return a limit as a number, 0 if it is not given.

    Raises:
        InvalidInputError: If it is none, by the name of the joint.
    """
    try:
        return decimal(limit.get(name, "0"))
    except ValueError as error:
        hint = ""
        if "inf" in limit.get(name, "").lower():
            hint = "; without limits of position it is of the type continuous"
            if name not in _POSITIONS:
                hint = "; leave out what is not known"
        raise InvalidInputError(f"{where}: {name} {error}{hint}") from None


def _suspected_degrees(root: Element) -> list[str]:
    joints = [
        joint
        for joint, limit in _limits(root)
        if joint.get("type") == "revolute"
        and any(_TURNS < abs(float(limit.get(name, 0.0))) <= _DEGREES for name in _POSITIONS)
    ]
    return about(_names(joints), "position limits of more than two turns; are they in degrees?")


def _drop_zero_limits(root: Element) -> list[str]:
    warnings = []
    for name in ("velocity", "effort"):
        zero = [joint for joint, limit in _limits(root) if float(limit.get(name, 1.0)) == 0.0]
        for joint in zero:
            for limit in joint.findall("limit"):
                limit.attrib.pop(name, None)
        warnings += about(_names(zero), f"a limit of 0 is taken for an unknown {name} limit:")
    return warnings


def _state_motors(root: Element) -> None:
    """Give each joint whose effort is known one transmission, as Drake takes the effort from it."""
    limits = {
        joint.get("name", ""): joint.find("limit")
        for joint in root.findall("joint")
        if joint.get("type") in MOVING
    }
    motor_joints: set[str] = set()
    actuators: set[str] = set()
    for transmission in root.findall("transmission"):
        joints = {joint.get("name", "") for joint in transmission.findall("joint")}
        names = {motor.get("name", "") for motor in transmission.findall("actuator")}
        simple = _SIMPLE in (transmission.findtext("type") or transmission.get("type") or "")
        if (
            simple
            and joints <= set(limits) - motor_joints
            and not names & actuators
            and len(joints) == 1
        ):
            motor_joints |= joints
            actuators |= names
        else:
            root.remove(transmission)
    for name, limit in limits.items():
        if name not in motor_joints and limit is not None and limit.get("effort") is not None:
            _add_transmission(root, name)


def _add_transmission(root: Element, joint: str) -> None:
    transmission = SubElement(root, "transmission", name=f"{joint}_transmission")
    SubElement(transmission, "type").text = f"transmission_interface/{_SIMPLE}"
    SubElement(transmission, "joint", name=joint)
    SubElement(transmission, "actuator", name=f"{joint}_motor")


def _mend_inertias(root: Element) -> list[str]:
    names = []
    for link in root.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is not None and (value := float(mass.get("value", 0.0))) < 0.0:
            raise InvalidInputError(
                f"arm.model: the mass of {link.get('name')!r} must be at least 0, not {value:g} kg"
            )
        if mass is None or inertia is None or value == 0.0:
            continue
        products = {name: float(inertia.get(name, 0.0)) for name in _ENTRIES}
        if (possible := nearest_possible(tuple(products.values()))) is not None:
            inertia.attrib.update({n: repr(v) for n, v in zip(_ENTRIES, possible, strict=True)})
            names.append(link.get("name", ""))
    return about(names, "no body has the inertia given; the nearest possible one is taken:")


_ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def _names(elements: Iterable[Element]) -> Iterator[str]:
    return (element.get("name", "") for element in elements)


def mend_sdf(root: Element, meshes: Meshes, packages: Packages) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.
        packages: Where the models are that it includes.

    Returns:
        Warnings about changes that alter the physics or the looks.
    """
    warnings = mend_geometry(root, meshes, _sdf_mesh, _sdf_colour)
    for uri in root.iterfind(".//include/uri"):
        if (file := packages.file((uri.text or "").strip())) is not None:
            uri.text = file.as_uri()
    return [*warnings, *meshes.warnings()]


def _sdf_mesh(geometry: Element) -> MeshName | None:
    uri = geometry.find("geometry/mesh/uri")
    scale = geometry.findtext("geometry/mesh/scale", "")
    return None if uri is None else MeshName(uri, scale=scale)


def _sdf_colour(visual: Element) -> Colour | None:
    numbers = [float(part) for part in visual.findtext("material/diffuse", "").split()]
    if len(numbers) not in {3, 4}:
        return None
    return (numbers[0], numbers[1], numbers[2], numbers[3] if len(numbers) == 4 else 1.0)


class Mimic(NamedTuple):
    """A joint at ``multiplier`` times the position of ``joint`` plus ``offset`` [rad or m].

    One that follows none, whose ``joint`` is empty, is held at ``offset``.
    """

    joint: str
    multiplier: float
    offset: float


def mimics_of(root: Element) -> Mapping[str, Mimic]:
    """Return the joints of a model that follow others, by name.

    Raises:
        ValueError: If a multiplier or an offset is not a number.
    """
    mimics = {}
    for joint in root.iter("joint"):
        if (follows := joint.find("mimic")) is not None:
            multiplier, offset = follows.get("multiplier", 1.0), follows.get("offset", 0.0)
        elif (follows := joint.find("axis/mimic")) is not None:
            multiplier = follows.findtext("multiplier", "1")
            reference = float(follows.findtext("reference", "0"))
            offset = float(follows.findtext("offset", "0")) - float(multiplier) * reference
        else:
            continue
        leader = follows.get("joint", "")
        mimics[joint.get("name", "")] = Mimic(leader, float(multiplier), float(offset))
    return mimics
